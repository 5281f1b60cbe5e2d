"""The predicted path: against a vehicle that flies on and brakes point by point, and by hand."""

from collections.abc import Iterator
from math import ceil, hypot, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from reference import flat_case as flat
from reference.asking import STEP, loaded, ready
from reference.flat_case import HEIGHT, NOW, POSITION_X, POSITION_Y, M, S
from rtshcua.decision.prepare import PreparedPolicy, prepare
from rtshcua.decision.running_conditions import UNKNOWN_AHEAD, WAY_HOME, ahead, holding, watch
from rtshcua.decision.situation import situation
from rtshcua.decision.values import FALSE, MISSING, UNKNOWN
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.limits import MAX_SPEED
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.signal import NUMBER, Signal
from rtshcua.model.flat.situation import State
from virtual.rows import rows

NORTH, EAST, DOWN = (flat.SLOTS + number for number in range(3))
STALE = 2 * S
AIRSPACE = "airspace inside city outside school"
VELOCITY = tuple(
    Signal(f"velocity.{name}", slot, NUMBER, "speed", STALE, (), ())
    for name, slot in (("north", NORTH), ("east", EAST), ("down", DOWN))
)


def braking(deceleration: int, reaction_us: int, **more: int) -> Policy:
    """The reference policy with a vehicle that declares its braking."""
    vehicle = replace(
        flat.POLICY.vehicle, braking=deceleration, reaction_us=reaction_us, north=NORTH, east=EAST, down=DOWN, **more
    )
    signals = tuple(replace(signal, stale_us=STALE) for signal in flat.SIGNALS)
    return replace(flat.POLICY, vehicle=vehicle, signals=(*signals, *VELOCITY), slots=flat.SLOTS + 3)


def moving(
    place: tuple[int, int, int], velocity: tuple[int | None, int | None, int | None], age_us: int = 0, **values: int
) -> State:
    """The state of a vehicle at (east, north, height) with a velocity (east, north, up)."""
    x, y, height = place
    east, north, up = velocity
    known = flat.NOMINAL | {POSITION_X: x, POSITION_Y: y, HEIGHT: height}
    down = None if up is None else -up
    return State((*(known[slot] for slot in range(flat.SLOTS)), north, east, down), (age_us,) * (flat.SLOTS + 3))


# --------------------------------------------------------------------------------------------------- the oracle

Point = tuple[float, float, float]


def flown(place: Point, velocity: Point, goes_s: float, deceleration: float) -> Iterator[Point]:
    """The position every 10 ms: first it flies on, then it loses `deceleration` of its speed, and then it stands."""
    step_s, (x, y, z), (vx, vy, vz) = 0.01, place, velocity
    yield (x, y, z)
    while goes_s > 0:
        took_s = min(step_s, goes_s)
        x, y, z = x + vx * took_s, y + vy * took_s, z + vz * took_s
        goes_s -= took_s
        yield (x, y, z)
    speed = sqrt(vx * vx + vy * vy + vz * vz)
    while speed > 0:
        took_s = min(step_s, speed / deceleration)
        slower = max(speed - deceleration * took_s, 0.0) if took_s == step_s else 0.0
        share = (speed + slower) / 2 * took_s / sqrt(vx * vx + vy * vy + vz * vz)
        x, y, z = x + vx * share, y + vy * share, z + vz * share
        speed = slower
        yield (x, y, z)


def margin(point: Point, error: float) -> float:
    """The depth of a place within the airspace of the reference policy, including its position error, in mm."""
    x, y, z = point
    across = min(500 * M - error - abs(x), 500 * M - error - abs(y))
    nearest = hypot(max(abs(x) - error, 0), max(abs(y - 300 * M) - error, 0))
    return min(across, 120 * M - z, nearest - 100 * M)


