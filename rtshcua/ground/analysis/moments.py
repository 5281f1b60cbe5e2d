"""The moments of a box, and where they are cut."""

from collections.abc import Callable, Iterator
from typing import TypeAlias

from rtshcua.decision.values import Span
from rtshcua.ground.analysis.box import Box

#: the moments after one and up to another at which something about the time changes
Cuts: TypeAlias = Callable[[int, int], Iterator[int]]


def moments_split(box: Box, where: Cuts) -> list[Box]:
    """The box with the first half of its intervals and with the other; a single interval is cut.

    One that nothing cuts is halved: what a clock's error leaves open is decided by a moment.
    """
    if len(box.utc) > 1:
        half = len(box.utc) // 2
        return [_with(box, box.utc[:half]), _with(box, box.utc[half:])]
    low, high = box.utc[0]
    at = next(where(low, high), (low + high + 1) // 2)
    return [_with(box, ((low, at - 1),)), _with(box, ((at, high),))] if low < at else [box]


def _with(box: Box, utc: tuple[Span, ...]) -> Box:
    made = box.copy()
    made.utc = utc
    return made
