"""Steps 6 and 7 by hand: state, envelope, airspace and `maintain` over the planned volume, energy, `degrade`."""

from typing import Any

import pytest
from msgspec.structs import replace

from reference import flat_case as flat
from reference.asking import POLICY, STEP, ask, loaded, ready, with_contract
from reference.flat_case import (
    BATTERY,
    FIX,
    GOTO,
    HEIGHT,
    HOME,
    INSPECT,
    LAND,
    OBSTACLE,
    POSITION_X,
    POSITION_Y,
    TAKEOFF,
    WIND,
    M,
    clause,
)
from rtshcua.decision.contracts import Energy, drains
from rtshcua.decision.decide import decide
from rtshcua.decision.flying import MOST_DRAIN
from rtshcua.decision.values import MISSING, interval, maybe, point
from rtshcua.decision.volume import UNKNOWN_VOLUME, Planner, Volume
from rtshcua.decision.zones import PlaceSet, WellKnown
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Invocation, Plan
from rtshcua.model.flat.policy import Airspace, RuleKind
from rtshcua.model.flat.zone import HIGHEST, LOWEST
from rtshcua.model.outcome import Outcome, Reason
from virtual.rows import rows

ALLOW, DENY, DEFER, FALLBACK = Outcome
T, F, U = 1, 2, 4

# ------------------------------------------------------------------------------------------------------ 6 state


@rows(
    ("values", "outcome", "clause_"),
    [
        ({}, ALLOW, None),
        ({BATTERY: 3_500}, FALLBACK, flat.ENOUGH_CHARGE),
        ({BATTERY: None}, DEFER, flat.ENOUGH_CHARGE),
        ({BATTERY: None, WIND: 20 * M}, FALLBACK, flat.CALM),  # false and unknown together are false
        ({BATTERY: None, WIND: None}, DEFER, flat.ENOUGH_CHARGE),  # the first is named
        ({FIX: 2, WIND: 20 * M}, FALLBACK, flat.FIX_IS_GOOD),
    ],
)
def test_state(values: dict[int, int | None], outcome: Outcome, clause_: Any) -> None:
    decision = ask(values=values)
    assert (decision.outcome, decision.clause) == (outcome, clause_)


@rows("slot", range(flat.SLOTS))
def test_missing_stale_or_out_of_range_slot_is_unknown(slot: int) -> None:
    stale = next(s.stale_us for s in flat.SIGNALS if s.slot in (slot, slot - (s.kind == 2)))
    assert ask(values={slot: None}).outcome is DEFER
    assert ask(ages={slot: stale + 1}).outcome is DEFER
    assert ask(ages={slot: stale}).outcome is ALLOW
    assert ask(ages={slot: -1}).outcome is DEFER
    assert ask(values={slot: 1 << 53}).outcome is DEFER
    assert ask(values={slot: -(1 << 53)}).outcome is DEFER


@pytest.mark.parametrize(("values", "ages"), [((), ()), ((0,) * 9, (0,) * 9), ((9_000,) * 8, (0,) * 7)])
def test_state_of_wrong_size_is_ignored(values: tuple[int, ...], ages: tuple[int, ...]) -> None:
    decision = decide(ready(STEP, POLICY), flat.State(values, ages), POLICY, flat.context(), flat.NOW)
    assert (decision.outcome, decision.reason) == (DEFER, Reason.STATE_UNKNOWN)


# ------------------------------------------------------------------------------------------------ 7 envelope etc.


def goto(x: int, y: int, altitude: int = 20 * M) -> Invocation:
    return flat.invocation(1, 1, GOTO, Plan(MotionKind.FLY, (x, y), altitude, 0), x, y, altitude)


def test_a_plan_faster_than_the_vehicle() -> None:
    fast, slow = (
        loaded(replace(flat.POLICY, vehicle=replace(flat.POLICY.vehicle, speed=speed))) for speed in (4 * M, 4 * M - 1)
    )
    inspects = flat.INVOCATIONS[2]  # at 4 m/s
    assert ask(inspects, policy=fast).outcome is ALLOW
    decision = ask(inspects, policy=slow)
    assert (decision.outcome, decision.reason, decision.clause) == (FALLBACK, Reason.ENVELOPE, None)
    assert decision.step == 7


