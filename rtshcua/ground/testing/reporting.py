"""The results of tests and scenarios, as JSON, as JUnit suites and, for scenarios, as findings."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, Final, NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.render import render_one
from rtshcua.diagnostics.report.junit import CaseOutcome, Suite
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.testing.case_result import CaseResult
from rtshcua.ground.testing.clause_coverage import PolicyCoverage, ReachedGoals, per_mille
from rtshcua.ground.testing.coverage_goals import CoverageItem
from rtshcua.ground.testing.scenario_lowering import ScenarioFlight
from rtshcua.model.flat.policy import Policy


def tests_json(ran: Iterable[CaseResult], sources: Mapping[str, Source]) -> list[dict[str, Any]]:
    """The JSON of cases, in source order. Every key is always present."""
    return [_case_json(each, sources) for each in ran]


def summary_json(ran: Sequence[CaseResult]) -> dict[str, int]:
    """The numbers of tests and cases, and of those that passed and failed."""
    passed = sum(each.met for each in ran)
    tests = len({(each.case.test.span.file, each.case.test.span.start) for each in ran})
    return {"tests": tests, "cases": len(ran), "passed": passed, "failed": len(ran) - passed}


def coverage_json(covered: Sequence[PolicyCoverage], sources: Mapping[str, Source]) -> dict[str, Any]:
    """The JSON of the total coverage and of each policy's, by clause."""
    reached, total = sum(one.coverage.covered for one in covered), sum(one.coverage.total for one in covered)
    return _share_json(reached, total) | {"policies": [_policy_json(one, sources) for one in covered]}


def case_suites(
    ran: Iterable[CaseResult], sources: Mapping[str, Source], covered: Sequence[PolicyCoverage] | None
) -> tuple[Suite, ...]:
    """The JUnit suites, one for each file with a test for each case. The first has the coverage as properties."""
    files = [(file, tuple(group)) for file, group in groupby(ran, lambda each: each.case.span.file)]
    properties = () if covered is None else tuple(_properties(covered))
    return tuple(
        Suite(file, tuple(_outcome(each, sources) for each in group), () if number else properties)
        for number, (file, group) in enumerate(files)
    )


def policy_name(policy: Policy) -> str:
    """The name of a policy with its version, as in missions."""
    return f"{policy.name}@{policy.version}"


def clause_words(item: CoverageItem) -> str:
    """The text of a clause with its skill and list; the text alone for a rule or an airspace."""
    return f"{item.skill} {item.role}: {item.text}" if item.skill else item.text


def place_json(span: Span | None, sources: Mapping[str, Source]) -> dict[str, Any] | None:
    """The JSON of a span; None if there is none."""
    if span is None:
        return None
    at = sources[span.file].position(span.start)
    return {"file": span.file, "start": span.start, "end": span.end, "line": at.line, "column": at.column}


def _case_json(ran: CaseResult, sources: Mapping[str, Source]) -> dict[str, Any]:
    case, decision, expected = ran.case, ran.trace.decision, ran.expected
    policy, clause = case.policy.lowered.policy, decision.clause
    return {
        "name": case.name,
        "test": case.test.name.text,
        "row": case.row,
        "at": place_json(case.span, sources),
        "policy": policy_name(policy),
        "skill": case.invocation.invocation.contract.name,
        "met": ran.met,
        "expected": {
            "outcome": expected.outcome,
            "target": None if expected.target is None else expected.target.text,
            "reason": None if expected.reason is None else expected.reason.text,
            "clause": None if expected.clause is None else expected.clause.text,
        },
        "decided": {
            "outcome": decision.outcome.name.lower(),
            "target": None if decision.target is None else policy.contracts[decision.target.skill].name,
            "reason": decision.reason.value,
            "clause": None if clause is None else " ".join(clause.text.split()),
            "written": None if clause is None else place_json(case.policy.span(clause), sources),
        },
    }


def _outcome(ran: CaseResult, sources: Mapping[str, Source]) -> CaseOutcome:
    span, finding = ran.case.span, ran.finding
    line = sources[span.file].position(span.start).line
    if finding is None:
        return CaseOutcome(ran.case.name, span.file, line, time_us=ran.took_us)
    text = render_one(finding, sources).rstrip("\n")
    return CaseOutcome(ran.case.name, span.file, line, failure=text, kind=finding.code.id, time_us=ran.took_us)


def _properties(covered: Sequence[PolicyCoverage]) -> Iterable[tuple[str, str]]:
    for one in covered:
        found = one.coverage
        yield f"coverage {policy_name(found.policy)}", f"{found.covered}/{found.total}"
        for item in found.undecided:
            yield f"never decided {policy_name(found.policy)}", clause_words(item)


def _share_json(reached: int, total: int) -> dict[str, Any]:
    return {"covered": reached, "total": total, "per_mille": per_mille(reached, total)}


