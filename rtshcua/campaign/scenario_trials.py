"""Fly the flights of a scenario: judge each, check its expectations, and count its coverage."""

from collections.abc import Iterator
from dataclasses import dataclass
from time import perf_counter_ns

from rtshcua.campaign.rounds import DIED, LOST, FlownMission
from rtshcua.decision.prepare import prepare, prepare_mission
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import DecisionRecord
from rtshcua.ground.testing.clause_coverage import ReachedGoals, reached_goals
from rtshcua.ground.testing.coverage_goals import universe_of
from rtshcua.ground.testing.reporting import JUDGED, FlightFailure, FlightResult
from rtshcua.ground.why.logged_decisions import context_of, now_of, state_of
from rtshcua.ground.why.trace import trace
from rtshcua.model.scenario import Scenario
from rtshcua.virtual.expectations import expectations
from rtshcua.virtual.flight_record import ScenarioFlown
from rtshcua.virtual.judge import judge
from rtshcua.wire.request import STEP


@dataclass(frozen=True, slots=True)
class Try:
    """A flight of a scenario: the autopilot and the seed."""

    number: int
    scenario: Scenario
    flavour: str
    seed: int


@dataclass(frozen=True, slots=True)
class ScenarioTrial:
    """Flies scenarios of one mission."""

    field: FlownMission
    with_coverage: bool = False

    def fly(self, flight: Try) -> FlightResult:
        """Fly and judge one flight."""
        began_ns = perf_counter_ns()
        was = self.field.flown(flight.scenario, flight.flavour, flight.seed)
        verdict = judge(was)
        wrong = [FlightFailure(JUDGED, each.slug, each.text) for each in verdict.failures]
        wrong += [
            FlightFailure(number, "expectation", each.found)
            for number, each in enumerate(expectations(was, verdict))
            if not each.met
        ]
        return FlightResult(
            flight.number,
            flight.flavour,
            flight.seed,
            was.ending or "none",
            tuple(wrong),
            tuple(f"{each.slug}: {each.cause}" for each in verdict.exceptions),
            tuple(f"{each.at_us / 1_000_000:.2f} s: {each.text}" for each in was.happened),
            tuple(_reached(was)) if self.with_coverage else (),
            (perf_counter_ns() - began_ns) // 1_000,
            was.notes,
        )

    def lost(self, flight: Try) -> FlightResult:
        """Return the result of a flight whose worker process died repeatedly."""
        wrong = (FlightFailure(JUDGED, LOST, DIED),)
        return FlightResult(flight.number, flight.flavour, flight.seed, "none", wrong, (), (), ())


def tries(scenario: Scenario) -> Iterator[Try]:
    """Yield all flights of a scenario: each seed on each autopilot."""
    number = 0
    for seed in range(scenario.first_seed, scenario.last_seed + 1):
        for flavour in scenario.flavours:
            yield Try(number, scenario, flavour, seed)
            number += 1


def _reached(was: ScenarioFlown) -> Iterator[ReachedGoals]:
    """Yield the coverage goals of each decision on a step, as `rtshcua why` explains it from its record.

    A decision that differs from the compiled step's belongs to a replacement and covers nothing.
    """
    policy = prepare(was.policy)
    if isinstance(policy, Refusal):  # cannot happen: the policy was flown
        return
    invocations = prepare_mission(was.mission, policy)
    if isinstance(invocations, Refusal):
        return
    goals = universe_of(policy)
    for life in was.lives:
        for line in life.lines:
            record = read(line)
            if isinstance(record, Flaw) or not isinstance(record, DecisionRecord) or record.kind != STEP:
                continue
            if record.step < len(invocations):
                invocation = invocations[record.step]
                found = trace(invocation, state_of(record), policy, context_of(record), now_of(record))
                if (found.decision.outcome.name.lower(), found.decision.reason) == (record.outcome, record.reason):
                    yield reached_goals(goals, invocation, found)