@rows(
    ("start", "to", "altitude", "reason"),
    [
        ((110, -20), (150, 20), 20, Reason.ADMITTED),
        ((110, -20), (496, 0), 20, Reason.ADMITTED),  # 4 m from the edge of the city, 3 m position error
        ((110, -20), (497, 0), 20, Reason.AIRSPACE),
        ((-200, 300), (200, 300), 20, Reason.AIRSPACE),  # both ends are outside the school, the leg is not
        ((-200, 190), (200, 190), 20, Reason.ADMITTED),  # passes it at 10 m
        ((600, 0), (110, 0), 20, Reason.AIRSPACE),  # starts outside
        ((0, 250), (110, 0), 20, Reason.AIRSPACE),  # starts over the school
    ],
)
def test_airspace_along_the_leg(start: Any, to: Any, altitude: int, reason: Reason) -> None:
    values = {POSITION_X: start[0] * M, POSITION_Y: start[1] * M}
    decision = ask(goto(to[0] * M, to[1] * M, altitude * M), values=values)
    assert decision.reason is reason
    assert decision.clause == (flat.POLICY.airspace if reason is Reason.AIRSPACE else None)


def test_airspace_between_the_present_height_and_the_planned_one() -> None:
    low_city = replace(flat.ZONES[0], ceiling=50 * M)
    policy = loaded(replace(flat.POLICY, zones=(low_city, *flat.ZONES[1:])))
    assert ask(goto(110 * M, 0, 30 * M), policy=policy).outcome is ALLOW
    assert ask(goto(110 * M, 0, 50 * M), policy=policy).reason is Reason.AIRSPACE  # the ceiling is outside
    assert ask(goto(110 * M, 0, 30 * M), values={HEIGHT: 60 * M}, policy=policy).reason is Reason.AIRSPACE


def test_fallback_stays_in_airspace_on_its_whole_path() -> None:
    """The school lies between here and home: both ends of the way are clear, but it is not flown."""
    policy, contract = with_contract(INSPECT, fallback=(flat.link(HOME), flat.link(LAND)))
    decision = ask(replace(STEP, contract=contract), values={POSITION_X: 0, POSITION_Y: 450 * M}, policy=policy)
    assert (decision.outcome, decision.link, decision.target) == (FALLBACK, 1, contract.fallback[1])


def test_missing_airspace_imposes_no_limit() -> None:
    policy = loaded(replace(flat.POLICY, airspace=None))
    assert ask(goto(600 * M, 300 * M), policy=policy).outcome is ALLOW


@rows(
    ("values", "reason", "clause_"),
    [
        ({POSITION_X: 89 * M}, Reason.ADMITTED, None),  # 15 m around the bridge, less the position error
        ({POSITION_X: 88 * M}, Reason.INVARIANT, flat.NEAR_AREA),
        ({HEIGHT: 25 * M}, Reason.ADMITTED, None),
        ({HEIGHT: 25 * M + 1}, Reason.INVARIANT, flat.NOT_HIGH),
        ({POSITION_X: None}, Reason.SAFETY_UNKNOWN, flat.POLICY.airspace),
        ({HEIGHT: None}, Reason.SAFETY_UNKNOWN, flat.POLICY.airspace),
        ({HEIGHT: None, POSITION_X: 600 * M}, Reason.AIRSPACE, flat.POLICY.airspace),  # whatever the height
        ({HEIGHT: None, POSITION_X: 480 * M}, Reason.INVARIANT, flat.NEAR_AREA),
        ({POSITION_X: None, HEIGHT: 130 * M}, Reason.AIRSPACE, flat.POLICY.airspace),  # wherever it is
        ({POSITION_X: None, HEIGHT: 26 * M}, Reason.INVARIANT, flat.NOT_HIGH),
        ({POSITION_X: None, BATTERY: 3_600}, Reason.SAFETY_UNKNOWN, flat.POLICY.airspace),
    ],
)
def test_maintain_over_the_planned_volume(values: dict[int, int | None], reason: Reason, clause_: Any) -> None:
    decision = ask(values=values)
    assert (decision.reason, decision.clause) == (reason, clause_)


