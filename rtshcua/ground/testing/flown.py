"""E1610: what flights of scenarios found, as findings, and for programs as JSON and as the suites of JUnit."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, Final, NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.render import render_one
from rtshcua.diagnostics.report.junit import Outcome, Suite
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.testing.coverage.coverage import Reached
from rtshcua.ground.testing.report import place_json
from rtshcua.ground.testing.scenarios import ScenarioFlight

#: of a failure that is no expectation's: its number among them
JUDGED: Final = -1


class Wrong(NamedTuple):
    """What is wrong with a flight: the number of an expectation, or `JUDGED` with the judge's slug; and in words."""

    expectation: int
    slug: str
    text: str


@dataclass(frozen=True, slots=True)
class Tried:
    """What came of a flight. `reached`: what it covers of its policy, each time that a step was decided on; `took_us`:
    how long it took to fly and judge, by the machine's clock; `notes`: why a run of it did not begin, in words.
    """

    number: int
    flavour: str
    seed: int
    ending: str
    wrong: tuple[Wrong, ...]
    excused: tuple[str, ...]
    happened: tuple[str, ...]
    reached: tuple[Reached, ...]
    took_us: int = 0
    notes: tuple[str, ...] = ()


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


def findings(scenario: ScenarioFlight, flights: Sequence[Tried]) -> Iterator[Diagnostic]:
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
    happened = ", ".join(flight.happened)
    before = f"before it ended as `{flight.ending}`"
    told = f"{before}: {happened}" if happened else f"nothing went wrong {before}"
    return "; ".join((told, *flight.notes))


def flown_json(flown: Sequence[Flown], sources: Mapping[str, Source]) -> list[dict[str, Any]]:
    """One object a scenario, in the order of the text, with one for each flight; every key is always there."""
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


def flown_suites(flown: Sequence[Flown], sources: Mapping[str, Source]) -> tuple[Suite, ...]:
    """A suite for each file, a test of it for each scenario."""
    files = groupby(flown, lambda each: each.scenario.declaration.span.file)
    return tuple(Suite(file, tuple(_outcome(each, sources) for each in group), ()) for file, group in files)


def _outcome(flown: Flown, sources: Mapping[str, Source]) -> Outcome:
    span = flown.scenario.declaration.name.span
    line = sources[span.file].position(span.start).line
    took_us = sum(flight.took_us for flight in flown.flights)
    if not flown.findings:
        return Outcome(flown.scenario.scenario.name, span.file, line, time_us=took_us)
    text = "\n".join(render_one(each, sources).rstrip("\n") for each in flown.findings)
    return Outcome(
        flown.scenario.scenario.name, span.file, line, failure=text, kind=flown.findings[0].code.id, time_us=took_us
    )
