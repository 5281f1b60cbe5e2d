"""Runs the tests and flies the scenarios of files: each file is a program of its own with what it imports."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from time import perf_counter_ns
from typing import Final, NamedTuple

from rtshcua.adapters.store.project import Projects
from rtshcua.app.exit_codes import exit_code
from rtshcua.app.files import SPECIFICATION, source_files
from rtshcua.app.programs import Reading, examine, keep_once, read_sources
from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.diagnostic import Diagnostic, has_errors
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.span import Source
from rtshcua.diagnostics.suggest import nearest
from rtshcua.ground.language.paths import shown
from rtshcua.ground.pipeline.suite import scenarios as scenarios_of
from rtshcua.ground.pipeline.suite import suite
from rtshcua.ground.testing.case import CaseSuite, PolicyCase, PolicyUnderTest
from rtshcua.ground.testing.case_result import CaseResult, run_case
from rtshcua.ground.testing.clause_coverage import CoverageTally, PolicyCoverage, enough
from rtshcua.ground.testing.reporting import ScenarioResult
from rtshcua.ground.testing.scenario_lowering import ScenarioFlight
from rtshcua.mavlink import dialect
from rtshcua.virtual.flight import LATER_US

#: when missions of scenarios are issued, unless they say it: a Monday in June, 10:00 UTC
ISSUED_AT_US: Final = 1_780_308_000_000_000


#: passes files on one by one, and may show meanwhile which one is in hand
Progress = Callable[["Sequence[FileProgram]"], "Iterator[FileProgram]"]


class TestResults(NamedTuple):
    """What was run and flown, in the order of the files and their text; what is wrong with sources, each finding once;
    the texts; the coverage, where it was asked for; and how many cases and scenarios there are that were not chosen,
    of all there are the names.
    """

    ran: tuple[CaseResult, ...]
    flown: tuple[ScenarioResult, ...]
    diagnostics: tuple[Diagnostic, ...]
    sources: dict[str, Source]
    covered: tuple[PolicyCoverage, ...] | None
    left_out: int
    names: frozenset[str]

    @property
    def failures(self) -> tuple[Diagnostic, ...]:
        """What failed, each as a finding."""
        failed = tuple(each.finding for each in self.ran if each.finding is not None)
        return failed + tuple(finding for each in self.flown for finding in each.findings)

    def falls_short(self, least: int | None) -> bool:
        """Whether less is covered than is asked."""
        covered = self.covered
        return covered is not None and least is not None and not enough([one.coverage for one in covered], least)

    def code(self, least: int | None) -> ExitCode:
        """How it ends: sources with errors, or a test that failed, none at all, or less covered than is asked."""
        if has_errors(self.diagnostics):
            return exit_code(self.diagnostics)
        failed = self.failures or not (self.ran or self.flown) or self.falls_short(least)
        return ExitCode.TESTS if failed else ExitCode.OK


class FileProgram(NamedTuple):
    """A file, by its name, and its program."""

    name: str
    reading: Reading


def select_files(paths: Sequence[Path], projects: Projects, *, keep: bool) -> tuple[Path, ...] | Refusal:
    """The sources that are meant, but for those that a configuration leaves out; `keep` says to keep these too."""
    lost = next((path for path in paths if not path.exists() and path.suffix == ""), None)
    if lost is not None:
        return Refusal("input", f"no such file or directory: `{lost}`", _meant(lost))
    files = source_files(paths)
    if isinstance(files, Refusal):
        return files
    left: list[Path] = []
    for path in files:
        if path.suffix.lower() == SPECIFICATION:
            return Refusal("usage", f"`{path}` is a mission specification, and has no tests")
        project = projects.of(path)
        if isinstance(project, Refusal):
            where, _, what = project.text.partition(": ")
            return project._replace(text=f"`{where}`: {what}")
        if keep or path in paths or not project.excludes(path, project.settings.test.exclude):
            left.append(path)
    return tuple(left)


def least_share(paths: Sequence[Path], projects: Projects) -> int | None:
    """The greatest of the thresholds that the configurations of what was asked for set."""
    found = [projects.of(path) for path in paths]
    set_ = [one.settings.test.fail_under for one in found if not isinstance(one, Refusal)]
    return max((each for each in set_ if each is not None), default=None)


def _meant(lost: Path) -> str:
    """A source below this folder that is called almost so, or how cases are chosen by their names."""
    if str(lost) == "-":
        return "a source must be a file, because imports are found beside it"
    by_name = f"`-k {lost}` chooses tests by name"
    below = source_files([Path()])
    near = None if isinstance(below, Refusal) else nearest(lost.name, {each.stem for each in below})
    if near is None or isinstance(below, Refusal):
        return by_name
    return f"did you mean `{next(each for each in below if each.stem == near)}`? {by_name}"


def run_all(
    files: Sequence[Path], chosen: str, *, with_coverage: bool, progress: Progress, say: Callable[[str], None]
) -> TestResults:
    """Run the cases and fly the scenarios whose name has `chosen` in it, in whatever case; empty: all. `progress`
    passes the files on one by one, and `say` gets how far the flights are; both may show it.
    """
    work = [FileProgram(shown(str(path)), read_sources([path])) for path in files]
    found: dict[tuple[object, ...], Diagnostic] = {}
    sources: dict[str, Source] = {}
    ran: list[CaseResult] = []
    tally = CoverageTally() if with_coverage else None
    left_out = 0
    names: set[str] = set()
    scenarios: list[ScenarioFlight] = []
    tested: set[tuple[str, int]] = set()  # where policies are declared that some test is under
    for each in progress(work):
        made = _suite(each.reading)
        sources |= {**each.reading.program.sources, **made.sources}
        keep_once(found, made.diagnostics)
        cases = [case for case in made.cases if chosen.casefold() in case.name.casefold()]
        left_out += len(made.cases) - len(cases)
        names |= {case.name for case in made.cases}
        tested |= {_declared(one) for one in made.policies}
        _count_policies(tally, made.policies, each.reading)
        ran += [_run(case, tally) for case in cases]
        of_file = _scenarios(each.reading, found, sources)
        named = [one for one in of_file if chosen.casefold() in one.scenario.name.casefold()]
        left_out += len(of_file) - len(named)
        names |= {one.scenario.name for one in of_file}
        tested |= {_declared(one.policy) for one in of_file}
        _count_policies(tally, [one.policy for one in of_file], each.reading)
        scenarios += named
    flown = tuple(_fly(scenarios, tally, say)) if scenarios else ()
    if tally is not None:
        for each in work:
            policies, wrong = _untested(each, tested)
            _count_policies(tally, policies, each.reading)
            keep_once(found, wrong)
        sources |= tally.sources
    covered = None if tally is None else tally.all()
    return TestResults(tuple(ran), flown, tuple(found.values()), sources, covered, left_out, frozenset(names))


def _suite(reading: Reading) -> CaseSuite:
    """The cases of a program's first file. One that declares no tests is not looked at any closer: that is for `check`;
    but tests in what cannot be read would not be seen.
    """
    program = reading.program
    if not program.units or not program.units[0].tests:
        return CaseSuite((), program.diagnostics if has_errors(program.diagnostics) else (), sources=program.sources)
    return suite(program, dialect.load())


def _scenarios(
    reading: Reading, found: dict[tuple[object, ...], Diagnostic], sources: dict[str, Source]
) -> tuple[ScenarioFlight, ...]:
    """The scenarios of a program's first file; what is wrong with the program is added to `found`."""
    program = reading.program
    if not program.units or not program.units[0].scenarios:
        return ()
    made = scenarios_of(program, dialect.load(), ISSUED_AT_US, LATER_US)
    sources |= {**program.sources, **made.sources}
    keep_once(found, made.diagnostics)
    return made.found