def test_a_zone_without_a_band_needs_no_height() -> None:
    """Neither in a rule, nor for the airspace, nor for the way home."""
    zones = tuple(replace(zone, floor=LOWEST, ceiling=HIGHEST) for zone in flat.ZONES)
    forbid = flat.rule(RuleKind.FORBID, when=clause("position inside bridge_a", (Op.POSITION_IN, flat.BRIDGE, 0)))
    step, away = goto(150 * M, 0), {HEIGHT: None, POSITION_X: 0}
    open_to_the_sky = replace(flat.POLICY, zones=zones)
    assert ask(step, values=away, policy=loaded(open_to_the_sky)).reason is Reason.ADMITTED
    assert ask(step, values=away | {BATTERY: 1_499}, policy=loaded(open_to_the_sky)).reason is Reason.ENERGY
    forbidden = loaded(replace(open_to_the_sky, rules=(*flat.POLICY.rules, forbid)))
    assert ask(step, values=away, policy=forbidden).reason is Reason.ADMITTED
    assert ask(step, values={HEIGHT: None, POSITION_X: 150 * M}, policy=forbidden).outcome is DENY
    banded = loaded(replace(flat.POLICY, rules=(*flat.POLICY.rules, forbid)))
    assert ask(step, values={HEIGHT: None, POSITION_X: 150 * M}, policy=banded).reason is Reason.FORBID_UNKNOWN
    assert ask(step, values=away, policy=banded).reason is Reason.SAFETY_UNKNOWN


def test_maintain_along_the_whole_path() -> None:
    near = clause("position inside grow(bridge_a, 15 m)", (Op.POSITION_IN, flat.BRIDGE_GROWN, 0))
    policy, contract = with_contract(INSPECT, maintain=(*flat.CONTRACTS[INSPECT].maintain, near))
    over_city = replace(STEP, contract=contract, arguments=(flat.CITY, *STEP.arguments[1:]))
    policy = loaded(replace(policy.policy, rules=(flat.rule(RuleKind.PERMIT),)))
    for east, reason in ((200, Reason.ADMITTED), (300, Reason.INVARIANT)):
        path = (*flat.PATH[:2], east * M, 0)
        assert ask(replace(over_city, plan=replace(STEP.plan, path=path)), policy=policy).reason is reason


def test_a_negated_place_must_hold_everywhere_as_well() -> None:
    away = clause("not position inside school", (Op.POSITION_IN, flat.SCHOOL, 0, Op.NOT, 0, 0))
    reads = (WIND, flat.LINK, FIX)
    policy, contract = with_contract(GOTO, maintain=(away,), reads=(HEIGHT, *reads, POSITION_X, POSITION_Y))
    policy = loaded(replace(policy.policy, airspace=None))
    over = replace(goto(200 * M, 300 * M), contract=contract)
    values = {POSITION_X: -200 * M, POSITION_Y: 300 * M}
    assert ask(over, values=values, policy=policy).reason is Reason.INVARIANT
    assert ask(replace(goto(0, 0), contract=contract), values=values, policy=policy).outcome is ALLOW


# ------------------------------------------------------------------------------------------------------- energy


def test_charge_for_skill_return_and_reserve() -> None:
    """200 m + 1 m rounding at 12 m/s is 16.67 s of 18 min: 155; with 500 to finish and 1,000 in reserve 1,655."""
    step = goto(200 * M, 0)
    needed = 500 + 1_000 + 155
    assert ask(step, values={BATTERY: needed}).reason is Reason.DEGRADED  # the charge suffices, but is below 25 %
    decision = ask(step, values={BATTERY: needed - 1})
    assert (decision.outcome, decision.reason, decision.clause) == (FALLBACK, Reason.ENERGY, None)
    assert ask(step, values={BATTERY: None}).reason is Reason.SAFETY_UNKNOWN


