"""E0718: whenever a mission is issued, a step may come at a time of day at which it is not permitted.

Without a time of issue there must be some one that will do. A step comes no sooner after the issue than those before it
take at least, and no later than they take at most; all moments between must be permitted, and inside of the airspace's
daily times until the step must have ended. Zones that exist on dates are left for the time of issue (`hours`).
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.values import point
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.compiler.proofs.hopeful import refused
from rtshcua.ground.compiler.proofs.places import may_be_skipped
from rtshcua.ground.compiler.proofs.ruleset import timed
from rtshcua.ground.compiler.proofs.situation import Ground
from rtshcua.ground.compiler.proofs.timing import START_WINDOW_US, approval
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.limits import DAY
from rtshcua.model.flat.policy import Rule
from rtshcua.model.ir.missions import Step
from rtshcua.model.quantity import Dimension, display


class Arc(NamedTuple):
    """Moments of the day, in us of UTC: from `start` on, `length` of them."""

    start: int
    length: int


class Asked(NamedTuple):
    """One of these arcs must hold all from `low` to `high` us after the issue; where that is written."""

    arcs: tuple[Arc, ...]
    low: int
    high: int
    labels: tuple[tuple[Span, str], ...]

    def met(self, issue: int) -> bool:
        """Whether that is so for a time of issue."""
        return any(
            arc.length >= DAY or (issue + self.low - arc.start) % DAY + self.high - self.low < arc.length
            for arc in self.arcs
        )


def prove(ground: Ground, steps: Sequence[Step], invocations: Sequence[PreparedInvocation]) -> None:
    """Report the first step up to which no time of issue will do."""
    earliest, latest = 0, START_WINDOW_US
    asked: list[Asked] = []
    for step, invocation in zip(steps, invocations, strict=True):
        flat = invocation.invocation
        latest += approval(ground, invocation) + flat.contract.deadline_us
        if not may_be_skipped(invocation):
            found = list(_asked(ground, invocation, earliest, latest))
            asked += found
            if found and not _some_time(asked):
                _report(ground, step, earliest, latest, found)
                return
        latest += flat.contract.duration_us
        time = flat.contract.motion.time
        earliest += flat.arguments[time] if time >= 0 else 0


def _some_time(asked: Sequence[Asked]) -> bool:
    """What is asked of the time of issue is met by it from some moments on, each; so one of these, or none."""
    issues = {0, *((arc.start - one.low) % DAY for one in asked for arc in one.arcs)}
    return any(all(one.met(issue) for one in asked) for issue in issues)


def _asked(ground: Ground, invocation: PreparedInvocation, low: int, high: int) -> Iterator[Asked]:
    airspace, zones = ground.prepared.airspace, ground.prepared.policy.zones
    if airspace is not None:
        for each in airspace.inside:
            zone = zones[each.number]
            if zone.daily and not zone.dates:
                start, end = _edges(ground, *zone.daily)
                arc = Arc(start, (end - start) % DAY or DAY)
                label = (ground.span(airspace.airspace), f"`{zone.name}` exists at some times of the day only")
                yield Asked((arc,), low, high + invocation.lasts_us, (label,))
    rules = [each.rule for each in (*invocation.candidates.permits, *invocation.candidates.forbids)]
    clocked = [rule for rule in rules if rule.when is not None and timed(rule.when.code, zones)]
    if clocked and not any(zone.dates for zone in zones):
        labels = tuple((ground.span(rule), "this reads the time") for rule in clocked)
        yield Asked(_permitted(ground, invocation, clocked), low, high, labels)


def _permitted(ground: Ground, invocation: PreparedInvocation, rules: Sequence[Rule]) -> tuple[Arc, ...]:
    """When a step is surely permitted, as far as its arguments and the time say."""
    flat = invocation.invocation
    space = ground.questions.space(flat.skill)._replace(
        arguments=tuple(map(point, flat.arguments)), phases=frozenset((invocation.phase,))
    )
    edges = sorted(set(_changes(ground, rules)))
    if not edges:
        return (Arc(0, DAY),)
    arcs: list[Arc] = []
    for start, end in pairwise((*edges, edges[0] + DAY)):
        spans = ((start, min(end, DAY) - 1), *(((0, end - DAY - 1),) if end > DAY else ()))
        if any(True for span in spans for _ in refused(ground, invocation, space._replace(utc=(span,)))):
            continue
        if arcs and arcs[-1].start + arcs[-1].length == start:
            arcs[-1] = Arc(arcs[-1].start, arcs[-1].length + end - start)
        else:
            arcs.append(Arc(start, end - start))
    if len(arcs) > 1 and arcs[-1].start + arcs[-1].length == arcs[0].start + DAY:
        arcs[0] = Arc(arcs[-1].start, arcs[-1].length + arcs[0].length)
        del arcs[-1]
    return tuple(arcs)


def _changes(ground: Ground, rules: Sequence[Rule]) -> Iterator[int]:
    """The moments of the day at which something about the time changes."""
    for rule in rules:
        assert rule.when is not None
        code = rule.when.code
        for op, start, end in zip(code[::3], code[1::3], code[2::3], strict=True):
            if op == Op.TIME_IN:
                yield from _edges(ground, start, end)
    for zone in ground.prepared.policy.zones:
        if zone.daily:
            yield from _edges(ground, *zone.daily)


def _edges(ground: Ground, start: int, end: int) -> tuple[int, int]:
    """Where a window of the local day begins, and where it has just ended, in us of UTC."""
    offset = ground.prepared.policy.vehicle.utc_offset_us
    return (start - offset) % DAY, (min(end, DAY - 1) + 1 - offset) % DAY


def _report(ground: Ground, step: Step, low: int, high: int, asked: Sequence[Asked]) -> None:
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
