"""What many decisions reached of a policy, and how much that is. Counts are integers, and so is the share."""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from rtshcua.ground.testing.coverage.universe import Goal, Item, Universe
from rtshcua.model.flat.policy import Policy

#: goals that some decision reached, of the items by their numbers
Reached = frozenset[tuple[int, Goal]]


class Line(NamedTuple):
    """An item with how often each of its goals was reached."""

    item: Item
    counts: tuple[int, ...]

    @property
    def missing(self) -> tuple[Goal, ...]:
        """The goals that nothing reached."""
        return tuple(goal for goal, count in zip(self.item.goals, self.counts, strict=True) if not count)


class Coverage(NamedTuple):
    """Everything that there is to cover of a policy, and how many decisions were looked at."""

    policy: Policy
    lines: tuple[Line, ...]
    decisions: int

    @property
    def total(self) -> int:
        """How many goals there are."""
        return sum(len(line.counts) for line in self.lines)

    @property
    def covered(self) -> int:
        """How many of them were reached."""
        return sum(1 for line in self.lines for count in line.counts if count)

    @property
    def undecided(self) -> tuple[Item, ...]:
        """The clauses that could decide and never did: whatever they say, no test would notice if it changed."""
        return tuple(line.item for line in self.lines if Goal.DECIDED in line.missing)


def coverage(of: Universe, reached: Iterable[Reached]) -> Coverage:
    """Decisions under one policy, added up."""
    counts: Counter[tuple[int, Goal]] = Counter()
    decisions = 0
    for each in reached:
        decisions += 1
        counts.update(each)
    lines = tuple(
        Line(item, tuple(counts[number, goal] for goal in item.goals)) for number, item in enumerate(of.items)
    )
    return Coverage(of.prepared.policy, lines, decisions)


def per_mille(covered: int, total: int) -> int:
    """A share in 1/1000, rounded down, so that 1000 means all; where there is nothing to cover, all is covered."""
    return covered * 1000 // total if total else 1000


def enough(coverages: Sequence[Coverage], percent: int) -> bool:
    """Whether all together cover a share; computed without rounding."""
    covered, total = sum(each.covered for each in coverages), sum(each.total for each in coverages)
    return covered * 100 >= percent * total


def share(covered: int, total: int) -> str:
    """A share for a person: `93.4 %`, rounded down."""
    whole, tenth = divmod(per_mille(covered, total), 10)
    return f"{whole}.{tenth} %"
