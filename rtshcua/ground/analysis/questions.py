"""What is asked about one policy: answers are remembered, how its zones lie, and what its missions were given."""

from collections.abc import Callable, Hashable, Sequence
from typing import NamedTuple

from rtshcua.decision.prepare import PreparedPolicy
from rtshcua.ground.analysis.daytime import Asked
from rtshcua.ground.analysis.plane import Plane
from rtshcua.ground.analysis.solve import Answer, Goal, search
from rtshcua.ground.analysis.space import Space, space_of


class Tried(NamedTuple):
    """A step of an instance of a mission; `asked` is what its way and its contract ask of the time of issue."""

    skill: int
    arguments: tuple[int, ...]
    asked: tuple[Asked, ...]


class Questions:
    """Questions about a prepared policy. `instances` are, of each mission by name, its steps for each choice of its
    parameters so far.
    """

    def __init__(self, prepared: PreparedPolicy) -> None:
        self._prepared = prepared
        self._plane: Plane | None = None
        self._spaces: dict[int, Space] = {}
        self._answers: dict[Hashable, tuple[Answer, int]] = {}
        self.instances: dict[str, list[tuple[Tried, ...]]] = {}

    def space(self, skill: int) -> Space:
        """Any situation in which a skill, by its number, may be asked for."""
        found = self._spaces.get(skill)
        if found is None:
            contract = self._prepared.policy.contracts[skill]
            found = self._spaces[skill] = space_of(self._prepared, contract, self._plane)
            self._plane = found.plane
        return found

    def ask(self, key: Hashable, goals: Callable[[], Sequence[Goal]], space: Space) -> Answer:
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