def test_farthest_place_may_be_the_start() -> None:
    energy = Energy(flat.CONTRACTS[GOTO], flat.POLICY.vehicle)
    planner = Planner(MotionKind.FLY, (10 * M, 0), 20 * M, 0)
    known = WellKnown(0, 1, 2, 3)
    far = planner.volume([point(30 * M), point(40 * M), point(0)], known)
    near = planner.volume([point(3 * M), point(4 * M), point(0)], known)
    assert (far.farthest, near.farthest) == ((50 * M, 50 * M), (10 * M, 10 * M))
    assert energy.needed(50 * M) - energy.needed(10 * M) == 39 - 8


@pytest.mark.parametrize("skill", [HOME, LAND])
def test_landing_skill_needs_no_return_charge_or_reserve(skill: int) -> None:
    motion = flat.CONTRACTS[skill].motion
    step = flat.invocation(3, 2, skill, Plan(motion.kind, (0, 0) if skill == HOME else (), 0, 0))
    assert ask(step, values={BATTERY: 800}).reason is (Reason.ADMITTED if skill == HOME else Reason.DEGRADED)
    assert ask(step, values={BATTERY: 799, POSITION_X: 400 * M}).reason is (
        Reason.ENERGY if skill == HOME else Reason.DEGRADED
    )


ENERGY = Energy(flat.CONTRACTS[GOTO], flat.POLICY.vehicle)


def volume(near: int, far: int, gap: int = 0) -> Volume:
    return Volume(PlaceSet(UNKNOWN_VOLUME.place.parts, gap), MISSING, (near, far))


@rows(("drain", "least", "most"), [
    (MISSING, 0, 0),
    (point(1_760), 1_760, 1_760),
    (point(-5), 0, 0),
    (point(MOST_DRAIN + 1), MOST_DRAIN, MOST_DRAIN),
    (interval(600, 900), 600, 900),
    (maybe(interval(600, 900)), 0, 900),
])  # fmt: skip
def test_measured_drain_counts_if_known(drain: Any, least: int, most: int) -> None:
    assert drains(drain) == (least, most)


def test_way_home_uses_measured_drain_if_worse() -> None:
    """600 m at 12 m/s are 50 s: 463 of 18 min, 1,467 at 17.6 % a minute."""
    assert ENERGY.way_home(600 * M, (0, 0)) == ENERGY.way_home(600 * M, (0, 0), 555) == 463
    assert ENERGY.way_home(600 * M, (0, 0), 1_760) == 1_467


@rows(("battery", "drain", "truth"), [
    (point(500 + 1_000 + 463), MISSING, T),
    (point(500 + 1_000 + 463), point(1_760), F),
    (point(500 + 1_000 + 1_467), point(1_760), T),
    (point(500 + 1_000 + 1_466), point(1_760), F),
    (point(500 + 1_000 + 1_466), interval(100, 1_760), T | F),
    (point(500 + 1_000 + 1_466), maybe(point(1_760)), T | F),
    (point(500 + 1_000 + 462), maybe(point(1_760)), F),
])  # fmt: skip
def test_energy_over_sets_of_drains(battery: Any, drain: Any, truth: int) -> None:
    assert ENERGY.suffices(battery, volume(600 * M, 600 * M), drain) == truth


