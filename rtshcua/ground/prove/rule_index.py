"""An index of rules by the bounds of their conditions.

A policy may have thousands of rules, too many to compare each with each. The index holds the rules of one kind in a
tree by the bounds in which their conditions can hold, and finds those that may hold in given situations.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Final, NamedTuple

from rtshcua.decision import tree
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.values import ABSENT
from rtshcua.ground.analysis.box import Cell
from rtshcua.ground.analysis.extent import FAR, PHASE, Bounds, Conjunction, EnclosingBoxes, OtherCondition
from rtshcua.model.flat.policy import Rule

#: the number of cells by which rules are indexed, the most frequent ones; the conditions themselves decide on the
#: others
_CELLS = 6
#: if rules have more sets of other conditions than this, only equal sets are compared
_DIFFERENT = 64
#: the two sides of an axis that every query finds, and of a query that finds every rule
_ANY: Final = (FAR, FAR)
_NONE: Final = (-2 * FAR, -2 * FAR)


class IndexedRule(NamedTuple):
    """A rule by its number: bounds in which its condition can hold, its exact conjunctions, and its effect."""

    number: int
    rule: Rule
    parts: Sequence[Bounds]
    exact: Sequence[Conjunction]
    effect: int = 0


class RuleQuery(NamedTuple):
    """Criteria for rules: the skill, and all of some roles and sources, where an empty tuple means any.

    `effect` is the range of its effect; `within_us` is the longest time that it may wait for an approval.
    """

    skill: int
    roles: tuple[int, ...]
    sources: tuple[int, ...]
    effect: tuple[int, int] = (-FAR, FAR)
    within_us: int = FAR


class RuleBoundsIndex:
    """Rules indexed by the bounds in which their conditions can hold.

    `implies` compares two conditions that are not bounds: whether the second is true wherever the first is, and not
    false where the first is unknown.
    """

    def __init__(self, entries: Iterable[IndexedRule], implies: Callable[[tree.Node, tree.Node], bool]) -> None:
        every = list(entries)
        named = Counter(cell for entry in every for part in entry.parts for cell in part)
        self._cells: tuple[Cell, ...] = tuple(cell for cell, _ in named.most_common(_CELLS))
        self._exact = {entry.number: entry.exact for entry in every}
        self._implies = implies
        self._weaker: dict[frozenset[OtherCondition], tuple[frozenset[OtherCondition], ...]] = {}
        self._meeting = EnclosingBoxes([(each.number, self._row(each, part)) for each in every for part in each.parts])
        rows: dict[frozenset[OtherCondition], list[tuple[int, tuple[int, ...]]]] = {}
        for each in every:
            for part in each.exact:
                rows.setdefault(part.others, []).append((each.number, self._row(each, part.bounds)))
        self._holding = {others: EnclosingBoxes(found) for others, found in rows.items()}

    def remove(self, number: int) -> None:
        """Remove a rule."""
        self._meeting.remove(number)
        for others in dict.fromkeys(part.others for part in self._exact.get(number, ())):
            self._holding[others].remove(number)

    def meeting(self, about: RuleQuery, points: Sequence[Environment], *, sure: bool, after: int = -1) -> Iterator[int]:
        """Yield in order the rules whose conditions may be true (without `sure`: or unknown) in all given situations.

        No such rule is omitted, but others may be among them, so the caller must evaluate each.
        """
        sides = [side for cell in self._cells for side in _over(cell, points, sure=sure)]
        return _in_order(self._meeting, about, sides, after)

    def holding(self, about: RuleQuery, exact: Conjunction) -> Iterator[int]:
        """Yield rules whose condition is true wherever a conjunction is, and not false where it is unknown.

        Only rules for which the bounds show it are found. Those with the same other conditions come in order.
        """
        sides = [side for cell in self._cells for side in _sides(exact.bounds.get(cell))]
        weaker = self._weaker.get(exact.others)
        if weaker is None:
            weaker = self._weaker[exact.others] = tuple(self._found_weaker(exact.others))
        for others in weaker:
            for number in _in_order(self._holding[others], about, sides, -1):
                if any(self._encloses(part, exact) for part in self._exact[number] if part.others == others):
                    yield number

    def _found_weaker(self, others: frozenset[OtherCondition]) -> Iterator[frozenset[OtherCondition]]:
        """Yield the sets of conditions of rules, other than bounds, that hold wherever `others` do."""
        if len(self._holding) > _DIFFERENT:
            yield from (each for each in dict.fromkeys((others, frozenset[OtherCondition]())) if each in self._holding)
            return
        for each in sorted(self._holding, key=lambda each: each != others):  # equal sets first
            if all(one in others or any(self._implies(other.node, one.node) for other in others) for one in each):
                yield each

    def _encloses(self, wider: Conjunction, exact: Conjunction) -> bool:
        return all(
            cell in exact.bounds and low <= exact.bounds[cell][0] and exact.bounds[cell][1] <= high
            for cell, (low, high) in wider.bounds.items()
        )

    def _row(self, entry: IndexedRule, bounds: Bounds) -> tuple[int, ...]:
        rule = entry.rule
        return (
            *(side for cell in self._cells for side in _sides(bounds.get(cell))),
            *_hull(rule.skills),
            *_hull(rule.roles),
            *_hull(rule.sources),
            -entry.effect,
            entry.effect,
            -rule.within_us,
        )


def _in_order(tree: EnclosingBoxes, about: RuleQuery, sides: list[int], after: int) -> Iterator[int]:
    low, high = about.effect
    row = (*sides, -about.skill, about.skill, *_hull(about.roles), *_hull(about.sources))
    return tree.around((*row, -high, low, -about.within_us), after)


def _hull(members: tuple[int, ...]) -> tuple[int, int]:
    return (-min(members), max(members)) if members else _ANY


def _sides(bounds: tuple[int, int] | None) -> tuple[int, int]:
    return _ANY if bounds is None else (-bounds[0], bounds[1])


def _over(cell: Cell, points: Sequence[Environment], *, sure: bool) -> tuple[int, int]:
    """Return the two sides that bounds of a cell must enclose to hold in all situations."""
    low, high = FAR, -FAR
    argument, at = cell
    for point in points:
        if cell == PHASE:
            least = most = point.phase
        else:
            values = point.arguments if argument else point.slots
            if at >= len(values):
                continue  # an argument that the skill does not have
            least, most, gap, _ = values[at]
            if gap == ABSENT:
                if sure:
                    return _ANY
                continue
        low, high = min(low, least), max(high, most)
    return _NONE if low > high else (-low, high)
