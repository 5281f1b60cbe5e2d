"""Requirements on the time of day or week at which a mission is issued, while that time is unknown."""

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import NamedTuple

from rtshcua.diagnostics.span import Span as Where


class Arc(NamedTuple):
    """An interval of the day or of the week in us of UTC, from `start` on, `length` us long."""

    start: int
    length: int


class IssueRequirement(NamedTuple):
    """One of the arcs of a `period` must contain the time from `low` to `high` us after the issue."""

    arcs: tuple[Arc, ...]
    low: int
    high: int
    period: int
    labels: tuple[tuple[Where, str], ...]

    def met(self, issue: int) -> bool:
        """Whether a time of issue meets the requirement."""
        return any(
            arc.length >= self.period
            or (issue + self.low - arc.start) % self.period + self.high - self.low < arc.length
            for arc in self.arcs
        )


def met_by_some(requirements: Sequence[IssueRequirement]) -> bool:
    """Whether some time of issue meets all requirements.

    If one does, so does the begin of an arc: only these times are tried.
    """
    whole = max((one.period for one in requirements), default=1)
    issues = {0} | {
        issue % whole
        for one in requirements
        for arc in one.arcs
        for issue in range(arc.start - one.low, arc.start - one.low + whole, one.period)
    }
    return any(all(one.met(issue) for one in requirements) for issue in issues)


def arcs_where(edges: Iterable[int], holds: Callable[[int], bool], period: int) -> tuple[Arc, ...]:
    """Return the arcs of a day or week on which a condition holds that changes only at the `edges`."""
    ordered = sorted({edge % period for edge in edges})
    if not ordered:
        return (Arc(0, period),) if holds(0) else ()
    arcs: list[Arc] = []
    for start, end in pairwise((*ordered, ordered[0] + period)):
        if not holds(start):
            continue
        if arcs and arcs[-1].start + arcs[-1].length == start:
            arcs[-1] = Arc(arcs[-1].start, arcs[-1].length + end - start)
        else:
            arcs.append(Arc(start, end - start))
    if len(arcs) > 1 and arcs[-1].start + arcs[-1].length == arcs[0].start + period:
        arcs[0] = Arc(arcs[-1].start, arcs[-1].length + arcs[0].length)
        del arcs[-1]
    return tuple(arcs)