@rows(
    ("battery", "planned", "truth"),
    [
        (point(9_000), volume(0, 0), T),
        (point(1_500), volume(0, 0), T),
        (point(1_499), volume(0, 0), F),
        (interval(1_499, 1_500), volume(0, 0), T | F),
        (point(1_500), volume(0, 1), T | F),
        (point(1_501), volume(0, 1), T),
        (point(1_499), volume(0, 1), F),
        (MISSING, volume(0, 0), U),
        (maybe(point(9_000)), volume(0, 0), T | U),
        (point(9_000), volume(0, 0, 1), T | U),
        (point(9_000), UNKNOWN_VOLUME, U),
    ],
)
def test_energy_over_sets(battery: Any, planned: Volume, truth: int) -> None:
    assert ENERGY.suffices(battery, planned) == truth


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({}, Reason.SAFETY_UNKNOWN),
        ({HEIGHT: 31 * M}, Reason.INVARIANT),
        ({BATTERY: 1_499}, Reason.ENERGY),
        ({BATTERY: 2_499}, Reason.DEGRADED),
    ],
)
def test_false_condition_outweighs_earlier_unknown(values: dict[int, int], reason: Reason) -> None:
    low = clause("height <= 30 m", (Op.SIGNAL, HEIGHT, 0, Op.CONST, 30 * M, 0, Op.LE, 0, 0))
    reads = (HEIGHT, WIND, flat.LINK, FIX, OBSTACLE)
    policy, contract = with_contract(GOTO, maintain=(flat.FREE, low), reads=reads)
    step = replace(goto(110 * M, 0), contract=contract)
    assert ask(step, values={OBSTACLE: None, **values}, policy=policy).reason is reason


# ------------------------------------------------------------------------------------------------------- degrade


def test_degrade() -> None:
    assert ask(goto(110 * M, 0), values={BATTERY: 2_500}).outcome is ALLOW
    decision = ask(goto(110 * M, 0), values={BATTERY: 2_499})
    assert (decision.reason, decision.clause, decision.target) == (
        Reason.DEGRADED,
        flat.RULES[6],
        flat.RULES[6].target,
    )


# ------------------------------------------------------------------------------------------------ planned volume

KNOWN = WellKnown(0, 1, 2, 3)
START = [point(100), point(200), point(5_000), MISSING]
BOX = (-3, -3, 3, 3)


@rows(
    ("kind", "path", "altitude", "parts", "heights"),
    [
        (MotionKind.HOLD, (), None, [((100, 200), 5_000, 5_000)], (5_000, 5_000)),
        (MotionKind.CLIMB, (), 9_000, [((100, 200), 5_000, 9_000)], (5_000, 9_000)),
        (MotionKind.LAND, (), None, [((100, 200), 0, 5_000)], (0, 5_000)),
        (
            MotionKind.FLY,
            (7, 8),
            2_000,
            [((100, 200, 7, 8), 2_000, 5_000), ((7, 8), 2_000, 5_000)],
            (2_000, 5_000),
        ),
        (
            MotionKind.COVER,
            (7, 8, 9, 9),
            9_000,
            [((100, 200, 7, 8), 5_000, 9_000), ((7, 8, 9, 9), 5_000, 9_000)],
            (5_000, 9_000),
        ),
        (MotionKind.HOME, (), None, [((100, 200, 0, 0), 5_000, 5_000), ((0, 0), 0, 5_000)], (0, 5_000)),
        (
            MotionKind.HOME,
            (),
            9_000,
            [((100, 200), 5_000, 9_000), ((100, 200, 0, 0), 7_000, 9_000), ((0, 0), 0, 9_000)],
            (0, 9_000),
        ),
    ],
)
def test_planned_volume(kind: int, path: Any, altitude: int | None, parts: Any, heights: Any) -> None:
    found = Planner(kind, path, altitude, 3).volume(START, KNOWN)
    assert [(sweep.path, low, high) for sweep, low, high in found.place.parts] == parts
    assert {sweep.box for sweep, _, _ in found.place.parts} == {BOX}
    assert (found.height, found.place.located, found.place.high) == ((*heights, 0, None), 0, 0)


def test_landing_below_home_ends_at_vehicle_height() -> None:
    below = [point(0), point(0), point(-700), MISSING]
    assert Planner(MotionKind.LAND, (), None, 0).volume(below, KNOWN).height == point(-700)
    assert Planner(MotionKind.HOME, (), None, 0).volume(below, KNOWN).height == point(-700)


