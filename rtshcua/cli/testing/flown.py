"""What flights of scenarios found, for programs: as JSON, and as the suites of JUnit."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

from rtshcua.diagnostics.render import render_one
from rtshcua.diagnostics.report.junit import Outcome, Suite
from rtshcua.diagnostics.span import Source
from rtshcua.ground.testing.report import place_json

if TYPE_CHECKING:
    from rtshcua.cli.testing.flying import Flown


def flown_json(flown: Sequence["Flown"], sources: Mapping[str, Source]) -> list[dict[str, Any]]:
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


def flown_suites(flown: Sequence["Flown"], sources: Mapping[str, Source]) -> tuple[Suite, ...]:
    """A suite for each file, a test of it for each scenario."""
    files = groupby(flown, lambda each: each.scenario.declaration.span.file)
    return tuple(Suite(file, tuple(_outcome(each, sources) for each in group), ()) for file, group in files)


def _outcome(flown: "Flown", sources: Mapping[str, Source]) -> Outcome:
    span = flown.scenario.declaration.name.span
    line = sources[span.file].position(span.start).line
    if not flown.findings:
        return Outcome(flown.scenario.scenario.name, span.file, line)
    text = "\n".join(render_one(each, sources).rstrip("\n") for each in flown.findings)
    return Outcome(flown.scenario.scenario.name, span.file, line, failure=text, kind=flown.findings[0].code.id)
