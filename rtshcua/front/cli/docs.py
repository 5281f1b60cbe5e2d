"""`rtshcua docs`: skills and policies as one page that a person can read and sign off on."""

import sys
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from rtshcua import __version__
from rtshcua.adapters.store.writing import replace_inside
from rtshcua.app.check import EarlierPolicies, earlier_policies
from rtshcua.app.exit_codes import exit_code
from rtshcua.app.files import overwriting_a_source, source_files
from rtshcua.app.programs import RootProgram, examine, programs, read_sources
from rtshcua.app.wording import moment
from rtshcua.diagnostics.diagnostic import Diagnostic, has_errors
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.span import Source
from rtshcua.front.cli.faults import say
from rtshcua.front.cli.findings import Findings
from rtshcua.front.cli.stdout import out, out_rendered
from rtshcua.ground.language.paths import shown
from rtshcua.ground.pipeline.program import Checked, compile_program
from rtshcua.ground.pipeline.suite import suite
from rtshcua.ground.report.policy_report import CompiledMission, DecidedCases, ReportPart, distinct_names, policy_report
from rtshcua.ground.testing.case_result import run_case
from rtshcua.ground.versions.raised import compare
from rtshcua.mavlink import dialect
from rtshcua.model.ir.scenarios import ScenarioDecl

app = typer.Typer(add_completion=False)


@app.command()
def docs(
    paths: Annotated[list[Path], typer.Argument(help="sources (.rts), or folders of them")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="the page [default: SOURCE.html, or standard output if piped]")
    ] = None,
    title: Annotated[str | None, typer.Option(help="what the page is called [default: its policies' names]")] = None,
    at: Annotated[
        str | None, typer.Option(help="the date of the page, such as 2026-01-31T08:00:00Z [default: now]")
    ] = None,
    since: Annotated[
        Path | None, typer.Option(help="an earlier bundle, source or folder: mark what a policy says otherwise")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="what the page says, as one JSON object, and no page")
    ] = False,
) -> ExitCode:
    """Render skills and policies as one HTML page that a non-programmer can sign off on.

    It has everything in plain words: who may do what, the rules one by one, maps of the zones, what the vehicle does
    when something goes wrong, and the digest of what is signed. It needs no network and no script, and prints on A4.
    With the same sources and the same --at it has the same bytes.

    The tests of the sources are decided while the page is made, and it says what came out of each.

    Ends with 1, and writes nothing, where the sources have errors, or --since shows that a policy differs and its
    version is not higher; with 13, and writes nothing, where a test fails.
    """
    findings = Findings(json=as_json)
    made_at = time.time_ns() // 1_000 if at is None else moment(at)
    if made_at is None:
        return findings.refuse(ExitCode.USAGE, "usage", f"`{at}` is not a UTC time", "accepted: 2026-01-31T08:00:00Z")
    files = source_files(paths)
    if isinstance(files, Refusal):
        return findings.end(files)
    target = _target(output, paths[0], as_json)
    refused = _refusal(target, files)
    if refused is not None:
        return findings.end(refused)
    if target is not None and not target.parent.is_dir():
        return findings.refuse(ExitCode.INPUT, "output", f"there is no folder `{target.parent}` to write to")
    earlier = EarlierPolicies("", ()) if since is None else earlier_policies(since)
    if isinstance(earlier, Refusal):
        return findings.end(earlier)
    asked = programs(files)
    checked = [examine(each.reading) for each in asked]
    sources: dict[str, Source] = {}
    for each in asked:
        sources |= each.reading.program.sources
    imported = None if target is None else overwriting_a_source(target, sources, "a page")
    if imported is not None:
        return findings.end(imported)
    trials = _trials(asked, files)
    found: dict[tuple[object, ...], Diagnostic] = {}
    versions = (
        compared.finding
        for each, one in zip(asked, checked, strict=True)
        for compared in compare(one.policies, earlier.policies, earlier.name, each.reading.program.sources)
        if compared.finding is not None
    )
    for finding in (*(each for one in checked for each in one.diagnostics), *versions, *trials.diagnostics):
        found.setdefault((finding.code, finding.span, finding.message), finding)
    failed = [ran.finding for one in trials.tried.values() for each in one for ran in each.ran if ran.finding]
    if findings.report((*found.values(), *failed), sources | trials.sources):
        wrong = tuple(found.values())
        return findings.finish(exit_code(wrong) if has_errors(wrong) else ExitCode.TESTS)
    parts = [_part(each, one, trials) for each, one in zip(asked, checked, strict=True)]
    if not any(part.policies for part in parts):
        help = "a policy and a vehicle make what is signed; the sources may import both"
        return findings.refuse(ExitCode.INPUT, "no-policy", "the sources have no policy with a vehicle", help)
    made_by = f"rtshcua {__version__}"
    book = policy_report(
        parts,
        made_at_us=made_at,
        made_by=made_by,
        title=title,
        earlier=earlier.policies,
        since=Path(earlier.name).resolve().name,
    )
    if since is not None and not any(chapter.since for chapter in book.chapters) and not as_json:
        say(f"nothing in {since} is an earlier version of a policy here")
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
    """Where the page goes; None for the standard output."""
    if output is not None:
        return None if str(output) == "-" else output
    if as_json or not sys.stdout.isatty():
        return None
    return Path(f"{first.resolve().name}.html") if first.is_dir() else first.with_suffix(".html")


