"""Situations as sets of values; a single situation is a set of one."""

from collections.abc import Sequence
from itertools import repeat
from operator import le
from typing import TypeGuard, cast

from rtshcua.decision.evaluate import Environment
from rtshcua.decision.prepare import PreparedPolicy, SeenSituation
from rtshcua.decision.values import FALSE, MAYBE, MISSING, PRESENT, TRUE, UNKNOWN, Sets, Truth, Value
from rtshcua.decision.volume import Volume
from rtshcua.model.flat.situation import Now, State

#: the allowed truths of a temporal monitor in a single situation
SINGLE = frozenset({TRUE, FALSE, UNKNOWN})


def environment(sets: Sets, policy: PreparedPolicy, arguments: Sequence[Value], phase: int) -> Environment:
    """The environment in which conditions read a set of situations. `phase` is that of the invocation, -1 without
    one.
    """
    seen = policy.seen
    known = None if seen is None or seen.sets is not sets else seen.environments
    for at in known or ():
        if at.arguments is arguments and at.phase == phase:
            return at
    values, _, utc, error, monitors = sets
    if len(monitors) != len(policy.monitors):
        monitors = ()
    at = Environment([*values, MISSING], arguments, utc, error, None, monitors, phase)
    if known is not None:
        known.append(at)
    return at


def situation(state: State, policy: PreparedPolicy, now: Now) -> Sets:
    """The set that contains only this situation. A slot is MISSING if it is missing, stale or out of its range.

    A state of the wrong size is a fault of its producer, and none of its values are used. The same applies to the
    truths of temporal monitors if their number is wrong or one is not a truth.
    """
    return remembered(state, policy, now).sets


def remembered(state: State, policy: PreparedPolicy, now: Now) -> SeenSituation:
    """The situation with its cached results."""
    seen = policy.seen
    if seen is None or seen.now != now or seen.state != state:
        seen = policy.seen = SeenSituation(state, now, _situation(state, policy, now), [], [], [])
    return seen


def _situation(state: State, policy: PreparedPolicy, now: Now) -> Sets:
    limits, told, ages = policy.limits, state.values, state.ages
    values: list[Value]
    if not len(told) == len(ages) == len(limits):
        values = [MISSING] * len(limits)
    elif _all_known(told, ages, policy):  # the common case, found sooner
        values = [*zip(told, told, repeat(PRESENT), repeat(None))]
    else:
        values = [
            (value, value, PRESENT, None)
            if value is not None and 0 <= age <= stale and -most <= value <= most
            else MISSING
            for value, age, (stale, most) in zip(told, ages, limits, strict=True)
        ]
    monitors: Sequence[Truth] = state.monitors
    count = len(policy.monitors)
    if len(monitors) != count or (count and not SINGLE.issuperset(monitors)):
        monitors = (UNKNOWN,) * count
    utc, error = now.utc_us, max(now.utc_error_us, 0)
    return Sets(values, (now.monotonic_us, now.monotonic_us), ((utc, utc),), (error, error), monitors)


def _all_known(told: Sequence[int | None], ages: Sequence[int], policy: PreparedPolicy) -> TypeGuard[Sequence[int]]:
    """Whether every slot is present, fresh and within its range."""
    if None in told or min(ages, default=0) < 0:
        return False
    stale, least, most = policy.bounds
    values = cast("Sequence[int]", told)
    return all(map(le, ages, stale)) and all(map(le, least, values)) and all(map(le, values, most))


def is_situation(sets: Sets, policy: PreparedPolicy) -> bool:
    """Whether a set of situations has exactly one member."""
    spans = (sets.monotonic_us, sets.utc_error_us, *sets.utc_us)
    points = all(low == high and gap != MAYBE for low, high, gap, _ in sets.values)
    if len(sets.monitors) != len(policy.monitors) or not SINGLE.issuperset(sets.monitors):
        return False
    return points and len(sets.utc_us) == 1 and all(low == high for low, high in spans)


def ranging(at: Environment, volume: Volume, height: int, through: int) -> Environment:
    """The same set, with position and height anywhere in a volume, at any time until `through` us from now."""
    slots = list(at.slots)
    slots[height] = volume.height
    return at.over(slots, volume.place, through)
