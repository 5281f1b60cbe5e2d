"""What is asked of the time of day at which something begins that is not known yet."""

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

from rtshcua.diagnostics.span import Span as Where
from rtshcua.model.flat.limits import DAY


class Arc(NamedTuple):
    """Moments of the day, in us of UTC: from `start` on, `length` of them."""

    start: int
    length: int


class Asked(NamedTuple):
    """One of these arcs must hold all from `low` to `high` us after the issue; where that is written."""

    arcs: tuple[Arc, ...]
    low: int
    high: int
    labels: tuple[tuple[Where, str], ...]

    def met(self, issue: int) -> bool:
        """Whether that is so for a time of issue."""
        return any(
            arc.length >= DAY or (issue + self.low - arc.start) % DAY + self.high - self.low < arc.length
            for arc in self.arcs
        )


def met_by_some(asked: Sequence[Asked]) -> bool:
    """Whether some time of issue meets all; each is met from some moments on, so by one of these, or none."""
    issues = {0, *((arc.start - one.low) % DAY for one in asked for arc in one.arcs)}
    return any(all(one.met(issue) for one in asked) for issue in issues)


def arcs_where(edges: Iterable[int], holds: Callable[[int], bool]) -> tuple[Arc, ...]:
    """When in a day something holds that changes at some moments of it only."""
    ordered = sorted({edge % DAY for edge in edges})
    if not ordered:
        return (Arc(0, DAY),) if holds(0) else ()
    arcs: list[Arc] = []
    for start, end in pairwise((*ordered, ordered[0] + DAY)):
        if not holds(start):
            continue
        if arcs and arcs[-1].start + arcs[-1].length == start:
            arcs[-1] = Arc(arcs[-1].start, arcs[-1].length + end - start)
        else:
            arcs.append(Arc(start, end - start))
    if len(arcs) > 1 and arcs[-1].start + arcs[-1].length == arcs[0].start + DAY:
        arcs[0] = Arc(arcs[-1].start, arcs[-1].length + arcs[0].length)
        del arcs[-1]
    return tuple(arcs)
