"""`rtshcua docs`: render skills and policies as one page for review and sign-off."""

import sys
import time
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.adapters.store.writing import replace_inside
from rtshcua.app.report_service import ReportRequest, check_report
from rtshcua.app.wording import moment
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import say
from rtshcua.front.cli.render.findings import Findings
from rtshcua.front.cli.stdout import out, out_rendered
from rtshcua.ground.report.policy_report import distinct_names

app = typer.Typer(add_completion=False)


@app.command()
def docs(
    paths: Annotated[list[Path], typer.Argument(help="sources (.rts), or folders of them")],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="the page to write [default: SOURCE.html, or standard output if piped]"),
    ] = None,
    title: Annotated[str | None, typer.Option(help="title of the page [default: the names of its policies]")] = None,
    at: Annotated[
        str | None, typer.Option(help="date of the page, such as 2026-01-31T08:00:00Z [default: now]")
    ] = None,
    since: Annotated[
        Path | None, typer.Option(help="an earlier bundle, source or folder: highlight policy changes")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="print the contents of the page as one JSON object; write no page")
    ] = False,
) -> ExitCode:
    """Render skills and policies as one HTML page that a non-programmer can review and sign off.

    The page describes in plain words who may do what, each rule, the zones with maps, the reactions of the vehicle to
    faults, and the digest to sign. It needs no network and no script, prints on A4, and is reproducible: the same
    sources and the same --at give the same bytes.

    The tests of the sources are run, and the page shows the result of each.

    Exit codes: 0 done; 1 the sources have errors, or --since shows that a policy changed without a higher version; 13 a
    test failed. With 1 and 13, nothing is written.
    """
    findings = Findings(json=as_json)
    made_at = time.time_ns() // 1_000 if at is None else moment(at)
    if made_at is None:
        return findings.refuse(ExitCode.USAGE, "usage", f"`{at}` is not a UTC time", "accepted: 2026-01-31T08:00:00Z")
    request = ReportRequest(paths, since, _target(output, paths[0], as_json), made_at, title)
    report = check_report(request)
    if isinstance(report, Refusal):
        return findings.end(report)
    if findings.report((*report.diagnostics, *report.failures), report.sources):
        return findings.finish(report.code)
    book, target = report.book(), request.target
    if isinstance(book, Refusal):
        return findings.end(book)
    if since is not None and not any(chapter.since for chapter in book.chapters) and not as_json:
        say(f"{since} contains no earlier version of these policies")
    if as_json:
        return findings.finish(ExitCode.OK, handbook=asdict(book))
    from rtshcua.ground.report.html_page import page

    text = page(book)
    if target is None:
        out_rendered(text, end="")
        return ExitCode.OK
    replace_inside(target, text.encode("utf-8"))
    for chapter, name in zip(book.chapters, distinct_names(book.chapters), strict=True):
        out(f"{name}: version {chapter.version}, digest {chapter.digest}")
    out(f"{len(book.chapters)} {'policies' if len(book.chapters) > 1 else 'policy'}, written to {target}")
    return ExitCode.OK


def _target(output: Path | None, first: Path, as_json: bool) -> Path | None:
    """Return the file to write; None for standard output."""
    if output is not None:
        return None if str(output) == "-" else output
    if as_json or not sys.stdout.isatty():
        return None
    return Path(f"{first.resolve().name}.html") if first.is_dir() else first.with_suffix(".html")
