"""`rtshcua fmt`: lay sources out in the one style."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.adapters.store.project import Projects
from rtshcua.app.documents import kind_of
from rtshcua.app.exit_codes import exit_code_of, words_of
from rtshcua.app.files import SPECIFICATION, source_files
from rtshcua.app.layout import Laid, of_file, of_text
from rtshcua.app.wording import many
from rtshcua.diagnostics.codes import UNSAFE_FORMAT
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import say, tell
from rtshcua.front.cli.render.diffs import difference
from rtshcua.front.cli.render.findings import Findings
from rtshcua.front.cli.stdout import out, out_rendered
from rtshcua.ground.format.format_text import not_formatted
from rtshcua.ground.language.size_limits import MAX_SIZE

app = typer.Typer(add_completion=False)

STANDARD_INPUT = Path("-")


@app.command()
def fmt(
    paths: Annotated[
        list[Path] | None, typer.Argument(help="sources (.rts), folders of them (this one), or - for standard input")
    ] = None,
    check: Annotated[bool, typer.Option("--check", help="write nothing; 1 where a file is not formatted")] = False,
    diff: Annotated[
        bool, typer.Option("--diff", help="write nothing; show what would change, and 1 where anything would")
    ] = False,
    stdin_filename: Annotated[
        Path | None, typer.Option(help="what standard input is called, and which configuration counts for it")
    ] = None,
    config: Annotated[Path | None, typer.Option(help="the configuration, instead of the nearest one")] = None,
    isolated: Annotated[bool, typer.Option("--isolated", help="take no configuration")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object on the standard output")] = False,
) -> ExitCode:
    """Lay sources out in the one style, in place; comments stay what and where they are (docs/formatting.md).

    A file is replaced in one step, and only where the result says the same with the same comments. One with a syntax
    error is left as it is, and the others are laid out all the same. With - what is read from the standard input goes
    to the standard output.

    Ends with 0 where all is well, 1 where a file has errors, or with --check or --diff is not formatted, 2 where the
    command line is wrong, 3 where a file cannot be read, 70 where laying it out would change what it says:
    please report that.
    """
    findings = Findings(json=as_json)
    given = paths or [Path()]
    if STANDARD_INPUT in given:
        if len(given) > 1 or (as_json and not check):
            message = (
                "with `-` nothing else can be formatted" if len(given) > 1 else "`--json` has no place for the text"
            )
            return findings.refuse(ExitCode.USAGE, "usage", message, "`rtshcua fmt - <old.rts >new.rts`")
        return _standard_input(findings, stdin_filename, Projects(config, isolated=isolated), check=check, diff=diff)
    if stdin_filename is not None:
        return findings.refuse(ExitCode.USAGE, "usage", "`--stdin-filename` is for `-`", "leave it out, or write `-`")
    skipped = [path for path in given if path.suffix.lower() == SPECIFICATION and not path.is_dir()]
    files = source_files([path for path in given if path not in skipped])
    if isinstance(files, Refusal):
        return findings.end(files)
    if not as_json:
        for path in skipped:
            kind = kind_of(path)
            say(f"skipped {path}: it is {'JSON' if kind is None else kind.name}, for which others have formatters")
    wide = _widths(files, Projects(config, isolated=isolated))
    if isinstance(wide, Refusal):
        return findings.end(wide)
    laid = []
    for path, width in wide:
        laid.append(of_file(path, width, write=not (check or diff)))
        if diff and not as_json:
            out_rendered(difference(laid[-1]), end="")
    return _told(findings, laid, check=check, diff=diff, quiet=diff, as_json=as_json)


def _widths(files: Sequence[Path], projects: Projects) -> list[tuple[Path, int]] | Refusal:
    """The files that no configuration excludes, and how wide their lines may be; before anything is written."""
    found = []
    for path in files:
        project = projects.of(path)
        if isinstance(project, Refusal):
            return project
        if not project.excludes(path, project.settings.format.exclude):
            found.append((path, project.settings.format.width))
    return found


def _standard_input(findings: Findings, name: Path | None, projects: Projects, *, check: bool, diff: bool) -> ExitCode:
    path = name or Path("stdin.rts")
    project = projects.of(path)
    if isinstance(project, Refusal):
        return findings.end(project)
    data = sys.stdin.buffer.read(MAX_SIZE + 1) if sys.stdin is not None else b""
    excluded = project.excludes(path, project.settings.format.exclude)
    laid = Laid(path.as_posix(), data, data) if excluded else of_text(path, data, project.settings.format.width)
    if diff:
        out_rendered(difference(laid), end="")
    elif not check and laid.after is not None:
        sys.stdout.flush()
        sys.stdout.buffer.write(laid.after)
    return _told(findings, [laid], check=check, diff=diff, quiet=diff or not check, as_json=False)


def _told(findings: Findings, laid: list[Laid], *, check: bool, diff: bool, quiet: bool, as_json: bool) -> ExitCode:
    """Say what was done, what would be, and what is wrong."""
    changed = [each for each in laid if each.changed and each.error is None]
    found = [finding for each in laid for finding in each.diagnostics]
    if as_json and check:
        told = (not_formatted(each.source, each.after.decode()) for each in changed if each.after is not None)
        found += [each for each in told if each is not None]
    findings.report(found, {each.name: each.source for each in laid if each.diagnostics or each.changed})
    if not as_json:
        if not quiet:
            _counted(laid, changed, check=check)
        for each in laid:
            if each.error is not None:
                tell(exit_code_of(each.error), f"cannot write `{each.name}`: {words_of(each.error)}")
    return findings.finish(
        _code(laid, forbidden=changed if check or diff else []), files=[_object(each) for each in laid]
    )


def _counted(laid: list[Laid], changed: list[Laid], *, check: bool) -> None:
    """The files that changed, and how many there are of each kind."""
    for each in changed:
        out(f"{'not formatted' if check else 'formatted'}: {each.name}")
    rest = sum(each.before == each.after for each in laid)
    if changed or rest or not laid:
        out(_count(len(changed), rest, check=check))


def _code(laid: list[Laid], forbidden: list[Laid]) -> ExitCode:
    """How it ends, the worst first; `forbidden` are files that should have been formatted."""
    if any(finding.code is UNSAFE_FORMAT for each in laid for finding in each.diagnostics):
        return ExitCode.FAULT
    errors = [each.error for each in laid if each.error is not None]
    if errors:
        return exit_code_of(errors[-1])
    if any(each.unreadable for each in laid):
        return ExitCode.INPUT
    refused = any(each.after is None for each in laid)
    return ExitCode.DIAGNOSTICS if refused or forbidden else ExitCode.OK


def _object(laid: Laid) -> dict[str, object]:
    """One file for a program; `error` says why what changed could not be written."""
    error = None if laid.error is None else words_of(laid.error)
    return {"file": laid.name, "changed": laid.changed, "refused": laid.after is None, "error": error}


def _count(changed: int, rest: int, *, check: bool) -> str:
    """The last line: how many files there are of each kind."""
    if not changed:
        return f"{many(rest, 'file')} already formatted"
    done = "would be formatted" if check else "formatted"
    return f"{many(changed, 'file')} {done}" + (f", {many(rest, 'file')} already" if rest else "")
