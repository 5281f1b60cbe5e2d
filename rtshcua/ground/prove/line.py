"""The values that a mission's parameters may have between two of its instances.

Arguments are sums of parameters, so between two instances of a mission that differ in numbers alone, each step's
arguments lie on the straight line from the one's to the other's.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

from rtshcua.decision import tree
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.values import TRUE, Span, Value, interval
from rtshcua.ground.analysis.questions import Tried
from rtshcua.ground.analysis.solve import Goal
from rtshcua.model.flat.contract import QUANTITY, Contract
from rtshcua.model.quantity import Dimension, display

#: a line is cut at whole parts of it, so many
WHOLE: Final = 1 << 64


class Line(NamedTuple):
    """The arguments of a step in one instance and in another, and all in whole numbers between; both may be the same.

    Of a part of the line those that lie from `start` to `end` of it, in parts of `WHOLE`.
    """

    one: tuple[int, ...]
    other: tuple[int, ...]
    start: int = 0
    end: int = WHOLE

    @property
    def moving(self) -> list[int]:
        """The cells in which the two differ."""
        return [cell for cell, (a, b) in enumerate(zip(self.one, self.other, strict=True)) if a != b]

    @property
    def spans(self) -> list[Span]:
        """The least and the greatest whole number of each cell; where there is none the first is above the second."""
        found: list[Span] = []
        for one, other in zip(self.one, self.other, strict=True):
            ends = sorted(one * WHOLE + (other - one) * at for at in (self.start, self.end))
            found.append((-(-ends[0] // WHOLE), ends[1] // WHOLE))
        return found

    @property
    def values(self) -> tuple[Value, ...]:
        """What each cell may hold; only asked of a line that is not `empty`."""
        return tuple(interval(*span) for span in self.spans)

    @property
    def empty(self) -> bool:
        """Whether some cell has no whole number on it."""
        return any(low > high for low, high in self.spans)

    @property
    def single(self) -> bool:
        """Whether no cell has more than one whole number on it."""
        return all(low >= high for low, high in self.spans)

    def halves(self) -> tuple["Line", "Line"]:
        """The part up to the middle, and the part from there."""
        middle = (self.start + self.end) // 2
        return self._replace(end=middle), self._replace(start=middle)

    @property
    def given(self) -> tuple[Goal, ...]:
        """What holds of cells on the line: two points of it, and any third one, are on it together."""
        goals: list[Goal] = []
        for one, other in pairwise(self.moving):
            rise, run = self.other[other] - self.one[other], self.other[one] - self.one[one]
            terms = (tree.Term(True, one, rise), tree.Term(True, other, -run))
            goals.append((tree.Equal(terms, rise * self.one[one] - run * self.one[other]), TRUE))
        return tuple(goals)

    def least(self, cell: int) -> int:
        """The least that a cell holds."""
        return self.spans[cell][0]

    def words(self, contract: Contract) -> str:
        """The arguments that move, of a line of which one value is left; empty where nothing moves."""
        told = [
            f"`{each.name} = {display(self.spans[each.cell][0], Dimension(each.dimension))}`"
            for each in contract.parameters
            if each.cell in self.moving
        ]
        return " and ".join(told)


def still(invocations: Sequence[PreparedInvocation]) -> list[Line]:
    """The lines of a single instance."""
    return [Line(each.invocation.arguments, each.invocation.arguments) for each in invocations]


def lines(before: Sequence[Tried], invocations: Sequence[PreparedInvocation]) -> Iterator[Line | None]:
    """For each step the line from an earlier instance; None where the two differ in more than numbers."""
    for earlier, each in zip(before, invocations, strict=True):
        now = each.invocation
        line = Line(earlier.arguments, now.arguments) if earlier.skill == now.skill else None
        numbers = {parameter.cell for parameter in now.contract.parameters if parameter.kind == QUANTITY}
        yield line if line is not None and numbers.issuperset(line.moving) else None
