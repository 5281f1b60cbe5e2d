"""Flies the scenarios of files: every seed of each, on every kind of autopilot, in virtual time."""

import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing
from typing import Final, NamedTuple

from rtshcua.campaign.flights import Field
from rtshcua.campaign.trying import JUDGED, Trial, Tried, tries
from rtshcua.campaign.workers import Here, Processes, Workers, cores
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Span
from rtshcua.ground.testing.scenarios import ScenarioFlight
from rtshcua.virtual import development

#: fewer are flown in this process
_FEW: Final = 4
_CLEAR: Final = "\r\033[K"


class Flown(NamedTuple):
    """A scenario with all of its flights, and a finding (E1610) for each thing that went wrong in some of them."""

    scenario: ScenarioFlight
    flights: tuple[Tried, ...]
    findings: tuple[Diagnostic, ...]

    @property
    def failed(self) -> int:
        """In how many flights something went wrong."""
        return sum(bool(each.wrong) for each in self.flights)

    @property
    def endings(self) -> dict[str, int]:
        """How many flights ended in which way."""
        return dict(sorted(Counter(each.ending for each in self.flights).items()))


class Flying:
    """Flies scenarios, on as many processes as there are cores once it is worth it."""

    def __init__(self, *, with_coverage: bool, quiet: bool) -> None:
        self._with_coverage = with_coverage
        self._shows = not quiet and sys.stderr is not None and sys.stderr.isatty()
        self._workers: Workers | None = None

    def fly(self, scenarios: Sequence[ScenarioFlight]) -> Iterator[Flown]:
        """Fly all of them, in their order."""
        with closing(self):
            for scenario in scenarios:
                yield self._fly(scenario)

    def close(self) -> None:
        """Let the processes go."""
        if self._workers is not None:
            self._workers.close()
            self._workers = None

    def _fly(self, scenario: ScenarioFlight) -> Flown:
        policy, mission, start = scenario.policy.lowered.policy, scenario.mission, scenario.scenario.start
        if start.utc_us is not None:
            mission = development.flies_at(mission, start.utc_us)
        field = Field(development.seal(policy, mission), development.root(mission.issued_at_us))
        wanted = list(tries(scenario.scenario))
        workers: Workers = Here()
        if len(wanted) >= _FEW and cores() > 1:
            workers = self._workers = self._workers or Processes()
        flown: list[Tried] = []
        for each in workers.fly(Trial(field, self._with_coverage), wanted):
            flown.append(each)
            self._say(f"{scenario.scenario.name}: {len(flown)} of {len(wanted)} flights")
        self._say("")
        flights = tuple(sorted(flown, key=lambda each: each.number))
        return Flown(scenario, flights, tuple(_findings(scenario, flights)))

    def _say(self, text: str) -> None:
        if self._shows:
            sys.stderr.write(_CLEAR + text)
            sys.stderr.flush()


def _findings(scenario: ScenarioFlight, flights: Sequence[Tried]) -> Iterator[Diagnostic]:
    """One for each expectation that some flight did not meet, and one for each failure that the judge found."""
    found: dict[tuple[int, str], list[tuple[Tried, str]]] = {}
    for flight in flights:
        for expectation, slug, text in flight.wrong:
            found.setdefault((expectation, slug), []).append((flight, text))
    for (expectation, slug), failed in sorted(found.items(), key=lambda each: each[0]):
        (first, text), many = failed[0], len(failed)
        where = f"on {first.flavour} with seed {first.seed}"
        others = f", and in {many - 1} more of {len(flights)} flights" if many > 1 else ""
        what = text if expectation == JUDGED else f"{text}, which is not as expected"
        head = f"`{slug}`: " if expectation == JUDGED else ""
        yield Diagnostic(
            codes.FLIGHT_FAILED, f"{where}{others}: {head}{what}", _place(scenario, expectation), _help(first)
        )


def _place(scenario: ScenarioFlight, expectation: int) -> Span:
    if expectation == JUDGED:
        return scenario.declaration.name.span
    written = scenario.scenario.expectations[expectation]
    return Span(written.source, written.start, written.end)


def _help(flight: Tried) -> str:
    if not flight.happened:
        return f"nothing went wrong before it ended as `{flight.ending}`"
    return f"before it ended as `{flight.ending}`: " + ", ".join(flight.happened)
