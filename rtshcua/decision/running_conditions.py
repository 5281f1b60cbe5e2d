"""The conditions that must hold while a skill runs (paper symbols `sc`, `inv`), and while a vehicle waits in the air
for its next step (design 4.4: energy bounds holding), at its place and on its predicted path.

The predicted path is every place where a vehicle may be before it stands still, if it is told to stop now. Since
its state was measured it flew on unchanged (the older the state, the further). After the order to stop it
continues for its declared reaction time, and then brakes at its declared rate. With v the velocity over ground,
|v| its magnitude, t the sum of the state's age and the reaction time, and a the braking, it stops v*t + v*|v|/(2a)
from the measured place, on the straight line there. All values are rounded away from the vehicle and widened by
its position error like a planned volume. A vehicle that declares no braking is assumed to be where it was
measured.
"""

from collections.abc import Iterator, Sequence
from math import isqrt
from typing import NamedTuple

from rtshcua.decision.contracts import drains
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.flying import SECOND
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy
from rtshcua.decision.situation import environment, ranging, situation
from rtshcua.decision.values import EVERYWHERE, FALSE, NOT, PRESENT, TRUE, UNKNOWN, Truth, Value
from rtshcua.decision.volume import UNKNOWN_VOLUME, Volume, distance
from rtshcua.decision.zones import PlaceSet, Sweep
from rtshcua.model.flat.limits import MAX_SPEED
from rtshcua.model.flat.situation import Now, State


class PredictedPath(NamedTuple):
    """A predicted path as a volume, and the greatest time until standstill from now, in us."""

    volume: Volume
    lasts_us: int


UNKNOWN_AHEAD = PredictedPath(UNKNOWN_VOLUME, 0)


