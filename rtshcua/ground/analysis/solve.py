"""Branch and bound over boxes, as the package's docstring describes it, and a cache of questions about one policy."""

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

#: most boxes of a question before it stays undecided
BUDGET: Final = 4_000

#: a condition and its wanted truth values
Goal: TypeAlias = tuple[tree.Node, Truth]


class Yes(NamedTuple):
    """There is a situation, the witness."""

    witness: Witness


class No(NamedTuple):
    """It is proved that there is no situation."""


class Undecided(NamedTuple):
    """No situation was found, and its absence is not proved. `why` is the reason, as text for the user."""

    why: str


Answer: TypeAlias = Yes | No | Undecided


def satisfiable(goals: Sequence[Goal], space: SituationSpace, budget: int = BUDGET) -> Answer:
    """Decide whether a situation of the space gives each condition one of its wanted truth values."""
    return search(goals, space, budget)[0]


def search(goals: Sequence[Goal], space: SituationSpace, budget: int = BUDGET) -> tuple[Answer, int]:
    """As `satisfiable`, and also return the number of boxes."""
    most = budget
    first = ValueBox({}, {}, {}, {}, space.utc, space.phases, 0)
    conditions = [(over_boxes(node, space, first), wanted) for node, wanted in goals]
    doubt: str | None = None
    waiting = [first]
    while waiting:
        budget -= 1
        if budget < 0:
            return Undecided("there are too many cases"), most
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
                doubt = "no place with this relation to the zones was found"
            waiting += pieces
            continue
        waiting += reversed(undecided(open_, box).split(box))
    return (No() if doubt is None else Undecided(doubt)), most - budget


def _look(conditions: list[tuple[Condition, Truth]], box: ValueBox) -> tuple[bool, Condition | None]:
    """Return whether a box may contain a solution, and the first condition that it leaves undecided."""
    open_: Condition | None = None
    for condition, wanted in conditions:
        truth = condition.truth(box)
        if not truth & wanted:
            return False, None
        if open_ is None and truth & ~wanted:
            open_ = condition
    return True, open_


def implies(node: tree.Node, other: tree.Node, space: SituationSpace, budget: int = BUDGET) -> Answer:
    """Return `No` if `other` is true wherever `node` is, else a situation in which only `node` is true."""
    return satisfiable([(node, TRUE), (other, FALSE | UNKNOWN)], space, budget)


class StepInstance(NamedTuple):
    """A step of an instance of a mission; `requirements` are those of its path and contract on the time of issue."""

    skill: int
    arguments: tuple[int, ...]
    requirements: tuple[IssueRequirement, ...]


class Questions:
    """Questions about a prepared policy, with cached answers.

    `instances` are the steps of each mission, by its name, for each choice of its parameters so far.
    """

    def __init__(self, prepared: PreparedPolicy) -> None:
        self._prepared = prepared
        self._plane: Plane | None = None
        self._spaces: dict[int, SituationSpace] = {}
        self._answers: dict[Hashable, tuple[Answer, int]] = {}
        self.instances: dict[str, list[tuple[StepInstance, ...]]] = {}

    def space(self, skill: int) -> SituationSpace:
        """Return all situations in which a skill, given by its number, may be requested."""
        found = self._spaces.get(skill)
        if found is None:
            contract = self._prepared.policy.contracts[skill]
            found = self._spaces[skill] = space_of(self._prepared, contract, self._plane)
            self._plane = found.plane
        return found

    def ask(self, key: Hashable, goals: Callable[[], Sequence[Goal]], space: SituationSpace) -> Answer:
        """Answer a question. `key` must contain everything on which the answer depends."""
        found = self._answers.get(key)
        if found is None:
            wanted = goals()
            answer, boxes = search(wanted, space)
            found = self._answers[key] = answer, boxes * len(wanted)
        return found[0]

    def effort(self, key: Hashable) -> int:
        """Return the effort of an answered question, in boxes times conditions."""
        return self._answers[key][1]

    def again(self) -> "Questions":
        """Return a copy for another program with the same policy. It shares all answers, but no instances."""
        other = Questions(self._prepared)
        other._plane, other._spaces, other._answers = self._plane, self._spaces, self._answers
        return other

    def known(self, key: Hashable) -> Answer | None:
        """Return the answer to an earlier question, or None."""
        found = self._answers.get(key)
        return None if found is None else found[0]

    def forget(self) -> None:
        """Clear the cache."""
        self._plane = None
        self._spaces.clear()
        self._answers.clear()
        self.instances.clear()


def may_match(of: PreparedInvocation, number: int) -> bool:
    """Whether it is not proved that the condition of a rule is false for a step in every state and at every time."""
    prepared = of.policy
    rule = prepared.policy.rules[number]
    node = prepared.compiler.when(rule)
    if node is None:
        return True
    space = space_of(prepared, prepared.policy.contracts[of.invocation.skill])
    space = space._replace(arguments=of.arguments, phases=frozenset((of.phase,)))
    return not isinstance(satisfiable([(node, TRUE | UNKNOWN)], space), No)
