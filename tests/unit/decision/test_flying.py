"""Durations by declared speeds, and the resulting charge for the way home."""

from math import sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from reference import flat_case as flat
from reference.asking import STEP, ready
from reference.flat_case import M, S
from rtshcua.decision.contracts import Energy
from rtshcua.decision.flying import charge, home_us, landing_us, leg_us, over_ground, rising_us, sinking_us
from rtshcua.decision.prepare import PreparedPolicy, prepare
from rtshcua.decision.running_conditions import WAY_HOME, holding
from rtshcua.decision.values import FALSE, MISSING, TRUE, UNKNOWN, Value, interval, maybe, point
from rtshcua.decision.volume import UNKNOWN_VOLUME, Volume
from rtshcua.decision.zones import PlaceSet
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.limits import FULL
from rtshcua.model.flat.policy import Speeds
from virtual.rows import rows

SPEEDS = Speeds(
    cruise=5 * M, climb=2 * M, descent=1 * M, landing=500, landing_below=10 * M, homeward=5 * M,
    acceleration=1 * M, air=12 * M, wind=8 * M, flight_us=1_000 * S,
)  # fmt: skip
VEHICLE = replace(flat.POLICY.vehicle, speeds=SPEEDS, home_within=0, return_altitude=30 * M)


@given(distance=st.integers(0, 10_000 * M), speed=st.integers(100, 20 * M), acceleration=st.integers(100, 10 * M))
def test_a_leg_is_sped_up_flown_and_slowed_down(distance: int, speed: int, acceleration: int) -> None:
    """The textbook formula in floats: speed over time is a trapezoid or a triangle."""
    v, a, d = float(speed), float(acceleration), float(distance)
    seconds = d / v + v / a if d >= v * v / a else 2 * sqrt(d / a)
    found = leg_us(replace(SPEEDS, acceleration=acceleration), distance, speed)
    assert seconds * S - 1 <= found <= seconds * S + 3


def test_up_and_down() -> None:
    assert rising_us(SPEEDS, 20 * M) == 12 * S  # 10 s, and 2 s to come to speed and to stop
    assert sinking_us(SPEEDS, 20 * M) == 21 * S
    assert rising_us(SPEEDS, 0) == sinking_us(SPEEDS, -1) == 0
    assert landing_us(SPEEDS, 30 * M) == (21 + 20 + 8) * S
    assert landing_us(SPEEDS, 5 * M) == (10 + 8) * S
    assert landing_us(SPEEDS, -1) == 8 * S


@rows(("asked", "wind", "sure"), [(3 * M, None, 3 * M), (6 * M, None, 4 * M), (6 * M, 0, 6 * M), (6 * M, 20 * M, 1)])
def test_wind_takes_what_the_speed_through_the_air_does_not_leave(asked: int, wind: int | None, sure: int) -> None:
    assert over_ground(SPEEDS, asked, wind) == sure


def test_the_way_home_climbs_crosses_and_comes_down() -> None:
    """100 m at 4 m/s against the wind."""
    crosses = 25 + 4
    around = 1 + 4 + 5  # command, arrival, hovering over home
    assert home_us(VEHICLE, SPEEDS, 100 * M, (10 * M, 20 * M)) == (around + 12 + crosses + 21 + 20 + 8) * S
    assert home_us(VEHICLE, SPEEDS, 100 * M, (40 * M, 40 * M)) == (around + crosses + 31 + 20 + 8) * S
    slow = home_us(VEHICLE, SPEEDS, 100 * M, (40 * M, 40 * M), 2 * M)
    assert slow == (around + 50 + 2 + 31 + 20 + 8) * S
    assert charge(SPEEDS, 94 * S) == 940
    assert charge(SPEEDS, 94 * S + 1) == 941


GOTO = flat.CONTRACTS[1]
ENERGY = Energy(flat.CONTRACTS[STEP.skill], VEHICLE)
MOST = ENERGY.needed(100 * M, (0, 20 * M))


def volume(near: int, far: int, height: Value, gap: int = 0) -> Volume:
    return Volume(PlaceSet(UNKNOWN_VOLUME.place.parts, gap), height, (near, far))


LEVEL = interval(0, 20 * M)


@rows(
    ("battery", "planned", "truth"),
    [
        (point(MOST), volume(100 * M, 100 * M, LEVEL), TRUE),
        (point(MOST - 1), volume(100 * M, 100 * M, LEVEL), TRUE | FALSE),  # the largest height
        (point(MOST - 1), volume(100 * M, 100 * M, point(0)), FALSE),
        (point(0), volume(100 * M, 100 * M, LEVEL), FALSE),
        (point(0), volume(0, 100 * M, LEVEL), FALSE),
        (point(FULL), volume(100 * M, 100 * M, MISSING), UNKNOWN),
        (point(FULL), volume(100 * M, 100 * M, maybe(LEVEL)), TRUE | UNKNOWN),
    ],
)
def test_energy_by_speeds_over_sets(battery: Value, planned: Volume, truth: int) -> None:
    assert ENERGY.suffices(battery, planned) == truth


def loaded() -> PreparedPolicy:
    prepared = prepare(replace(flat.POLICY, vehicle=VEHICLE))
    assert not isinstance(prepared, Refusal)
    return prepared


@pytest.mark.parametrize("height", [20 * M, None])
def test_without_a_height_the_way_home_is_not_known(height: int | None) -> None:
    state = flat.state({flat.BATTERY: FULL, flat.HEIGHT: height})
    policy = loaded()
    unkept = dict(holding(ready(STEP, policy), state, policy, flat.NOW))
    assert unkept.get(WAY_HOME) == (None if height else UNKNOWN)


@rows("change", [{"cruise": 0}, {"wind": -1}, {"landing_below": -1}, {"flight_us": 0}, {"air": 0}])
def test_invalid_speeds_are_refused(change: dict[str, int]) -> None:
    vehicle = replace(VEHICLE, speeds=replace(SPEEDS, **change))
    assert isinstance(prepare(replace(flat.POLICY, vehicle=vehicle)), Refusal)
