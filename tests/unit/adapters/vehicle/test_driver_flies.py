"""Each kind of motion, on both autopilots, ends only by its observed effect."""

from collections.abc import Callable
from typing import Any

import pytest

from rtshcua.model.faults import FlightMode
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import AirState, Crashed, Ready, Sent, Succeeded
from virtual.policy import WIND

Make = Callable[..., Any]


def test_is_ready_once_its_streams_run(flyer: Make) -> None:
    one = flyer()
    one.until(Ready, 6)
    assert one.vehicle.driver.unready is None
    readings = {slot for event in one.events if hasattr(event, "values") for slot, _ in event.values}
    assert readings | {WIND} == set(range(7)), "the wind is not waited for: it is known in the air"


def test_climbs_and_says_so(aloft: Make) -> None:
    one = aloft(20_000)
    assert abs(one.truth.up_mm - 20_000) < 1_500
    states = [(event.armed, event.airborne) for event in one.events if isinstance(event, AirState)]
    assert states[0] == (False, False)
    assert states[-1] == (True, True)
    assert [event.token for event in one.events if isinstance(event, Sent)] == [1]


def test_flies_to_a_point_at_its_speed(aloft: Make) -> None:
    one = aloft()
    one.begin(MotionKind.FLY, (30_000, 40_000), altitude=25_000, speed=3_000)
    fastest = 0
    while not any(isinstance(event, Succeeded) and event.token == 2 for event in one.events):
        one.wait(0.5)
        fastest = max(fastest, one.truth.speed_mm_s)
    assert abs(one.truth.east_mm - 30_000) < 2_500
    assert abs(one.truth.north_mm - 40_000) < 2_500
    assert abs(one.truth.up_mm - 25_000) < 2_000
    assert 2_500 < fastest < 3_500


def test_covers_a_path_point_by_point(aloft: Make) -> None:
    one = aloft()
    path = [(0, 40_000), (30_000, 40_000), (30_000, 10_000)]
    one.begin(MotionKind.COVER, *path, altitude=20_000, speed=5_000)
    near = set()
    while not any(isinstance(event, Succeeded) and event.token == 2 for event in one.events):
        one.wait(0.2)
        near |= {n for n, (x, y) in enumerate(path) if abs(one.truth.east_mm - x) + abs(one.truth.north_mm - y) < 4_000}
    assert near == {0, 1, 2}


def test_holds_for_its_time_and_no_longer(aloft: Make) -> None:
    one = aloft()
    one.begin(MotionKind.FLY, (200_000, 0), altitude=20_000, speed=8_000)
    one.wait(8)
    begun = one.now_us
    assert isinstance(one.fly(MotionKind.HOLD, hold_us=6_000_000), Succeeded)
    assert 6 <= (one.now_us - begun) / 1e6 < 12
    here = one.truth
    assert here.speed_mm_s < 700
    assert here.east_mm < 100_000


def test_holds_on_without_a_time(aloft: Make) -> None:
    one = aloft()
    one.begin(MotionKind.HOLD)
    assert not any(isinstance(event, Succeeded) for event in one.wait(12))


def rests(one: Any) -> bool:
    """Whether the vehicle landed without a crash."""
    one.wait(10)
    return not one.truth.armed and not any(isinstance(event, Crashed) for event in one.events)


def test_comes_home_and_lands_there(aloft: Make) -> None:
    one = aloft()
    assert isinstance(one.fly(MotionKind.FLY, (25_000, 0), altitude=20_000, speed=8_000), Succeeded)
    assert isinstance(one.fly(MotionKind.HOME), Succeeded)
    assert rests(one)
    assert abs(one.truth.east_mm) < 2_000


def test_lands_where_it_is(aloft: Make) -> None:
    one = aloft()
    assert isinstance(one.fly(MotionKind.FLY, (25_000, 0), altitude=20_000, speed=8_000), Succeeded)
    assert isinstance(one.fly(MotionKind.LAND), Succeeded)
    assert rests(one)
    assert abs(one.truth.east_mm - 25_000) < 4_000


def test_landing_what_stands_already_is_done_at_once(flyer: Make) -> None:
    one = flyer()
    one.until(Ready)
    for kind in (MotionKind.LAND, MotionKind.HOME):
        begun = one.now_us
        assert isinstance(one.fly(kind), Succeeded)
        assert one.now_us - begun < 1_000_000


@pytest.mark.slow
def test_one_command_replaces_another_without_a_false_take_over(aloft: Make) -> None:
    """The heartbeat reports modes with a delay, so the mode of a replaced command may still arrive."""
    one = aloft()
    one.begin(MotionKind.FLY, (100_000, 0), altitude=20_000, speed=5_000)
    one.wait(4)
    for kind in (MotionKind.HOLD, MotionKind.LAND, MotionKind.HOLD):
        one.begin(kind)
        one.wait(0.06)
    assert isinstance(one.fly(MotionKind.HOME), Succeeded)
    assert one.vehicle.simulation.truth().mode in (FlightMode.LOITER, FlightMode.RETURN)
    assert abs(one.truth.east_mm) < 2_000
