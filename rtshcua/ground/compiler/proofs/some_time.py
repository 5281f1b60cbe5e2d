"""E0718: whenever a mission is issued, a step may come at a time of day at which it may not fly.

Without a time of issue there must be some one that will do: all that its steps ask of it (`Period.asked`, and what
permits and forbids them) must be met at once. Dates are left for the time of issue (`hours`).
"""

from collections.abc import Iterator, Sequence

from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.values import point
from rtshcua.diagnostics import codes
from rtshcua.ground.compiler.proofs.hopeful import refused
from rtshcua.ground.compiler.proofs.period import Arc, Asked, Period, arcs_where, changes
from rtshcua.ground.compiler.proofs.places import may_be_skipped
from rtshcua.ground.compiler.proofs.situation import Ground
from rtshcua.model.flat.limits import DAY
from rtshcua.model.ir.missions import Step
from rtshcua.model.quantity import Dimension, display


def prove(
    ground: Ground, steps: Sequence[Step], invocations: Sequence[PreparedInvocation], comes: Sequence[Period]
) -> None:
    """Report the first step up to which no time of issue will do."""
    asked: list[Asked] = []
    for step, invocation, period in zip(steps, invocations, comes, strict=True):
        if may_be_skipped(invocation):
            continue
        found = [*period.asked, *_asked(ground, invocation, period)]
        asked += found
        if found and not _some_time(asked):
            _report(ground, step, period, found)
            return


def _some_time(asked: Sequence[Asked]) -> bool:
    """What is asked of the time of issue is met by it from some moments on, each; so one of these, or none."""
    issues = {0, *((arc.start - one.low) % DAY for one in asked for arc in one.arcs)}
    return any(all(one.met(issue) for one in asked) for issue in issues)


def _asked(ground: Ground, invocation: PreparedInvocation, period: Period) -> Iterator[Asked]:
    """What the rules that read the time of day ask."""
    arguments = invocation.invocation.arguments
    rules = [each.rule for each in (*invocation.candidates.permits, *invocation.candidates.forbids)]
    read = [(rule, changes(ground, rule.when, arguments)) for rule in rules if rule.when is not None]
    clocked = [rule for rule, (daily, _) in read if daily]
    if clocked:
        labels = tuple((ground.span(rule), "this reads the time") for rule in clocked)
        edges = [edge for _, (daily, _) in read for edge in daily]
        yield Asked(_permitted(ground, invocation, edges), period.low, period.high, labels)


def _permitted(ground: Ground, invocation: PreparedInvocation, edges: Sequence[int]) -> tuple[Arc, ...]:
    """When a step is surely permitted, as far as its arguments and the time say."""
    flat = invocation.invocation
    space = ground.questions.space(flat.skill)._replace(
        arguments=tuple(map(point, flat.arguments)), phases=frozenset((invocation.phase,))
    )

    def permitted(moment: int) -> bool:
        then = space._replace(utc=((moment, moment),))
        return not any(True for _ in refused(ground, invocation, then, dated=False))

    return arcs_where(edges, permitted)


def _report(ground: Ground, step: Step, period: Period, asked: Sequence[Asked]) -> None:
    low, high = period.low, max(one.high for one in asked)
    first = display(low, Dimension.DURATION)
    last = display(high, Dimension.DURATION)
    ground.context.report.add(
        codes.NOT_ALWAYS_PERMITTED,
        step.span,
        f"whenever the mission is issued, this step may come at a time at which it is not permitted: it comes "
        f"{f'{first} to {last}' if low else f'at once or up to {last}'} after that",
        help="widen the times, or let the mission take less: that is the time to its start, then all deadlines, "
        "approvals and durations before the step",
        labels=dict.fromkeys(label for one in asked for label in one.labels),
    )
