"""Whether what a scenario expects has come of a flight of it."""

from typing import NamedTuple

from rtshcua.model.scenario import Expectation
from rtshcua.virtual.flown import ScenarioFlown
from rtshcua.virtual.judge import Judgement


class Met(NamedTuple):
    """Whether an expectation was met, and what was found."""

    expectation: Expectation
    met: bool
    found: str


def expectations(flown: ScenarioFlown, judgement: Judgement) -> tuple[Met, ...]:
    """One for each expectation of the scenario, in their order."""
    return ()
