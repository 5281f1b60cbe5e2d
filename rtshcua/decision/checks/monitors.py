"""Temporal monitors, and the names of mission phases that conditions may ask for."""

from collections.abc import Iterator

from rtshcua.decision.checks.contracts import clause
from rtshcua.decision.checks.indexes import at, within
from rtshcua.decision.scope import Scope
from rtshcua.model.flat.limits import MAX_MONITORS, MAX_PHASE_NAMES, MAX_WINDOW
from rtshcua.model.flat.policy import Monitor, MonitorKind, Policy


def monitors(policy: Policy, scope: Scope) -> Iterator[str]:
    """What is wrong with a policy's monitors: each reads only those before it, so that one pass observes them all."""
    yield from within("number of monitors", len(policy.monitors), 0, MAX_MONITORS)
    for number, one in enumerate(policy.monitors):
        yield from at(f"monitor {number}", _monitor(one, scope.inside_monitor(number)))


def _monitor(monitor: Monitor, scope: Scope) -> Iterator[str]:
    yield from within("kind", monitor.kind, MonitorKind.FOR_LAST, MonitorKind.FALLING)
    low, high = (1, MAX_WINDOW) if monitor.kind in (MonitorKind.FOR_LAST, MonitorKind.WITHIN_LAST) else (0, 0)
    yield from within("window", monitor.window_us, low, high)
    yield from clause(monitor.when, scope)


def phases(policy: Policy) -> Iterator[str]:
    """What is wrong with the names of mission phases."""
    yield from within("number of phase names", len(policy.phases), 0, MAX_PHASE_NAMES)
    if len(set(policy.phases)) != len(policy.phases):
        yield "two phase names are the same"
