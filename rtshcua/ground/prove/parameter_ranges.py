"""Prove that no step is refused for a parameter value between the proved instances of a mission.

Arguments are sums of parameters. So between two instances that differ only in numbers, the arguments of each step lie
on a straight line.

A value that is refused at all times is out of scope (E0703), forbidden (E0704) or replaced (E0719). For a value that is
refused at some times, the times of issue are proved as for an instance (E0718, `issue_times`). The requirements that
the paths of the two instances have of the time of issue apply to all values between.
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

#: positions on a line are integers from 0 to this
_WHOLE: Final = 1 << 64


class ArgumentLine(NamedTuple):
    """The arguments of a step in two instances, which may be equal, and all integer arguments between them.

    A part of the line contains only those from position `start` to `end`, in parts of `_WHOLE`.
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
        """The least and the greatest integer of each cell. If there is none, the first is above the second."""
        found: list[Span] = []
        for one, other in zip(self.one, self.other, strict=True):
            ends = sorted(one * _WHOLE + (other - one) * at for at in (self.start, self.end))
            found.append((-(-ends[0] // _WHOLE), ends[1] // _WHOLE))
        return found

    @property
    def values(self) -> tuple[Value, ...]:
        """The possible values of each cell. The line must not be `empty`."""
        return tuple(interval(*span) for span in self.spans)

    @property
    def empty(self) -> bool:
        """Whether some cell has no integer on the line."""
        return any(low > high for low, high in self.spans)

    @property
    def single(self) -> bool:
        """Whether no cell has more than one integer on the line."""
        return all(low >= high for low, high in self.spans)

    def halves(self) -> tuple["ArgumentLine", "ArgumentLine"]:
        """Split the line at its middle."""
        middle = (self.start + self.end) // 2
        return self._replace(end=middle), self._replace(start=middle)

    @property
    def given(self) -> tuple[Goal, ...]:
        """Conditions that hold on the line: each pair of cells lies on a straight line."""
        goals: list[Goal] = []
        for one, other in pairwise(self.moving):
            rise, run = self.other[other] - self.one[other], self.other[one] - self.one[one]
            terms = (tree.LinearTerm(True, one, rise), tree.LinearTerm(True, other, -run))
            goals.append((tree.Equal(terms, rise * self.one[one] - run * self.one[other]), TRUE))
        return tuple(goals)

    def least(self, cell: int) -> int:
        """Return the least value of a cell."""
        return self.spans[cell][0]

    def text(self, contract: Contract) -> str:
        """Format the arguments that differ, of a line with a single value; empty if none differs."""
        values = [
            f"`{each.name} = {display(self.spans[each.cell][0], Dimension(each.dimension))}`"
            for each in contract.parameters
            if each.cell in self.moving
        ]
        return " and ".join(values)


def unmoved_lines(steps: Sequence[MissionStep]) -> list[ArgumentLine]:
    """Return the lines of a single instance."""
    return [ArgumentLine(each.flat.arguments, each.flat.arguments) for each in steps]


def space_along(proof: ProofContext, step: MissionStep, line: ArgumentLine) -> SituationSpace:
    """Return all situations in which a step may be requested with the arguments on a line."""
    space = proof.questions.space(step.flat.skill)
    return space._replace(arguments=line.values, phases=frozenset((step.prepared.phase,)))


def lines_from(before: Sequence[StepInstance], steps: Sequence[MissionStep]) -> Iterator[ArgumentLine | None]:
    """Yield for each step its line from an earlier instance, or None if the two differ in more than numbers."""
    for earlier, step in zip(before, steps, strict=True):
        now = step.flat
        line = ArgumentLine(earlier.arguments, now.arguments) if earlier.skill == now.skill else None
        numbers = {parameter.cell for parameter in now.contract.parameters if parameter.kind == QUANTITY}
        yield line if line is not None and numbers.issuperset(line.moving) else None


#: the number of earlier instances with which an instance is compared
_COMPARED: Final = 8

#: a proof that reports steps that may begin when they are refused, and returns whether there are any
Timely: TypeAlias = Callable[[ProofContext, Sequence[MissionStep], Sequence[ArgumentLine | None]], bool]


def prove_between(proof: ProofContext, mission: MissionDecl, steps: Sequence[MissionStep], timely: Timely) -> None:
    """Report the first value between this instance and an earlier one with which a step is refused."""
    now = tuple(StepInstance(step.flat.skill, step.flat.arguments, tuple(step.time.requirements)) for step in steps)
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
                step._replace(time=replace(step.time, requirements=[*step.time.requirements, *other.requirements]))
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
        code, result = codes.OUT_OF_SCOPE, f"not permitted by `{policy.name}`"
        if rule is not None and rule.target is None:
            code, result = codes.FORBIDDEN, f"forbidden by `{policy.name}`"
        elif rule is not None:
            code, result = codes.DEGRADED, f"not flown: `{policy.name}` replaces it by another skill"
        proof.report.add(
            code,
            step.span,
            f"with {situation}, which the mission's parameters allow, this step is {result}",
            help="narrow the range of the mission's parameter",
            labels=[(proof.span(each), label) for each in rules],
        )
        return True
    return False
