"""E0703, E0704, E0718, E0719: a mission's parameters may have values between those that it is checked with, and no step
is refused for any of them.

With a value that is refused whatever the time, the step is out of scope, or forbidden. Of one that is refused at times
only, the same is asked as of every instance: whether the time of issue suits it, or some time would. What the ways of
the two instances ask of that time, either of them, is asked of all values between.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final, TypeAlias

from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.diagnostics import codes
from rtshcua.ground.analysis.questions import Tried
from rtshcua.ground.analysis.words import words
from rtshcua.ground.prove.hopeful import Known, refused
from rtshcua.ground.prove.line import Line, lines
from rtshcua.ground.prove.period import Period
from rtshcua.ground.prove.situation import Ground
from rtshcua.model.ir.missions import MissionDecl, Step

#: to how many earlier instances of a mission one is compared
_COMPARED: Final = 8

#: the proof about the time: whether the steps may come at a time at which they are refused, which it then reports
Timely: TypeAlias = Callable[
    [Ground, Sequence[Step], Sequence[PreparedInvocation], Sequence[Period], Sequence[Line | None]], bool
]


def prove(
    ground: Ground,
    mission: MissionDecl,
    steps: Sequence[Step],
    invocations: Sequence[PreparedInvocation],
    comes: Sequence[Period],
    timely: Timely,
) -> None:
    """Report the first value between this instance and an earlier one with which a step is refused."""
    now = tuple(
        Tried(one.invocation.skill, one.invocation.arguments, tuple(period.asked))
        for one, period in zip(invocations, comes, strict=True)
    )
    earlier = ground.questions.instances.setdefault(mission.name.text, [])
    for before in earlier[:_COMPARED]:
        if len(before) != len(now):
            continue
        between = list(lines(before, invocations))
        for step, invocation, line in zip(steps, invocations, between, strict=True):
            if line is not None and line.moving and _refused(ground, step, invocation, line):
                return
        if any(line is not None and line.moving for line in between):
            both = [replace(one, asked=[*one.asked, *two.asked]) for one, two in zip(comes, before, strict=True)]
            if timely(ground, steps, invocations, both, between):
                return
    earlier.append(now)


def _refused(ground: Ground, step: Step, invocation: PreparedInvocation, line: Line) -> bool:
    space = ground.questions.space(invocation.invocation.skill)._replace(
        arguments=line.values, phases=frozenset((invocation.phase,))
    )
    for witness, rule in refused(ground, invocation, space, Known.NOTHING, line.given):
        policy = ground.prepared.policy
        situation = words(witness, policy, invocation.invocation.contract)
        rules = [each.rule for each in invocation.candidates.permits] if rule is None else [rule]
        label = "this does not permit it" if rule is None else "by this rule"
        code, said = codes.OUT_OF_SCOPE, f"outside of what `{policy.name}` permits"
        if rule is not None and rule.target is None:
            code, said = codes.FORBIDDEN, f"forbidden by `{policy.name}`"
        elif rule is not None:
            code, said = codes.DEGRADED, f"not flown: `{policy.name}` flies another skill in its place"
        ground.context.report.add(
            code,
            step.span,
            f"with {situation}, which the mission's parameters allow, this step is {said}",
            help="narrow the range of the mission's parameter",
            labels=[(ground.span(each), label) for each in rules],
        )
        return True
    return False
