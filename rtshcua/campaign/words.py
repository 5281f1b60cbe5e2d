"""How people are told of the judge's margins and of kinds of faults: the one table of their names."""

from collections.abc import Mapping
from typing import Final, NamedTuple

from rtshcua.model.faults import KINDS


class MarginUnit(NamedTuple):
    """What a margin is, its unit for people, and how many of its own make one of these."""

    title: str
    unit: str
    parts: int


#: by the names of `rtshcua.virtual.judge.Margins`
MARGINS: Final[Mapping[str, MarginUnit]] = {
    "fence_mm": MarginUnit("distance inside the airspace, at its edge", "m", 1_000),
    "obstacle_mm": MarginUnit("distance to what stands around", "m", 1_000),
    "stop_us": MarginUnit("time from the cause of a fallback to its first frame", "s", 1_000_000),
    "takeover_us": MarginUnit("time from a takeover to the last frame that moves the vehicle", "s", 1_000_000),
    "ended_us": MarginUnit("time that the vehicle went on after the run had ended", "s", 1_000_000),
}

#: what sources and `--fault` call a kind of fault, by its own name; of two the longer one, which says more
FAULTS: Final[Mapping[str, str]] = {
    kind.__name__: word for word, kind in sorted(KINDS.items(), key=lambda each: len(each[0]))
}


def margin_told(name: str, value: int) -> str:
    """A margin with its unit, to three digits."""
    told = MARGINS[name]
    return f"{value / told.parts:.3g} {told.unit}"