def _refusal(target: Path | None, files: Sequence[Path]) -> Refusal | None:
    """Why there is no page of these files, or none is written there."""
    if any(path.suffix.lower() == ".json" for path in files):
        help = "name the policy that it is under, or a source with the mission"
        return Refusal("usage", "a specification has no page of its own", help)
    if target is not None and target.exists() and not target.is_file():
        return Refusal("output", f"`{target}` is no regular file, and is not replaced by a page")
    return None if target is None else overwriting_a_source(target, files, "a page")


class _Trials(NamedTuple):
    """The cases of the files that were asked for, decided, and their scenarios, by the program that each file is part
    of; what is wrong with the cases, and the texts that this is about.
    """

    tried: dict[str, list[DecidedCases]]
    scenarios: dict[str, list[ScenarioDecl]]
    diagnostics: list[Diagnostic]
    sources: dict[str, Source]


def _trials(asked: Sequence[RootProgram], files: Sequence[Path]) -> _Trials:
    """Each file's own tests in its own program, as `rtshcua test` runs them; those of what it imports are not asked."""
    paths = {shown(str(path)): path for path in files}
    trials = _Trials({}, {}, [], {})
    for each in asked:
        own = trials.tried[each.name] = []
        scenarios = trials.scenarios[each.name] = []
        for unit in each.reading.program.units:
            path = paths.pop(unit.file, None)
            if path is None:
                continue
            scenarios += unit.scenarios
            if not unit.tests:
                continue
            program = each.reading.program if unit.file == each.name else read_sources([path]).program
            cases = suite(program, dialect.load())
            trials.diagnostics.extend(cases.diagnostics)
            trials.sources.update(cases.sources)
            own.append(DecidedCases(program, tuple(run_case(case) for case in cases.cases)))
    return trials


def _part(asked: RootProgram, checked: Checked, trials: _Trials) -> ReportPart:
    """A program with those of its missions that need no further values."""
    program = asked.reading.program
    tried, scenarios = trials.tried[asked.name], trials.scenarios[asked.name]
    flown = []
    for unit in program.units:
        for mission in unit.missions:
            if any(parameter.default is None for parameter in mission.parameters):
                continue
            name = mission.name.text
            compiled = compile_program(program, dialect.load(), mission=name, issued_at_us=0)
            if compiled.policy is not None and compiled.mission is not None:
                flown.append(CompiledMission(compiled.policy, compiled.mission, mission, checked.bounds.get(name)))
    return ReportPart(program, checked.policies, tuple(flown), checked.diagnostics, tuple(tried), tuple(scenarios))