SPEEDS = st.integers(-15 * M, 15 * M)
PLACES = st.tuples(st.integers(-520 * M, 520 * M), st.integers(-520 * M, 520 * M), st.integers(1 * M, 125 * M))
NEAR_EDGES = st.tuples(
    st.sampled_from([460 * M, 480 * M, -470 * M, 0]), st.sampled_from([180 * M, 190 * M, 420 * M]),
    st.sampled_from([20 * M, 100 * M, 115 * M]),
)  # fmt: skip


@given(
    place=PLACES | NEAR_EDGES,
    velocity=st.tuples(SPEEDS, SPEEDS, st.integers(-5 * M, 5 * M)) | st.just((0, 0, 0)),
    deceleration=st.integers(500, 6_000),
    reaction_us=st.integers(0, 2 * S),
    age_us=st.integers(0, STALE),
)
def test_the_path_holds_every_place_of_a_vehicle_that_brakes(
    place: tuple[int, int, int], velocity: tuple[int, int, int], deceleration: int, reaction_us: int, age_us: int
) -> None:
    policy = loaded(braking(deceleration, reaction_us))
    state = moving(place, velocity, age_us)
    slots = [*situation(state, policy, NOW).values, MISSING]
    volume, lasts_us = ahead(slots, state.ages, policy)
    ((sweep, low, high),) = volume.place.parts
    x0, y0, x1, y1 = sweep.path
    error, reach = policy.policy.vehicle.position_error, sweep.box[2]
    assert sweep.box == (-reach, -reach, reach, reach)
    goes_s = (reaction_us + age_us) / 1e6
    points = list(flown(place, velocity, goes_s, deceleration))
    for x, y, z in points:
        assert low - 1e-3 <= z <= high + 1e-3
        length = hypot(x1 - x0, y1 - y0)
        along = 0.0 if not length else ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / (length * length)
        along = min(max(along, 0.0), 1.0)
        nearest = (x0 + along * (x1 - x0), y0 + along * (y1 - y0))
        assert max(abs(x - nearest[0]), abs(y - nearest[1])) + error <= reach + 1e-3
    x, y, z = points[-1]
    assert hypot(x - x1, y - y1) < 30  # rounded away from the vehicle by no more than that, the speed to 1 mm/s
    assert abs(z - (high if velocity[2] > 0 else low)) < 30
    assert volume.farthest[1] == max(ceil(hypot(x0, y0)), ceil(hypot(x1, y1)))
    speed = sqrt(sum(part * part for part in velocity))
    assert abs(lasts_us - (reaction_us + speed / deceleration * 1e6)) <= 2_100  # the speed is rounded up to 1 mm/s

    worst = min(margin(point, error) for point in points)
    found = dict(watch(ready(STEP, policy), state, policy, NOW))
    if worst < -1:
        assert found.get(AIRSPACE) == FALSE
    if (
        worst > error + 200
    ):  # a circle is kept clear of by the error's corners; between two points it flies 0.2 m at most
        assert AIRSPACE not in found
    assert dict(holding(ready(STEP, policy), state, policy, NOW)).get(AIRSPACE) == found.get(AIRSPACE)


# ------------------------------------------------------------------------------------------------------ by hand

#: at 8 m/s: 4 m in its reaction, 16 m while it brakes
POLICY = loaded(braking(2_000, 500_000, position_error=0))


def unkept(state: State, policy: PreparedPolicy = POLICY) -> list[tuple[str, int]]:
    return [(text, truth) for text, truth in watch(ready(STEP, policy), state, policy, NOW) if "area" not in text]


@rows(
    ("east", "speed", "age_us", "breaks"),
    [
        (480 * M - 2, 8 * M, 0, False),  # it stands 2 mm before the border; 1 mm is for rounding
        (480 * M, 8 * M, 0, True),
        (480 * M, -8 * M, 0, False),  # it flies away from it
        (499 * M, 0, 0, False),
        (479 * M, 8 * M, 125_000, True),  # and 1 m since it was measured
        (478 * M, 8 * M, 125_000, False),
    ],
)
def test_border_is_checked_at_the_stopping_point(east: int, speed: int, age_us: int, breaks: bool) -> None:
    found = unkept(moving((east, 0, 20 * M), (speed, 0, 0), age_us))
    assert found == ([(AIRSPACE, FALSE)] if breaks else [])