def ahead(slots: Sequence[Value], ages: Sequence[int], policy: PreparedPolicy) -> PredictedPath:
    """The predicted path in one situation, and the ages of its slots. It is unknown where position or velocity is
    missing; where the height is missing, the path has no heights.
    """
    known, vehicle = policy.tables.known, policy.policy.vehicle
    x, _, x_gap, _ = slots[known.x]
    y, _, y_gap, _ = slots[known.y]
    height, _, height_gap, _ = slots[known.height]
    if x_gap != PRESENT or y_gap != PRESENT:
        return UNKNOWN_AHEAD
    if not vehicle.braking:
        return PredictedPath(policy.still.volume(slots, known), 0)
    east, _, east_gap, _ = slots[known.east]
    north, _, north_gap, _ = slots[known.north]
    down, _, down_gap, _ = slots[known.down]
    if east_gap != PRESENT or north_gap != PRESENT or down_gap != PRESENT:
        return UNKNOWN_AHEAD
    speed = _root(east * east + north * north + down * down)
    if speed > MAX_SPEED:
        return UNKNOWN_AHEAD
    age_us = max(ages[known.x], ages[known.y], ages[known.east], ages[known.north], ages[known.down])
    if height_gap == PRESENT:
        age_us = max(age_us, ages[known.height])
    goes_us, braking = age_us + vehicle.reaction_us, vehicle.braking
    part, whole = 2 * braking * goes_us + speed * SECOND, 2 * braking * SECOND
    to_x, to_y = x + _away(east * part, whole), y + _away(north * part, whole)
    to_height = height + _away(-down * part, whole)
    reach = vehicle.position_error + 1  # rounding the ends bends the line by less than 1 mm
    low, high = min(height, to_height), max(height, to_height)
    sweep = Sweep((x, y, to_x, to_y), (-reach, -reach, reach, reach))
    farthest = max(distance(x, y), distance(to_x, to_y))
    place = PlaceSet(((sweep, low, high),), PRESENT, height_gap)
    volume = Volume(place, (low, high, height_gap, None), (farthest, farthest))
    return PredictedPath(volume, goes_us - age_us - (-speed * SECOND // braking))


def _root(square: int) -> int:
    """The square root, rounded up."""
    return isqrt(square - 1) + 1 if square else 0


def _away(numerator: int, denominator: int) -> int:
    """A quotient rounded away from zero."""
    return -(-numerator // denominator) if numerator >= 0 else numerator // denominator


WAY_HOME = "the reserve and the way home"


class Unkept(NamedTuple):
    """The text of a condition that should hold and is FALSE or UNKNOWN."""

    text: str
    truth: Truth


def holding(invocation: PreparedInvocation, state: State, policy: PreparedPolicy, now: Now) -> tuple[Unkept, ...]:
    """The conditions that prevent waiting for `invocation` here: the airspace, its `degrade` rules, the charge to
    return.

    They are judged at every place where the vehicle may be before it stands still (see `ahead`).
    """
    sets = situation(state, policy, now)
    at = environment(sets, policy, invocation.arguments, invocation.phase)
    volume, lasts_us = ahead(at.slots, state.ages, policy)
    checks = [Unkept(rule.rule.text, NOT[rule.condition(at)]) for rule in invocation.candidates.degrades]
    if policy.airspace is not None:
        truth = policy.airspace.keeps(volume.place, at, lasts_us)
        checks.append(Unkept(policy.airspace.airspace.text, EVERYWHERE[truth]))
    checks.append(Unkept(WAY_HOME, way_home(at, volume, invocation)))
    return tuple(check for check in checks if check.truth != TRUE)


def way_home(at: Environment, volume: Volume, invocation: PreparedInvocation) -> Truth:
    """Whether the battery holds the reserve and the way home from anywhere in a volume, without position error.

    The way is computed as for the admission of a skill (`Energy`), rounded up.
    """
    policy, vehicle = invocation.policy, invocation.policy.policy.vehicle
    charge, _, gap, _ = at.slots[policy.tables.known.battery]
    if gap != PRESENT or volume.place.located != PRESENT or (vehicle.speeds and volume.height[2] != PRESENT):
        return UNKNOWN
    drain = drains(at.slots[policy.tables.known.drain])[1]
    home = invocation.energy.way_home(volume.farthest[1], volume.height[:2], drain)
    return TRUE if charge >= vehicle.reserve + home else FALSE


def watch(invocation: PreparedInvocation, state: State, policy: PreparedPolicy, now: Now) -> Iterator[Unkept]:
    """The conditions that do not hold now, out of `assume`, the `degrade` rules (none may match), `maintain`, the
    airspace and the charge to return. They are found lazily, the fast ones first, so that a caller may stop early.

    As at admission, `assume` and `degrade` are judged at the present place, the others at every place that the
    vehicle may reach before standstill (`ahead`). UNKNOWN counts as FALSE when it lasts longer than the contract's
    grace; the caller measures that time.
    """
    sets = situation(state, policy, now)
    at = environment(sets, policy, invocation.arguments, invocation.phase)
    for clause, condition in invocation.assume:
        truth = condition(at)
        if truth != TRUE:
            yield Unkept(clause.text, truth)
    for rule in invocation.candidates.degrades:
        truth = NOT[rule.condition(at)]
        if truth != TRUE:
            yield Unkept(rule.rule.text, truth)
    volume, lasts_us = ahead(at.slots, state.ages, policy)
    if invocation.maintain:
        over = ranging(at, volume, policy.tables.known.height, lasts_us)
        for clause, condition in invocation.maintain:
            truth = EVERYWHERE[condition(over)]
            if truth == UNKNOWN:  # a condition that fails at the present place fails on every path
                truth = EVERYWHERE[truth | condition(at) & FALSE]
            if truth != TRUE:
                yield Unkept(clause.text, truth)
    if policy.airspace is not None:
        truth = EVERYWHERE[policy.airspace.keeps(volume.place, at, lasts_us)]
        if truth != TRUE:
            yield Unkept(policy.airspace.airspace.text, truth)
    if invocation.energy.stays:
        truth = way_home(at, volume, invocation)
        if truth != TRUE:
            yield Unkept(WAY_HOME, truth)
