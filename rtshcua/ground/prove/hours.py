"""E0718: a step may come at a time of day, or on a date, at which it is not permitted.

A step comes no sooner after the mission's issue than those before it take at least, and no later than they take at
most. Without a time of issue nothing is said: authority itself asks whether there is a time that will do.
"""

from collections.abc import Sequence

from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.diagnostics import codes
from rtshcua.ground.analysis.space import reads_days
from rtshcua.ground.analysis.words import clock, words
from rtshcua.ground.prove.hopeful import Known, refused, refusing
from rtshcua.ground.prove.line import Line
from rtshcua.ground.prove.period import Period, along
from rtshcua.ground.prove.ruleset import timed
from rtshcua.ground.prove.situation import Ground
from rtshcua.model.ir.missions import Step


def prove(
    ground: Ground,
    steps: Sequence[Step],
    invocations: Sequence[PreparedInvocation],
    comes: Sequence[Period],
    lines: Sequence[Line | None],
) -> bool:
    """Report the first step that may come at such a time, with arguments on its line; whether there is one."""
    periods = along(comes, invocations, lines)
    return any(
        line is not None and _refused(ground, step, invocation, line, period.utc(0)[0])
        for step, invocation, line, period in zip(steps, invocations, lines, periods, strict=True)
    )


def _refused(ground: Ground, step: Step, invocation: PreparedInvocation, line: Line, window: tuple[int, int]) -> bool:
    flat, zones = invocation.invocation, ground.prepared.policy.zones
    rules = (*(each.rule for each in invocation.candidates.permits), *refusing(invocation))
    if not any(rule.when is not None and timed(rule.when.code, zones) for rule in rules):
        return False
    space = ground.questions.space(flat.skill)._replace(
        arguments=line.values, utc=(window,), phases=frozenset((invocation.phase,))
    )
    for witness, rule in refused(ground, invocation, space, Known.ALL, line.given):
        local, day = ground.prepared.tables.local, reads_days(ground.prepared.policy)
        at, first, last = (clock(moment, local, day=day) for moment in (witness.at.utc[0][0], *window))
        told = [each.rule for each in invocation.candidates.permits] if rule is None else [rule]
        does = "forbids it"
        if rule is None:
            does = "does not permit it"
        elif rule.target is not None:
            does = "flies another skill in its place"
        moved = f" with {words(witness, ground.prepared.policy, flat.contract)}" if line.moving else ""
        ground.context.report.add(
            codes.NOT_ALWAYS_PERMITTED,
            step.span,
            f"at {at} this step is not permitted{moved}, and it may come from {first} to {last}, local time",
            help="issue the mission at another time, or move the step",
            labels=[(ground.span(each), f"this {does} then") for each in told],
        )
        return True
    return False
