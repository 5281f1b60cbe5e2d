"""The true state for the judge, and the frames that reached the vehicle."""

from collections.abc import Callable
from math import hypot
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.model import faults
from rtshcua.model.faults import FlightMode
from rtshcua.simulation.autopilot import Taker
from rtshcua.simulation.surroundings import Wind

S = 1_000_000


def on_its_way(pilot: Callable[..., Any], flavour: str, **config: Any) -> Any:
    p = pilot(flavour, noise=False, **config)
    p.take_off(20)
    p.go_to(300, 0, 20)
    p.wait(5)
    return p


def taken(p: Any, kind: Callable[..., faults.Fault], *args: Any) -> tuple[int | None, Taker | None]:
    p.simulation.inject(kind(p.simulation.now_us, *args))
    p.wait(0.5)
    return p.truth.taken_over_us, p.truth.taken_over_by


@pytest.mark.parametrize(
    ("kind", "args"),
    [
        (faults.PilotMode, (FlightMode.LAND,)),
        (faults.PilotPause, ()),
        (faults.PilotGoto, (0, 90_000, 20_000)),
        (faults.Kill, ()),
    ],
)
def test_pilot_takeover_is_recorded(
    kind: Callable[..., faults.Fault], args: tuple[Any, ...], pilot: Callable[..., Any], flavour: str
) -> None:
    p = on_its_way(pilot, flavour)
    assert p.truth.taken_over_us is None
    before_us = p.simulation.now_us
    assert taken(p, kind, *args) == (before_us + 20_000, Taker.PILOT)


def test_pilot_action_without_effect_is_not_a_takeover(pilot: Callable[..., Any], flavour: str) -> None:
    p = on_its_way(pilot, flavour)
    kind, args = (faults.PilotMode, (FlightMode.LOITER,)) if p.px4 else (faults.PilotSticks, (S,))
    assert taken(p, kind, *args) == (None, None)


def test_switch_to_an_unavailable_mode_is_refused(pilot: Callable[..., Any]) -> None:
    """`UserModeIntention::change` of PX4: Offboard without targets is refused."""
    p = on_its_way(pilot, "px4")
    assert taken(p, faults.PilotMode, FlightMode.GUIDED) == (None, None)
    assert p.truth.mode is FlightMode.LOITER


def test_px4_falls_back_to_altitude_without_a_position(pilot: Callable[..., Any], flavour: str) -> None:
    p = on_its_way(pilot, flavour)
    p.simulation.inject(faults.EstimatorUnhealthy(p.simulation.now_us))
    p.wait(2)
    before = p.truth.mode
    p.simulation.inject(faults.PilotMode(p.simulation.now_us, FlightMode.POSITION))
    p.wait(0.1)
    assert p.truth.mode is (FlightMode.ALTITUDE if p.px4 else before)


def test_sticks_take_over_px4(pilot: Callable[..., Any]) -> None:
    assert taken(on_its_way(pilot, "px4"), faults.PilotSticks)[1] is Taker.PILOT


def test_no_takeover_on_the_ground(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour).ready()
    assert taken(p, faults.PilotMode, FlightMode.ALTITUDE) == (None, None)


def test_own_commands_are_not_takeovers(pilot: Callable[..., Any], flavour: str) -> None:
    p = on_its_way(pilot, flavour)
    p.mode(FlightMode.LAND)
    p.until(lambda: not p.truth.armed)
    assert p.truth.taken_over_us is None


def test_first_failsafe_takeover_counts(pilot: Callable[..., Any], flavour: str) -> None:
    p = on_its_way(pilot, flavour)
    first = taken(p, faults.BatteryLevel, 300)
    assert first[1] is Taker.FAILSAFE
    assert taken(p, faults.PilotMode, FlightMode.ALTITUDE) == first


def test_fence_breach_is_a_takeover(pilot: Callable[..., Any]) -> None:
    p = on_its_way(pilot, "ardupilot")
    for name, value in ((b"FENCE_RADIUS", 30), (b"FENCE_ENABLE", 1)):
        p.send(mavlink.MAVLink_param_set_message(1, 1, name, value, 9))
    p.until(lambda: p.truth.mode is FlightMode.RETURN, 30)
    assert p.truth.taken_over_by is Taker.FAILSAFE


def test_truth_has_the_current_wind(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour, wind=Wind(8_000, 270, 0))
    p.wait(1)
    assert (p.truth.wind_north_mm_s, p.truth.wind_east_mm_s) == (0, 8_000)
    gusty = pilot(flavour, wind=Wind(8_000, 270, 3_000))
    gusty.wait(5)
    assert hypot(gusty.truth.wind_north_mm_s, gusty.truth.wind_east_mm_s - 8_000) > 100


def test_callback_receives_each_frame(pilot: Callable[..., Any], flavour: str) -> None:
    p, heard = pilot(flavour), list[tuple[int, bytes]]()
    p.wait(1)
    p.simulation.heard = lambda at_us, frame: heard.append((at_us, frame))
    now_us = p.simulation.now_us
    p.long(511, 33, 100_000)
    p.long(511, 33, 100_000, system=9)
    assert heard == [(now_us, p.sent[-2]), (now_us, p.sent[-1])], "those for others as well"
    p.simulation.receive(b"no frame", now_us)
    p.simulation.inject(faults.LinkDelay(now_us, 300_000, None, faults.Direction.UP))
    p.wait(0.1)
    p.long(512, 0)
    p.wait(0.28)
    assert len(heard) == 2
    p.wait(0.04)
    assert heard[2:] == [(now_us + 400_000, p.sent[-1])]
    p.simulation.inject(faults.LinkLoss(p.simulation.now_us, 10_000))
    p.wait(0.1)
    p.long(512, 0)
    p.wait(1)
    assert len(heard) == 3, "what is lost did not come"


def test_vehicle_overshoots_a_target_and_comes_back(pilot: Callable[..., Any], flavour: str) -> None:
    """Recorded: PX4 0.6 to 1.4 m, from 4 to 6 m/s; ArduCopter 0.1 to 1 m, from 4 to 9 m/s."""
    p = pilot(flavour, noise=False, cruise_mm_s=5_000 if flavour == "px4" else 7_700)
    p.take_off(20)
    p.go_to(60, 0, 20)
    furthest = 0
    for _ in range(400):
        p.wait(0.1)
        furthest = max(furthest, p.truth.north_mm)
    assert 60_600 < furthest < 61_400 if p.px4 else 60_300 < furthest < 61_000
    assert abs(p.truth.north_mm - 60_000) < 100
    p.go_to(60, 0, 20)
    p.wait(5)
    assert abs(p.truth.north_mm - 60_000) < 100, "the same target again is none"
