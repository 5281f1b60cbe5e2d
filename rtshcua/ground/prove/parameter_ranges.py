"""E0703, E0704, E0718, E0719: no step is refused for a value between those with which the mission is checked.

Arguments are sums of parameters, so between two instances of a mission that differ in numbers alone, each step's
arguments lie on the straight line from the one's to the other's.

With a value that is refused whatever the time, the step is out of scope, or forbidden. Of one that is refused at times
only, the same is asked as of every instance (`issue_times`). What the ways of the two instances ask of the time of
issue, either of them, is asked of all values between.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final, NamedTuple, TypeAlias

from rtshcua.decision import tree
from rtshcua.decision.values import TRUE, Span, Value, interval
from rtshcua.diagnostics import codes
from rtshcua.ground.analysis.solve import Goal, StepInstance
from rtshcua.ground.analysis.space import SituationSpace
from rtshcua.ground.analysis.witness import witness_text
from rtshcua.ground.prove.certain_refusal import TimeKnowledge, certain_refusals
from rtshcua.ground.prove.proof_context import ProofContext
from rtshcua.ground.prove.step_times import MissionStep
from rtshcua.model.flat.contract import QUANTITY, Contract
from rtshcua.model.ir.missions import MissionDecl
from rtshcua.model.quantity import Dimension, display

#: a line is cut at whole parts of it, so many
_WHOLE: Final = 1 << 64


class ArgumentLine(NamedTuple):
    """The arguments of a step in one instance and in another, and all in whole numbers between; both may be the same.

    Of a part of the line those that lie from `start` to `end` of it, in parts of `_WHOLE`.
    """

    one: tuple[int, ...]
    other: tuple[int, ...]
    start: int = 0
    end: int = _WHOLE

    @property
    def moving(self) -> list[int]:
        """The cells in which the two differ."""
        return [cell for cell, (a, b) in enumerate(zip(self.one, self.other, strict=True)) if a != b]

    @property
    def spans(self) -> list[Span]:
        """The least and the greatest whole number of each cell; where there is none the first is above the second."""
        found: list[Span] = []
        for one, other in zip(self.one, self.other, strict=True):
            ends = sorted(one * _WHOLE + (other - one) * at for at in (self.start, self.end))
            found.append((-(-ends[0] // _WHOLE), ends[1] // _WHOLE))
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

    def halves(self) -> tuple["ArgumentLine", "ArgumentLine"]:
        """The part up to the middle, and the part from there."""
        middle = (self.start + self.end) // 2
        return self._replace(end=middle), self._replace(start=middle)

    @property
    def given(self) -> tuple[Goal, ...]:
        """What holds of cells on the line: two points of it, and any third one, are on it together."""
        goals: list[Goal] = []
        for one, other in pairwise(self.moving):
            rise, run = self.other[other] - self.one[other], self.other[one] - self.one[one]
            terms = (tree.LinearTerm(True, one, rise), tree.LinearTerm(True, other, -run))
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


def unmoved_lines(steps: Sequence[MissionStep]) -> list[ArgumentLine]:
    """The lines of a single instance."""
    return [ArgumentLine(each.flat.arguments, each.flat.arguments) for each in steps]


def space_along(proof: ProofContext, step: MissionStep, line: ArgumentLine) -> SituationSpace:
    """Any situation in which a step may be asked for with the arguments on a line."""
    space = proof.questions.space(step.flat.skill)
    return space._replace(arguments=line.values, phases=frozenset((step.prepared.phase,)))


def lines_from(before: Sequence[StepInstance], steps: Sequence[MissionStep]) -> Iterator[ArgumentLine | None]:
    """For each step the line from an earlier instance; None where the two differ in more than numbers."""
    for earlier, step in zip(before, steps, strict=True):
        now = step.flat
        line = ArgumentLine(earlier.arguments, now.arguments) if earlier.skill == now.skill else None
        numbers = {parameter.cell for parameter in now.contract.parameters if parameter.kind == QUANTITY}
        yield line if line is not None and numbers.issuperset(line.moving) else None


#: to how many earlier instances of a mission one is compared
_COMPARED: Final = 8

#: the proof about the time: whether the steps may come at a time at which they are refused, which it then reports
Timely: TypeAlias = Callable[[ProofContext, Sequence[MissionStep], Sequence[ArgumentLine | None]], bool]


def prove_between(proof: ProofContext, mission: MissionDecl, steps: Sequence[MissionStep], timely: Timely) -> None:
    """Report the first value between this instance and an earlier one with which a step is refused."""
    now = tuple(StepInstance(step.flat.skill, step.flat.arguments, tuple(step.time.asked)) for step in steps)
    earlier = proof.questions.instances.setdefault(mission.name.text, [])
    for before in earlier[:_COMPARED]:
        if len(before) != len(now):
            continue
        between = list(lines_from(before, steps))
        for step, line in zip(steps, between, strict=True):
            if line is not None and line.moving and _report_refused(proof, step, line):
                return
        if any(line is not None and line.moving for line in between):
            both = [
                step._replace(time=replace(step.time, asked=[*step.time.asked, *other.asked]))
                for step, other in zip(steps, before, strict=True)
            ]
            if timely(proof, both, between):
                return
    earlier.append(now)


def _report_refused(proof: ProofContext, step: MissionStep, line: ArgumentLine) -> bool:
    space = space_along(proof, step, line)
    for witness, rule in certain_refusals(proof, step.prepared, space, TimeKnowledge.NOTHING, line.given):
        policy = proof.policy
        situation = witness_text(witness, policy, step.flat.contract)
        rules = [each.rule for each in step.prepared.candidates.permits] if rule is None else [rule]
        label = "this does not permit it" if rule is None else "by this rule"
        code, said = codes.OUT_OF_SCOPE, f"outside of what `{policy.name}` permits"
        if rule is not None and rule.target is None:
            code, said = codes.FORBIDDEN, f"forbidden by `{policy.name}`"
        elif rule is not None:
            code, said = codes.DEGRADED, f"not flown: `{policy.name}` flies another skill in its place"
        proof.report.add(
            code,
            step.span,
            f"with {situation}, which the mission's parameters allow, this step is {said}",
            help="narrow the range of the mission's parameter",
            labels=[(proof.span(each), label) for each in rules],
        )
        return True
    return False
