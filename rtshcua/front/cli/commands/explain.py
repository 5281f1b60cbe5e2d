"""`rtshcua explain`: print the page of a diagnostic code, or the meaning of a finding of `verify-log`."""

import json
import re
import sys
from textwrap import wrap
from typing import Annotated

import typer

from rtshcua.diagnostics.codes import REGISTRY, Code
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.suggest import listed, nearest
from rtshcua.diagnostics.wrapped import WIDTH
from rtshcua.front.cli.faults import fail
from rtshcua.front.cli.render.pages import read_page
from rtshcua.front.cli.stdout import out, out_json, out_rendered

app = typer.Typer(add_completion=False)


@app.command()
def explain(
    code: Annotated[
        str | None, typer.Argument(help="a code (E0310), its name, or a finding of verify-log (seal/missing)")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object on standard output")] = False,
) -> ExitCode:
    """Print what a diagnostic code means, why it matters, and a bad and a good example. Without a code, list all codes.

    For a finding of `verify-log`, print what was found, what it means, the exit code, and what to do.
    """
    if code is None:
        _list(as_json)
        return ExitCode.OK
    found = _find(code)
    if found is None and "/" in code:
        return _of_log(code, as_json=as_json)
    if found is None:
        begun = sorted(
            each for each in REGISTRY if re.fullmatch("[eE][0-9]{1,3}", code) and each.startswith(code.upper())
        )
        if begun:
            return fail(
                ExitCode.USAGE, f"`{code}` is ambiguous: {len(begun)} codes begin with it", f"accepted: {listed(begun)}"
            )
        near = nearest(code, [*REGISTRY, *(each.slug for each in REGISTRY.values())])
        help = f"did you mean `{near}`?" if near is not None else "run `rtshcua explain` to list all codes"
        return fail(ExitCode.USAGE, f"unknown code `{code}`", help)
    page = read_page(found)
    if as_json:
        out_json(json.dumps(_row(found) | page._asdict(), indent=2, ensure_ascii=False))
    elif sys.stdout.isatty():
        _draw(page.text)
    else:
        out_rendered(_reflowed(page.text), end="")
    return ExitCode.OK


def _of_log(word: str, *, as_json: bool) -> ExitCode:
    """Print what a finding about a log means."""
    from rtshcua.front.cli.render import log_slugs

    found = log_slugs.find(word)
    if found is None:
        near = nearest(word, list(log_slugs.every()))
        help = "" if near is None else f"did you mean `{near}`?"
        return fail(ExitCode.USAGE, f"`verify-log` has no finding `{word}`", help)
    if as_json:
        said = found._asdict() | {"exit_code": int(found.exit_code)}
        out_json(json.dumps(said, indent=2, ensure_ascii=False))
        return ExitCode.OK
    out(f"{found.slug}: {found.found}")
    out(found.meaning)
    out(f"exit code {int(found.exit_code)}: {found.exit_code.meaning}")
    if found.help:
        out(f"help: {found.help}")
    return ExitCode.OK


def _find(word: str) -> Code | None:
    """Return a code by its id or name: `E0310`, `e310`, `310` or `dimension-mismatch`."""
    digits = word.upper().removeprefix("E")
    if digits.isascii() and digits.isdigit():
        return REGISTRY.get(f"E{digits.zfill(4)}")
    slug = word.lower().replace("_", "-")
    return next((code for code in REGISTRY.values() if code.slug == slug), None)


def _row(code: Code) -> dict[str, str]:
    return {"code": code.id, "slug": code.slug, "severity": code.severity.value, "meaning": code.meaning}


def _list(as_json: bool) -> None:
    codes = sorted(REGISTRY.values(), key=lambda code: code.id)
    if as_json:
        out_json(json.dumps([_row(code) for code in codes], indent=2, ensure_ascii=False))
        return
    for code in codes:
        out(f"{code.id}  {code.severity.value:7}  {code.slug:24}  {code.meaning}")


def _draw(text: str) -> None:
    from rich.console import Console
    from rich.markdown import Markdown

    Console(width=min(Console().width, WIDTH)).print(Markdown(text))


def _reflowed(text: str) -> str:
    """Wrap the paragraphs of a page for a terminal; examples and tables stay unchanged."""
    lines: list[str] = []
    paragraph: list[str] = []
    fenced = False
    for line in [*text.splitlines(), ""]:
        plain = not fenced and bool(line.strip()) and not line.startswith(("#", "|", ">", "```"))
        if paragraph and (not plain or line.startswith("- ")):
            beneath = "  " if paragraph[0].startswith("- ") else ""
            words = " ".join(each.strip() for each in paragraph)
            lines += wrap(words, WIDTH, subsequent_indent=beneath, break_long_words=False, break_on_hyphens=False)
            paragraph = []
        if plain:
            paragraph.append(line)
            continue
        fenced ^= line.startswith("```")
        lines.append(line)
    return "\n".join(lines[:-1]) + "\n"