def _fly(
    scenarios: Sequence[ScenarioFlight], tally: CoverageTally | None, say: Callable[[str], None]
) -> Iterator[ScenarioResult]:
    from rtshcua.app.testing.flying import Flying  # the simulated vehicle is behind it

    for flown in Flying(with_coverage=tally is not None, say=say).fly(scenarios):
        if tally is not None:
            tally.flights(flown.scenario.policy, [one for flight in flown.flights for one in flight.reached])
        yield flown


def _run(case: PolicyCase, tally: CoverageTally | None) -> CaseResult:
    began_ns = perf_counter_ns()
    ran = run_case(case)
    ran = ran._replace(took_us=(perf_counter_ns() - began_ns) // 1_000)
    if tally is not None:
        tally.case(ran)
    return ran


def _count_policies(tally: CoverageTally | None, policies: Iterable[PolicyUnderTest], reading: Reading) -> None:
    if tally is not None:
        for policy in policies:
            tally.policy(policy, reading.program.units, reading.program.sources)


def _untested(work: FileProgram, tested: set[tuple[str, int]]) -> tuple[list[PolicyUnderTest], list[Diagnostic]]:
    """The policies that a file declares and no test is under, of which nothing is covered; and the errors for which
    there are none.
    """
    units = work.reading.program.units
    declared = units[0].policies if units and units[0].file == work.name else ()
    if all((policy.name.span.file, policy.name.span.start) in tested for policy in declared):
        return [], []
    checked = examine(work.reading)
    each = [PolicyUnderTest(ground.lowered, ground.prepared) for ground in checked.grounds]
    wrong = [found for found in checked.diagnostics if found.severity is Severity.ERROR]
    return [one for one in each if _declared(one)[0] == work.name and _declared(one) not in tested], wrong


def _declared(tested: PolicyUnderTest) -> tuple[str, int]:
    span = tested.lowered.declaration.name.span
    return span.file, span.start
