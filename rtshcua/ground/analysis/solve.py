"""Branch and bound over boxes (see the package's own words)."""

from collections.abc import Sequence
from typing import Final, NamedTuple, TypeAlias

from rtshcua.decision import tree
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN, Truth
from rtshcua.ground.analysis.box import Box
from rtshcua.ground.analysis.condition import Condition, over_boxes, undecided
from rtshcua.ground.analysis.narrow import narrow
from rtshcua.ground.analysis.space import Space
from rtshcua.ground.analysis.witness import Witness, halves, witness

#: boxes that are looked at before a question is given up
BUDGET: Final = 4_000

#: a condition and the truths that will do
Goal: TypeAlias = tuple[tree.Node, Truth]


class Yes(NamedTuple):
    """There is a situation: this one."""

    witness: Witness


class No(NamedTuple):
    """There is none."""


class Undecided(NamedTuple):
    """Nothing was found and nothing proved; `why` says what was too hard, for a person."""

    why: str


Answer: TypeAlias = Yes | No | Undecided


def satisfiable(goals: Sequence[Goal], space: Space, budget: int = BUDGET) -> Answer:
    """Whether a situation of the space gives each condition one of its truths."""
    return search(goals, space, budget)[0]


def search(goals: Sequence[Goal], space: Space, budget: int = BUDGET) -> tuple[Answer, int]:
    """The same, and how many boxes were looked at."""
    most = budget
    first = Box({}, {}, {}, {}, space.utc, space.phases, 0)
    conditions = [(over_boxes(node, space, first), wanted) for node, wanted in goals]
    doubt: str | None = None
    waiting = [first]
    while waiting:
        budget -= 1
        if budget < 0:
            return Undecided("there are too many cases to tell apart"), most
        box = waiting.pop()
        if not narrow(box, space.plane):
            continue
        verdict, open_ = _look(conditions, box)
        if not verdict:
            continue
        if open_ is None:
            found = witness(box, space)
            if found is not None and all(found.truth(node, space) & wanted for node, wanted in goals):
                return Yes(found), most - budget
            pieces = halves(box)
            if found is not None or not pieces:
                doubt = "no place was found that lies so between the zones"
            waiting += pieces
            continue
        waiting += reversed(undecided(open_, box).split(box))
    return (No() if doubt is None else Undecided(doubt)), most - budget


def _look(conditions: list[tuple[Condition, Truth]], box: Box) -> tuple[bool, Condition | None]:
    """Whether a box may hold what is looked for, and the first condition that it leaves open."""
    open_: Condition | None = None
    for condition, wanted in conditions:
        truth = condition.truth(box)
        if not truth & wanted:
            return False, None
        if open_ is None and truth & ~wanted:
            open_ = condition
    return True, open_


def implies(node: tree.Node, other: tree.Node, space: Space, budget: int = BUDGET) -> Answer:
    """`No` where `other` is true wherever `node` is; else a situation in which `node` is true and `other` not."""
    return satisfiable([(node, TRUE), (other, FALSE | UNKNOWN)], space, budget)
