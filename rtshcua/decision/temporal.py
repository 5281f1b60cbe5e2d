"""Temporal monitors: the bounded past of a condition, in constant memory.

Time is monotonic, in us. An *observation* is a moment at which the runtime looks at the state. Let the observations so
far be at t_1 <= t_2 <= ... <= t_n = t, the present one last, and let v_i be the truth of the condition c in the state
at t_i. The truth of c over time, s_c, is a step function:

    s_c(tau) = v_i      at tau = t_i, and for t_i < tau < t_i+1, if t_i+1 - t_i <= MAX_GAP
    s_c(tau) = UNKNOWN  for t_i < tau < t_i+1, if t_i+1 - t_i > MAX_GAP, and for tau < t_1

Where several observations fall on one moment, each of them counts there. A time that goes back is taken to stand
still. Each operator is defined on s_c (Kleene's order, FALSE < UNKNOWN < TRUE):

    FOR_LAST w     min of s_c(tau) for t - w <= tau <= t      MTL's historically, H[0, w] c
    WITHIN_LAST w  max of s_c(tau) for t - w <= tau <= t      MTL's once, O[0, w] c
    RISING         not v_n-1 and v_n                          v_0 = UNKNOWN
    FALLING        v_n-1 and not v_n

What a monitor says is again the truth of a condition over time, so monitors nest: an inner one stands before the outer
one in the policy, and is observed before it.

Source: bounded-past MTL (Thati and Rosu, "Monitoring algorithms for metric temporal logic specifications", 2005), with
Kleene's three truth values; the windows are closed on both sides. To know whether a stretch of a truth meets the window
it is enough to know the last us that belongs to it, one number for each truth that can decide.
"""

from typing import Final, NamedTuple

from rtshcua.decision.evaluate import NO_PHASE
from rtshcua.decision.prepare import PreparedMonitor, PreparedPolicy
from rtshcua.decision.situation import environment, situation
from rtshcua.decision.values import AND, FALSE, NOT, TRUE, UNKNOWN, Truth
from rtshcua.model.flat.limits import MAX_GAP
from rtshcua.model.flat.policy import MonitorKind
from rtshcua.model.flat.situation import Now, State

_NEVER: Final = -(1 << 62)  # us: before any window


class Remembered(NamedTuple):
    """The memory of one condition: its truth at the last observation, and the last us of its time line at which it
    was true, false and unknown.
    """

    last: Truth
    true_us: int
    false_us: int
    unknown_us: int


class Memory(NamedTuple):
    """The memory between two observations. `at_us` is the moment of the last one, None before the first."""

    at_us: int | None
    conditions: tuple[Remembered, ...]


def initial(policy: PreparedPolicy) -> Memory:
    """The memory before the first observation."""
    return Memory(None, (Remembered(UNKNOWN, _NEVER, _NEVER, _NEVER),) * len(policy.monitors))


def observe(memory: Memory, policy: PreparedPolicy, state: State, now: Now) -> tuple[Memory, tuple[Truth, ...]]:
    """Process one observation. Return the new memory, and the present truth of each monitor of the policy
    (`State.monitors`).

    The truths of the monitors in `state` are ignored.
    """
    at_us = now.monotonic_us if memory.at_us is None else max(now.monotonic_us, memory.at_us)
    truths: list[Truth] = []
    at = environment(situation(state, policy, now), policy, (), NO_PHASE)
    at.monitors = truths  # grows in the loop: a monitor reads those before it
    conditions: list[Remembered] = []
    for monitor, before in zip(policy.monitors, memory.conditions, strict=True):
        after = _observed(before, monitor.condition(at), memory.at_us, at_us)
        truths.append(_says(monitor, before, after, at_us))
        conditions.append(after)
    return Memory(at_us, tuple(conditions)), tuple(truths)


def lasting(state: State, policy: PreparedPolicy, now: Now) -> State:
    """The state with the truths of the monitors after it has lasted longer than any of them looks back."""
    memory, monitors = initial(policy), state.monitors
    looked_back = sum(
        monitor.window_us for monitor in policy.monitors
    )  # the windows add up, because a monitor may look at another one
    for at_us in range(0, looked_back + 3 * MAX_GAP, MAX_GAP) if policy.monitors else ():
        memory, monitors = observe(memory, policy, state, Now(at_us, now.utc_us, now.utc_error_us))
    return State(state.values, state.ages, monitors)


def _observed(before: Remembered, truth: Truth, last_us: int | None, at_us: int) -> Remembered:
    """The time line up to and including an observation: the interval since the last one, then the present truth."""
    _, true_us, false_us, unknown_us = before
    if last_us is None or at_us - last_us > MAX_GAP:
        unknown_us = at_us - 1
    elif at_us > last_us:
        if before.last == TRUE:
            true_us = at_us - 1
        elif before.last == FALSE:
            false_us = at_us - 1
        else:
            unknown_us = at_us - 1
    if truth == TRUE:
        return Remembered(truth, at_us, false_us, unknown_us)
    if truth == FALSE:
        return Remembered(truth, true_us, at_us, unknown_us)
    return Remembered(UNKNOWN, true_us, false_us, at_us)


def _says(monitor: PreparedMonitor, before: Remembered, after: Remembered, at_us: int) -> Truth:
    """The truth of a monitor at an observation, from its memory and the present truth."""
    kind, start_us = monitor.kind, at_us - monitor.window_us
    if kind == MonitorKind.FOR_LAST:  # H[0, w] c: FALSE if some moment was FALSE, else UNKNOWN if one was, else TRUE
        return FALSE if after.false_us >= start_us else UNKNOWN if after.unknown_us >= start_us else TRUE
    if kind == MonitorKind.WITHIN_LAST:  # O[0, w] c: TRUE if some moment was TRUE, else UNKNOWN if one was, else FALSE
        return TRUE if after.true_us >= start_us else UNKNOWN if after.unknown_us >= start_us else FALSE
    if kind == MonitorKind.RISING:  # not c at the observation before, and c now: FALSE where either rules it out
        return AND[NOT[before.last]][after.last]
    return AND[before.last][NOT[after.last]]