def _policy_json(one: PolicyCoverage, sources: Mapping[str, Source]) -> dict[str, Any]:
    found = one.coverage
    clauses = [
        {
            "role": line.item.role,
            "skill": line.item.skill or None,
            "text": line.item.text,
            "at": place_json(span, sources),
            "reached": {goal.value: count for goal, count in zip(line.item.goals, line.counts, strict=True)},
            "missing": [goal.value for goal in line.missing],
            "impossible": [goal.value for goal in line.item.impossible],
        }
        for line, span in zip(found.lines, one.spans, strict=True)
    ]
    head = {"policy": found.policy.name, "version": found.policy.version, "vehicle": found.policy.vehicle.name}
    return head | {"decisions": found.decisions} | _share_json(found.covered, found.total) | {"clauses": clauses}


#: the number of a failure that the judge found
JUDGED: Final = -1


class FlightFailure(NamedTuple):
    """A failure of a flight: the number of an expectation, or `JUDGED` with the judge's slug; and a text."""

    expectation: int
    slug: str
    text: str


@dataclass(frozen=True, slots=True)
class FlightResult:
    """The result of a flight. `reached` are the coverage goals of each decision on a step; `took_us` is the real time
    of the flight and the judge; `notes` say why a run did not begin.
    """

    number: int
    flavour: str
    seed: int
    ending: str
    wrong: tuple[FlightFailure, ...]
    excused: tuple[str, ...]
    happened: tuple[str, ...]
    reached: tuple[ReachedGoals, ...]
    took_us: int = 0
    notes: tuple[str, ...] = ()


class ScenarioResult(NamedTuple):
    """A scenario with all of its flights, and a finding for each kind of failure."""

    scenario: ScenarioFlight
    flights: tuple[FlightResult, ...]
    findings: tuple[Diagnostic, ...]

    @property
    def failed(self) -> int:
        """The number of flights with a failure."""
        return sum(bool(each.wrong) for each in self.flights)

    @property
    def endings(self) -> dict[str, int]:
        """The number of flights by ending."""
        return dict(sorted(Counter(each.ending for each in self.flights).items()))


def findings(scenario: ScenarioFlight, flights: Sequence[FlightResult]) -> Iterator[Diagnostic]:
    """Yield a finding for each expectation that a flight did not meet, and for each failure that the judge found."""
    found: dict[tuple[int, str], list[tuple[FlightResult, str]]] = {}
    for flight in flights:
        for expectation, slug, text in flight.wrong:
            found.setdefault((expectation, slug), []).append((flight, text))
    for (expectation, slug), failed in sorted(found.items(), key=lambda each: each[0]):
        (first, text), many = failed[0], len(failed)
        where = f"on {first.flavour} with seed {first.seed}"
        others = f", and in {many - 1} more of {len(flights)} flights" if many > 1 else ""
        what = text if expectation == JUDGED else f"{text}, which was not expected"
        head = f"`{slug}`: " if expectation == JUDGED else ""
        yield Diagnostic(
            codes.FLIGHT_FAILED,
            f"{where}{others}: {head}{what}",
            _expectation_span(scenario, expectation),
            _flight_help(first),
        )


def _expectation_span(scenario: ScenarioFlight, expectation: int) -> Span:
    if expectation == JUDGED:
        return scenario.declaration.name.span
    written = scenario.scenario.expectations[expectation]
    return Span(written.source, written.start, written.end)


def _flight_help(flight: FlightResult) -> str:
    happened = ", ".join(flight.happened)
    before = f"before it ended as `{flight.ending}`"
    history = f"{before}: {happened}" if happened else f"no fault occurred {before}"
    return "; ".join((history, *flight.notes))


def scenarios_json(flown: Sequence[ScenarioResult], sources: Mapping[str, Source]) -> list[dict[str, Any]]:
    """The JSON of scenarios, in source order, each with its flights. Every key is always present."""
    return [
        {
            "name": each.scenario.scenario.name,
            "at": place_json(each.scenario.declaration.name.span, sources),
            "mission": each.scenario.mission.name,
            "met": not each.failed,
            "endings": each.endings,
            "flights": [
                {
                    "flavour": flight.flavour,
                    "seed": flight.seed,
                    "ending": flight.ending,
                    "wrong": [{"slug": wrong.slug, "text": wrong.text} for wrong in flight.wrong],
                    "excused": list(flight.excused),
                    "happened": list(flight.happened),
                }
                for flight in each.flights
            ],
        }
        for each in flown
    ]


def scenario_suites(flown: Sequence[ScenarioResult], sources: Mapping[str, Source]) -> tuple[Suite, ...]:
    """The JUnit suites, one for each file with a test for each scenario."""
    files = groupby(flown, lambda each: each.scenario.declaration.span.file)
    return tuple(Suite(file, tuple(_scenario_outcome(each, sources) for each in group), ()) for file, group in files)


def _scenario_outcome(flown: ScenarioResult, sources: Mapping[str, Source]) -> CaseOutcome:
    span = flown.scenario.declaration.name.span
    line = sources[span.file].position(span.start).line
    took_us = sum(flight.took_us for flight in flown.flights)
    if not flown.findings:
        return CaseOutcome(flown.scenario.scenario.name, span.file, line, time_us=took_us)
    text = "\n".join(render_one(each, sources).rstrip("\n") for each in flown.findings)
    return CaseOutcome(
        flown.scenario.scenario.name, span.file, line, failure=text, kind=flown.findings[0].code.id, time_us=took_us
    )
