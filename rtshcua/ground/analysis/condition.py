"""Conditions over boxes: their truths by Kleene's connectives, and an atom that a box leaves undecided."""

from typing import TypeAlias

from rtshcua.decision import tree
from rtshcua.decision.values import AND, FALSE, NOT, OR, TRUE, Truth
from rtshcua.ground.analysis.atoms import MOST, Atom, Chosen, Linear, Local, Monitor, Phase
from rtshcua.ground.analysis.box import Box
from rtshcua.ground.analysis.places import PointIn, There, VehicleIn, VehicleInArgument
from rtshcua.ground.analysis.space import Space


class Negation:
    """Kleene's `not`."""

    __slots__ = ("operand",)

    def __init__(self, operand: "Condition") -> None:
        self.operand = operand

    def truth(self, box: Box) -> Truth:
        """All truths that it may have in the box."""
        return NOT[self.operand.truth(box)]

    def undecided(self, box: Box) -> Atom:
        """An atom that is to blame where it has more than one truth."""
        return undecided(self.operand, box)


class Pair:
    """Kleene's `and` or `or`."""

    __slots__ = ("_decisive", "_table", "left", "right")

    def __init__(self, left: "Condition", right: "Condition", *, both: bool) -> None:
        self.left, self.right = left, right
        self._table, self._decisive = (AND, FALSE) if both else (OR, TRUE)

    def truth(self, box: Box) -> Truth:
        """All truths that it may have in the box."""
        left = self.left.truth(box)
        return left if left == self._decisive else self._table[left][self.right.truth(box)]

    def undecided(self, box: Box) -> Atom:
        """An atom that is to blame where it has more than one truth."""
        left = self.left.truth(box)
        return undecided(self.left if left & (left - 1) else self.right, box)


Condition: TypeAlias = Negation | Pair | Atom


def undecided(condition: Condition, box: Box) -> Atom:
    """An atom to split by, for a condition that has more than one truth in the box."""
    return condition if isinstance(condition, Atom) else condition.undecided(box)


def over_boxes(node: tree.Node, space: Space, box: Box) -> Condition:
    """A condition for boxes; what it reads is entered into the first one."""
    match node:
        case tree.Both(left, right):
            return Pair(over_boxes(left, space, box), over_boxes(right, space, box), both=True)
        case tree.Either(left, right):
            return Pair(over_boxes(left, space, box), over_boxes(right, space, box), both=False)
        case tree.Negation(operand):
            return Negation(over_boxes(operand, space, box))
        case _:
            atom = _atom(node, space)
            atom.enter(box, space)
            return atom


def _atom(node: tree.Node, space: Space) -> Atom:
    match node:
        case tree.AtMost(terms, bound):
            return Linear(terms, -MOST, bound)
        case tree.Equal(terms, value):
            return Linear(terms, value, value)
        case tree.Member(argument, index, members):
            return Chosen((argument, index), space.tables.sets[members])
        case tree.SlotKnown(slot):
            return There(slot, space)
        case tree.InsideZone(zone):
            return VehicleIn(zone, space)
        case tree.InsideArgument(cell, table):
            return VehicleInArgument(cell, space.tables.tables[table], space)
        case tree.PointInside(cell, zone):
            return PointIn(cell, zone, space)
        case tree.PhaseIn(members):
            return Phase(space.tables.sets[members])
        case tree.MonitorSays(monitor):
            return Monitor(monitor)
        case tree.InWindow() | tree.InWeek():
            return Local(node, space)
        case _:  # a connective, which is no atom
            raise AssertionError(node)
