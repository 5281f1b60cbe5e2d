"""Which of a policy's rules may matter to one of them: found by the bounds of their conditions, not one by one.

A policy may have thousands of rules. To hold each against each other takes as many steps as pairs; here the rules of a
kind lie in a tree by what their conditions can hold in, and it is asked for those around some situations.
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

#: of the cells that conditions read, so many are told apart; the rest is asked of the conditions themselves
_CELLS = 6
#: where rules have more different conditions besides bounds, only the same ones are compared
_DIFFERENT = 64
#: both sides of an axis: any value, and one that everything has
_ANY: Final = (FAR, FAR)
_NONE: Final = (-2 * FAR, -2 * FAR)


class IndexedRule(NamedTuple):
    """A rule by its number: what its condition can hold in, exactly what it is, and of which effect it is."""

    number: int
    rule: Rule
    parts: Sequence[Bounds]
    exact: Sequence[Conjunction]
    effect: int = 0


class RuleQuery(NamedTuple):
    """Whom a rule that is looked for must be about: a skill, and all of some roles and sources; none is anyone.

    `effect` is that which it must have, the lowest and the highest; `within_us` the longest that it may wait.
    """

    skill: int
    roles: tuple[int, ...]
    sources: tuple[int, ...]
    effect: tuple[int, int] = (-FAR, FAR)
    within_us: int = FAR


class RuleBoundsIndex:
    """Some rules, by what their conditions can hold in. `implies` says of two conditions besides bounds whether one is
    true wherever the other is, and not false where that is unknown.
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
        """Forget a rule."""
        self._meeting.remove(number)
        for others in dict.fromkeys(part.others for part in self._exact.get(number, ())):
            self._holding[others].remove(number)

    def meeting(self, about: RuleQuery, points: Sequence[Environment], *, sure: bool, after: int = -1) -> Iterator[int]:
        """The rules, in order, whose conditions may be true in all of some situations; with `sure` unset, may be true
        or unknown. Each is to be asked itself: none is left out, and others may be among them.
        """
        sides = [side for cell in self._cells for side in _over(cell, points, sure=sure)]
        return _in_order(self._meeting, about, sides, after)

    def holding(self, about: RuleQuery, exact: Conjunction) -> Iterator[int]:
        """Rules whose condition is true wherever a conjunction is, and not false where that is unknown, as can be seen
        from both; those in order that have the same other conditions.
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
        """The conditions besides bounds, of rules, that hold wherever others do."""
        if len(self._holding) > _DIFFERENT:
            yield from (each for each in dict.fromkeys((others, frozenset[OtherCondition]())) if each in self._holding)
            return
        for each in sorted(self._holding, key=lambda each: each != others):  # the same ones first
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
    """What bounds of a cell must enclose to hold in all situations."""
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
