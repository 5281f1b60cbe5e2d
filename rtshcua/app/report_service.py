"""The service `docs`: what skills and policies say, in words for a person who signs off on them, with tests decided."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from rtshcua import __version__
from rtshcua.app.check import EarlierPolicies, earlier_policies
from rtshcua.app.exit_codes import exit_code
from rtshcua.app.files import PAGES, overwriting_a_source, overwriting_another, source_files
from rtshcua.app.programs import RootProgram, examine, keep_once, programs, read_sources
from rtshcua.diagnostics.diagnostic import Diagnostic, has_errors
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.span import Source
from rtshcua.ground.language.paths import shown
from rtshcua.ground.pipeline.program import Checked, compile_program
from rtshcua.ground.pipeline.suite import suite
from rtshcua.ground.report.policy_report import CompiledMission, DecidedCases, ReportPart, policy_report
from rtshcua.ground.report.report_model import PolicyReport
from rtshcua.ground.testing.case_result import run_case
from rtshcua.ground.versions.raised import compare
from rtshcua.mavlink import dialect
from rtshcua.model.ir.scenarios import ScenarioDecl


class ReportRequest(NamedTuple):
    """Sources and folders of them, an earlier version to compare with, and of the page: where it goes (None: nowhere),
    its date and its title.
    """

    paths: Sequence[Path]
    since: Path | None
    target: Path | None
    made_at_us: int
    title: str | None = None


class CheckedReport(NamedTuple):
    """Programs checked and their tests decided, and how they differ from earlier policies."""

    request: ReportRequest
    programs: tuple[RootProgram, ...]
    checked: tuple[Checked, ...]
    trials: "_Trials"
    earlier: EarlierPolicies
    diagnostics: tuple[Diagnostic, ...]
    sources: dict[str, Source]

    @property
    def failures(self) -> list[Diagnostic]:
        """The tests that failed, each as a finding."""
        return [ran.finding for one in self.trials.tried.values() for each in one for ran in each.ran if ran.finding]

    @property
    def code(self) -> ExitCode:
        """How it ends where findings forbid going on."""
        return exit_code(self.diagnostics) if has_errors(self.diagnostics) else ExitCode.TESTS

    def book(self) -> PolicyReport | Refusal:
        """What the page says, of sources without errors whose tests pass."""
        pairs = zip(self.programs, self.checked, strict=True)
        parts = [_part(each, one, self.trials) for each, one in pairs]
        if not any(part.policies for part in parts):
            help = "a policy and a vehicle make what is signed; the sources may import both"
            return Refusal("no-policy", "the sources have no policy with a vehicle", help)
        return policy_report(
            parts,
            made_at_us=self.request.made_at_us,
            made_by=f"rtshcua {__version__}",
            title=self.request.title,
            earlier=self.earlier.policies,
            since=Path(self.earlier.name).resolve().name,
        )


def check_report(request: ReportRequest) -> CheckedReport | Refusal:
    """Check sources, decide their tests and compare their policies with earlier ones. Raises OSError."""
    files = source_files(request.paths)
    if isinstance(files, Refusal):
        return files
    target = request.target
    refused = _refusal(target, files)
    if refused is not None:
        return refused
    earlier = EarlierPolicies("", ()) if request.since is None else earlier_policies(request.since)
    if isinstance(earlier, Refusal):
        return earlier
    roots = programs(files)
    checked = tuple(examine(each.reading) for each in roots)
    sources: dict[str, Source] = {}
    for each in roots:
        sources |= each.reading.program.sources
    if target is not None:
        unfit = overwriting_a_source(target, sources, "a page") or overwriting_another(target, PAGES, "a page")
        if unfit is not None:
            return unfit
    trials = _trials(roots, files)
    versions = (
        compared.finding
        for each, one in zip(roots, checked, strict=True)
        for compared in compare(one.policies, earlier.policies, earlier.name, each.reading.program.sources)
        if compared.finding is not None
    )
    found: dict[tuple[object, ...], Diagnostic] = {}
    keep_once(found, (*(each for one in checked for each in one.diagnostics), *versions, *trials.diagnostics))
    every = tuple(found.values())
    return CheckedReport(request, roots, checked, trials, earlier, every, sources | trials.sources)


def _refusal(target: Path | None, files: Sequence[Path]) -> Refusal | None:
    """Why there is no page of these files, or none is written there."""
    if any(path.suffix.lower() == ".json" for path in files):
        help = "name the policy that it is under, or a source with the mission"
        return Refusal("usage", "a specification has no page of its own", help)
    if target is not None and target.exists() and not target.is_file():
        return Refusal("output", f"`{target}` is not a regular file, and is not overwritten by a page")
    if target is not None and not target.parent.is_dir():
        return Refusal("output", f"there is no folder `{target.parent}` to write to", code=ExitCode.INPUT)
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
                flown.append(
                    CompiledMission(
                        compiled.policy,
                        compiled.mission,
                        mission,
                        checked.bounds.get(name),
                        checked.pictures.get(name, ()),
                    )
                )
    return ReportPart(program, checked.policies, tuple(flown), checked.diagnostics, tuple(tried), tuple(scenarios))
