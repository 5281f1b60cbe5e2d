"""E0718: whenever a mission is issued, a step may come at a time of day at which it may not fly.

Without a time of issue there must be some one that will do: all that its steps ask of it (`Period.asked`, and what
permits and forbids them) must be met at once. Dates are left for the time of issue (`hours`).

Between two instances of a mission each value needs such a time of issue, not all of them the same: where none does for
all, the values are halved until one does for each part, or a single value is left.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.diagnostics import codes
from rtshcua.ground.analysis.daytime import Arc, Asked, arcs_where, met_by_some
from rtshcua.ground.prove.hopeful import Known, refused, refusing
from rtshcua.ground.prove.line import Line
from rtshcua.ground.prove.period import Cycle, Period, along, changes
from rtshcua.ground.prove.places import may_be_skipped
from rtshcua.ground.prove.situation import Ground
from rtshcua.model.ir.missions import Step
from rtshcua.model.quantity import Dimension, display


def prove(
    ground: Ground,
    steps: Sequence[Step],
    invocations: Sequence[PreparedInvocation],
    comes: Sequence[Period],
    lines: Sequence[Line | None],
) -> bool:
    """Report the first step up to which no time of issue will do, for some arguments on its line; whether there is
    one.
    """
    waiting = [list(lines)]
    while waiting:
        part = waiting.pop()
        failed = _failed(ground, invocations, comes, part)
        if failed is None:
            continue
        if all(line is None or line.single for line in part):
            _report(ground, steps, invocations, part, failed)
            return True
        halves = [None if line is None else line.halves() for line in part]
        waiting += [[half and half[side] for half in halves] for side in (1, 0)]
    return False


class Failed(NamedTuple):
    """A step, by its number, for which no time of issue will do; when it comes after that, and what is asked of it."""

    step: int
    low: int
    asked: Sequence[Asked]


def _failed(
    ground: Ground,
    invocations: Sequence[PreparedInvocation],
    comes: Sequence[Period],
    lines: Sequence[Line | None],
) -> Failed | None:
    """The first step up to which no one time of issue will do for all arguments on the lines."""
    asked: list[Asked] = []
    periods = along(comes, invocations, lines)
    for number, (invocation, line, period) in enumerate(zip(invocations, lines, periods, strict=True)):
        if line is None or line.empty or may_be_skipped(invocation):
            continue
        found = [*period.asked, *_asked(ground, invocation, line, period)]
        asked += found
        if found and not met_by_some(asked):
            return Failed(number, period.low, found)
    return None


def _asked(ground: Ground, invocation: PreparedInvocation, line: Line, period: Period) -> Iterator[Asked]:
    """What the rules that read the time of day ask."""
    arguments = invocation.invocation.arguments
    rules = (*(each.rule for each in invocation.candidates.permits), *refusing(invocation))
    read = [(rule, changes(ground, rule.when, arguments)) for rule in rules if rule.when is not None]
    clocked = [rule for rule, (windows, _) in read if windows]
    if clocked:
        labels = tuple((ground.span(rule), "this reads the time") for rule in clocked)
        windows = [window for _, (windows, _) in read for window in windows]
        cycle = Cycle.of(ground, windows)
        arcs = _permitted(ground, invocation, line, cycle, cycle.edges(windows))
        yield Asked(arcs, period.low, period.high, cycle.period, labels)


def _permitted(
    ground: Ground, invocation: PreparedInvocation, line: Line, cycle: Cycle, edges: Sequence[int]
) -> tuple[Arc, ...]:
    """When a step is surely permitted with all arguments on its line, as far as these and the time say."""
    space = ground.questions.space(invocation.invocation.skill)._replace(
        arguments=line.values, phases=frozenset((invocation.phase,))
    )

    def permitted(moment: int) -> bool:
        then = space._replace(utc=(cycle.at(moment),))
        return not any(True for _ in refused(ground, invocation, then, Known.DAYTIME, line.given))

    return arcs_where(edges, permitted, cycle.period)


def _report(
    ground: Ground,
    steps: Sequence[Step],
    invocations: Sequence[PreparedInvocation],
    lines: Sequence[Line | None],
    failed: Failed,
) -> None:
    first = display(failed.low, Dimension.DURATION)
    last = display(max(one.high for one in failed.asked), Dimension.DURATION)
    told = (
        line.words(one.invocation.contract) for line, one in zip(lines, invocations, strict=True) if line is not None
    )
    moved = next((words for words in told if words), "")
    ground.context.report.add(
        codes.NOT_ALWAYS_PERMITTED,
        steps[failed.step].span,
        (f"with {moved}, which the mission's parameters allow: " if moved else "")
        + f"whenever the mission is issued, this step may come at a time at which it is not permitted: it comes "
        f"{f'{first} to {last}' if failed.low else f'at once or up to {last}'} after that",
        help="widen the times, or let the mission take less: that is the time to its start, then all deadlines, "
        "approvals and durations before the step",
        labels=dict.fromkeys(label for one in failed.asked for label in one.labels),
    )
