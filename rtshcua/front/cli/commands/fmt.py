"""`rtshcua fmt`: format sources."""

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
        list[Path] | None, typer.Argument(help="sources (.rts), folders (default: here), or - for standard input")
    ] = None,
    check: Annotated[
        bool, typer.Option("--check", help="write nothing; exit code 1 if a file is not formatted")
    ] = False,
    diff: Annotated[
        bool, typer.Option("--diff", help="write nothing; print the changes; exit code 1 if there are any")
    ] = False,
    stdin_filename: Annotated[
        Path | None, typer.Option(help="file name of the standard input, which selects its configuration")
    ] = None,
    config: Annotated[Path | None, typer.Option(help="use this configuration, not the nearest")] = None,
    isolated: Annotated[bool, typer.Option("--isolated", help="ignore all configuration files")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object on standard output")] = False,
) -> ExitCode:
    """Format sources in place, in one style; comments keep their text and place (docs/formatting.md).

    A file is replaced atomically, and only if the result has the same meaning and the same comments. A file with a
    syntax error is left unchanged; the other files are formatted. With -, the standard input is formatted to the
    standard output.

    Exit codes: 0 done; 1 a file has errors, or (--check, --diff) is not formatted; 2 wrong command line; 3 a file
    cannot be read; 70 the formatter would change the meaning, which is a defect: please report it.
    """
    findings = Findings(json=as_json)
    given = paths or [Path()]
    if STANDARD_INPUT in given:
        if len(given) > 1 or (as_json and not check):
            message = (
                "`-` cannot be combined with other paths" if len(given) > 1 else "`--json` requires `--check` with `-`"
            )
            return findings.refuse(ExitCode.USAGE, "usage", message, "`rtshcua fmt - <old.rts >new.rts`")
        return _standard_input(findings, stdin_filename, Projects(config, isolated=isolated), check=check, diff=diff)
    if stdin_filename is not None:
        return findings.refuse(
            ExitCode.USAGE, "usage", "`--stdin-filename` requires `-`", "leave it out, or pass `-` as path"
        )
    skipped = [path for path in given if path.suffix.lower() == SPECIFICATION and not path.is_dir()]
    files = source_files([path for path in given if path not in skipped])
    if isinstance(files, Refusal):
        return findings.end(files)
    if not as_json:
        for path in skipped:
            kind = kind_of(path)
            say(f"skipped {path}: it is {'JSON' if kind is None else kind.name}, which `fmt` does not format")
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
    """Return the files that no configuration excludes, with their line widths."""
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
    """Report the findings and the changed files, and return the exit code."""
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
    """Print the changed files and the counts."""
    for each in changed:
        out(f"{'not formatted' if check else 'formatted'}: {each.name}")
    rest = sum(each.before == each.after for each in laid)
    if changed or rest or not laid:
        out(_count(len(changed), rest, check=check))


def _code(laid: list[Laid], forbidden: list[Laid]) -> ExitCode:
    """Return the exit code of the worst result; `forbidden`: files that should have been formatted already."""
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
    """Return the JSON object of one file; `error` is the reason why it could not be written."""
    error = None if laid.error is None else words_of(laid.error)
    return {"file": laid.name, "changed": laid.changed, "refused": laid.after is None, "error": error}


def _count(changed: int, rest: int, *, check: bool) -> str:
    """Return the last line: the number of changed and of unchanged files."""
    if not changed:
        return f"{many(rest, 'file')} already formatted"
    done = "would be formatted" if check else "formatted"
    return f"{many(changed, 'file')} {done}" + (f", {many(rest, 'file')} already" if rest else "")