def test_a_climb_is_stopped_before_the_height_that_must_be_kept() -> None:
    above = "height <= altitude + 5 m"  # 25 m; at 3 m/s: 1.5 m in its reaction, 2.25 m while it brakes
    assert unkept(moving((110 * M, -20 * M, 21_250), (0, 0, 3 * M))) == []
    assert unkept(moving((110 * M, -20 * M, 21_251), (0, 0, 3 * M))) == [(above, FALSE)]
    assert unkept(moving((110 * M, -20 * M, 24_999), (0, 0, -3 * M))) == []


def test_way_home_starts_at_the_stopping_point() -> None:
    """100 m at 12 m/s are 77.2 of 10000, 120 m are 92.6; the reserve is 1000."""
    still, outward = moving((0, -100 * M, 20 * M), (0, 0, 0)), moving((0, -100 * M, 20 * M), (0, -8 * M, 0))
    for state, enough in ((still, 1_078), (outward, 1_093)):
        for charge, kept in ((enough, True), (enough - 1, False)):
            held = State((charge, *state.values[1:]), state.ages)
            assert ((WAY_HOME, FALSE) not in holding(ready(STEP, POLICY), held, POLICY, NOW)) is kept


@pytest.mark.parametrize("slot", [POSITION_X, NORTH, EAST, DOWN])
def test_stopping_point_is_unknown_without_a_signal(slot: int) -> None:
    state = moving((0, 0, 20 * M), (1 * M, 0, 0))
    values = tuple(None if number == slot else value for number, value in enumerate(state.values))
    found = unkept(State(values, state.ages))
    assert (AIRSPACE, UNKNOWN) in found
    assert (WAY_HOME, UNKNOWN) in found


@pytest.mark.parametrize(("x", "airspace"), [(0, UNKNOWN), (499 * M, FALSE)])
def test_stopping_point_over_ground_is_known_without_height(x: int, airspace: int) -> None:
    """At any age: the age of a missing height has no meaning."""
    state = moving((x, 0, 20 * M), (12 * M, 0, 0))
    values = tuple(None if number == HEIGHT else value for number, value in enumerate(state.values))
    for age in (0, 4 * STALE):
        ages = tuple(age if number == HEIGHT else value for number, value in enumerate(state.ages))
        assert [each for each in unkept(State(values, ages)) if each[0] in (AIRSPACE, WAY_HOME)] == [
            (AIRSPACE, airspace)
        ]


def test_speed_out_of_range_is_unknown() -> None:
    state = moving((0, 0, 20 * M), (MAX_SPEED, 1, 0))
    slots = [*situation(state, POLICY, NOW).values, MISSING]
    assert ahead(slots, state.ages, POLICY) is UNKNOWN_AHEAD


def test_stopping_point_without_braking_is_the_measured_position() -> None:
    policy = loaded(replace(braking(0, 0), vehicle=replace(flat.POLICY.vehicle, position_error=0)))
    assert unkept(moving((499 * M, 0, 20 * M), (12 * M, 0, 0)), policy) == []
    assert unkept(moving((499 * M, 0, 20 * M), (None, None, None)), policy) == []


@rows(
    ("fields", "problem"),
    [
        ({"braking": -1}, "vehicle: braking"),
        ({"braking": MAX_SPEED + 1}, "vehicle: braking"),
        ({"reaction_us": -1}, "vehicle: reaction"),
        ({"north": -1}, "vehicle: braking is declared without a velocity signal"),
        ({"down": POSITION_X}, "vehicle: slot"),
        ({"east": 99}, "vehicle: slot"),
    ],
)
def test_malformed_vehicle_is_refused(fields: dict[str, int], problem: str) -> None:
    policy = braking(2_000, 0)
    found = prepare(replace(policy, vehicle=replace(policy.vehicle, **fields)))
    assert isinstance(found, Refusal)
    assert found.text.startswith(problem)
