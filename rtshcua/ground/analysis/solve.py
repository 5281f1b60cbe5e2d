"""Branch and bound over boxes, as the package's docstring describes it; questions about one policy, with the answers
remembered; and whether a `confirm` rule can match a step at all.
"""

from collections.abc import Callable, Hashable, Sequence
from typing import Final, NamedTuple, TypeAlias

from rtshcua.decision import tree
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy
from rtshcua.decision.values import FALSE, TRUE, UNKNOWN, Truth
from rtshcua.ground.analysis.box import ValueBox, narrow
from rtshcua.ground.analysis.conditions import Condition, over_boxes, undecided
from rtshcua.ground.analysis.daytime import IssueRequirement
from rtshcua.ground.analysis.plane import Plane
from rtshcua.ground.analysis.space import SituationSpace, space_of
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


def satisfiable(goals: Sequence[Goal], space: SituationSpace, budget: int = BUDGET) -> Answer:
    """Whether a situation of the space gives each condition one of its truths."""
    return search(goals, space, budget)[0]


def search(goals: Sequence[Goal], space: SituationSpace, budget: int = BUDGET) -> tuple[Answer, int]:
    """The same, and how many boxes were looked at."""
    most = budget
    first = ValueBox({}, {}, {}, {}, space.utc, space.phases, 0)
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


def _look(conditions: list[tuple[Condition, Truth]], box: ValueBox) -> tuple[bool, Condition | None]:
    """Whether a box may hold what is looked for, and the first condition that it leaves open."""
    open_: Condition | None = None
    for condition, wanted in conditions:
        truth = condition.truth(box)
        if not truth & wanted:
            return False, None
        if open_ is None and truth & ~wanted:
            open_ = condition
    return True, open_


def implies(node: tree.Node, other: tree.Node, space: SituationSpace, budget: int = BUDGET) -> Answer:
    """`No` where `other` is true wherever `node` is; else a situation in which `node` is true and `other` not."""
    return satisfiable([(node, TRUE), (other, FALSE | UNKNOWN)], space, budget)


class StepInstance(NamedTuple):
    """A step of an instance of a mission; `requirements` are those of its path and contract on the time of issue."""

    skill: int
    arguments: tuple[int, ...]
    requirements: tuple[IssueRequirement, ...]


class Questions:
    """Questions about a prepared policy. `instances` are, of each mission by name, its steps for each choice of its
    parameters so far.
    """

    def __init__(self, prepared: PreparedPolicy) -> None:
        self._prepared = prepared
        self._plane: Plane | None = None
        self._spaces: dict[int, SituationSpace] = {}
        self._answers: dict[Hashable, tuple[Answer, int]] = {}
        self.instances: dict[str, list[tuple[StepInstance, ...]]] = {}

    def space(self, skill: int) -> SituationSpace:
        """Any situation in which a skill, by its number, may be asked for."""
        found = self._spaces.get(skill)
        if found is None:
            contract = self._prepared.policy.contracts[skill]
            found = self._spaces[skill] = space_of(self._prepared, contract, self._plane)
            self._plane = found.plane
        return found

    def ask(self, key: Hashable, goals: Callable[[], Sequence[Goal]], space: SituationSpace) -> Answer:
        """The answer to a question; `key` says all that it depends on."""
        found = self._answers.get(key)
        if found is None:
            asked = goals()
            answer, boxes = search(asked, space)
            found = self._answers[key] = answer, boxes * len(asked)
        return found[0]

    def effort(self, key: Hashable) -> int:
        """What a question took that was asked, whoever asked it first: boxes times conditions."""
        return self._answers[key][1]

    def again(self) -> "Questions":
        """For another program with the same policy: it shares all answers, and has no instances yet."""
        other = Questions(self._prepared)
        other._plane, other._spaces, other._answers = self._plane, self._spaces, self._answers
        return other

    def known(self, key: Hashable) -> Answer | None:
        """The answer to a question, if it was asked."""
        found = self._answers.get(key)
        return None if found is None else found[0]

    def forget(self) -> None:
        """As before the first question."""
        self._plane = None
        self._spaces.clear()
        self._answers.clear()
        self.instances.clear()


def may_match(of: PreparedInvocation, number: int) -> bool:
    """Whether the condition of this rule can be true or unknown for the step, whatever the vehicle reports and
    whenever it flies. One that was not decided may.
    """
    prepared = of.policy
    rule = prepared.policy.rules[number]
    node = prepared.compiler.when(rule)
    if node is None:
        return True
    space = space_of(prepared, prepared.policy.contracts[of.invocation.skill])
    space = space._replace(arguments=of.arguments, phases=frozenset((of.phase,)))
    return not isinstance(satisfiable([(node, TRUE | UNKNOWN)], space), No)
