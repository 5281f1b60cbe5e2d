"""The test suite of a program: its cases, prepared like real requests, and its scenarios with their missions."""

from collections.abc import Mapping

from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source
from rtshcua.ground.language.load import Program
from rtshcua.ground.pipeline.program import Compilation
from rtshcua.ground.testing.case import CaseSuite
from rtshcua.ground.testing.scenario_lowering import ScenarioFlight, ScenarioSuite
from rtshcua.mavlink.dialect import Dialect
from rtshcua.model.ir.scenarios import Begins, ScenarioDecl


def suite(program: Program, dialect: Dialect) -> CaseSuite:
    """Return the cases of the first file of a program, with the findings on declarations and tests.

    Policies and missions are not proved: `check_program` does that.
    """
    run = Compilation(program, dialect, 0)
    run.check()
    cases = run.cases()
    found = run.diagnostics()
    if run.report.failed():
        return CaseSuite((), found, (), run.report.sources)
    policies = tuple(dict.fromkeys(case.policy for case in cases))
    return CaseSuite(cases, found, policies, run.report.sources)


def scenarios(program: Program, dialect: Dialect, issued_at_us: int, later_us: int = 0) -> ScenarioSuite:
    """Return the scenarios of the first file of a program, with all findings, including those of the proofs.

    The missions are issued at a UTC time in us. If a scenario sets its begin, its mission is issued `later_us` before
    that. Missions without a scenario are proved for any time, as in `check_program`.
    """
    found: dict[Diagnostic, None] = {}
    flights: list[ScenarioFlight] = []
    sources: Mapping[str, Source] = program.sources
    starts = _starts(program, issued_at_us, later_us)
    for number in range(max(map(len, starts.values()), default=1)):
        issues = {name: times[min(number, len(times) - 1)] for name, times in starts.items()}
        run = Compilation(program, dialect, 0, issues=issues)
        run.check()
        run.lowered(None)
        made = run.scenarios()
        found |= dict.fromkeys(run.diagnostics())
        sources = run.report.sources
        if run.report.failed():
            return ScenarioSuite((), tuple(found), sources)
        flights += [
            each
            for each in made
            if number < len(starts[each.mission.name])
            and _issued(each.declaration, issued_at_us, later_us) == starts[each.mission.name][number]
        ]
    flights.sort(key=lambda each: each.declaration.span)
    return ScenarioSuite(tuple(flights), tuple(found), sources)


def _starts(program: Program, issued_at_us: int, later_us: int) -> dict[str, list[int]]:
    """The distinct times of issue of the missions with scenarios, by the name of the mission."""
    starts: dict[str, list[int]] = {}
    for scenario in program.units[0].scenarios if program.units else ():
        times = starts.setdefault(scenario.mission.text, [])
        issued = _issued(scenario, issued_at_us, later_us)
        if issued not in times:
            times.append(issued)
    return starts


def _issued(scenario: ScenarioDecl, issued_at_us: int, later_us: int) -> int:
    return next((each.utc_us - later_us for each in scenario.start if isinstance(each, Begins)), issued_at_us)