@pytest.mark.parametrize("slot", [0, 1, 2])
def test_missing_start_value_is_missing_in_volume(slot: int) -> None:
    planner = Planner(MotionKind.FLY, (7, 8), 2_000, 3)
    for gap, start in ((2, MISSING), (1, maybe(START[slot]))):
        found = planner.volume([start if n == slot else value for n, value in enumerate(START)], KNOWN)
        assert (found.place.located, found.place.high, found.height[2]) == ((0, gap, gap) if slot == 2 else (gap, 0, 0))


def test_from_a_set_of_starts_the_leg_covers_every_leg() -> None:
    starts = [interval(100, 300), interval(-50, 50), interval(1_000, 5_000), MISSING]
    found = Planner(MotionKind.FLY, (0, 0), 2_000, 3).volume(starts, KNOWN)
    (leg, low, high), _ = found.place.parts
    assert (leg.path, leg.box, low, high) == ((100, -50, 0, 0), (-3, -3, 203, 103), 1_000, 5_000)
    assert found.farthest == (100, 305)


def test_last_start_is_cached_across_height_changes() -> None:
    planner = Planner(MotionKind.FLY, (7, 8), 2_000, 3)
    first = planner.volume(START, KNOWN)
    assert planner.volume(list(START), KNOWN) is first
    higher = planner.volume([*START[:2], point(6_000), MISSING], KNOWN)
    assert higher is not first
    assert higher.place.parts[0][0] is first.place.parts[0][0]
    moved = planner.volume([point(101), *START[1:]], KNOWN)
    assert moved.place.parts[0][0] is not first.place.parts[0][0]
    assert moved.place.parts[1][0] is first.place.parts[1][0]


def test_floor_of_zero_forbids_takeoff() -> None:
    takeoff, on_ground = flat.INVOCATIONS[0], {HEIGHT: 0, POSITION_X: 0, POSITION_Y: 0}
    assert ask(takeoff, values=on_ground).outcome is ALLOW
    floored = replace(flat.ZONES[0], floor=0)
    policy = loaded(replace(flat.POLICY, zones=(floored, *flat.ZONES[1:])))
    assert ask(takeoff, values=on_ground, policy=policy).reason is Reason.AIRSPACE
    assert flat.ZONES[0].floor == LOWEST


def test_place_condition_without_position_defers() -> None:
    contracts = tuple(replace(c, reads=tuple(s for s in c.reads if s not in (5, 6))) for c in flat.CONTRACTS)
    policy = loaded(replace(flat.POLICY, vehicle=replace(flat.POLICY.vehicle, position=-1), contracts=contracts))
    takeoff = replace(flat.INVOCATIONS[0], contract=contracts[TAKEOFF])
    assert ask(takeoff, policy=policy).reason is Reason.SAFETY_UNKNOWN
    inspect = replace(STEP, contract=contracts[INSPECT])
    assert ask(inspect, values={OBSTACLE: 1 * M}, policy=policy).reason is Reason.STATE_VIOLATED


def test_an_airspace_of_several_zones() -> None:
    both = Airspace((flat.CITY, flat.BRIDGE_GROWN), (flat.SCHOOL, flat.SCHOOL_GROWN), "", 0, 0, 1)
    policy = loaded(replace(flat.POLICY, airspace=both))
    assert ask(policy=policy).outcome is ALLOW
    assert ask(goto(300 * M, 0), policy=policy).reason is Reason.AIRSPACE


def test_motion_without_an_altitude_of_its_own_stays_at_the_present_height() -> None:
    hover = flat.invocation(3, 1, flat.HOVER, Plan(MotionKind.HOLD, (), 0, 0))
    for floor, reason in ((10 * M, Reason.ADMITTED), (30 * M, Reason.AIRSPACE)):
        policy = loaded(replace(flat.POLICY, zones=(replace(flat.ZONES[0], floor=floor), *flat.ZONES[1:])))
        assert ask(hover, policy=policy).reason is reason
