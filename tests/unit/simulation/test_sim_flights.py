"""Whole flights in virtual time, both flavours: take off, go somewhere, come home, land, disarm."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from rtshcua.model.faults import FlightMode
from rtshcua.simulation.config import SimulationConfig
from rtshcua.simulation.surroundings import Wind
from virtual.sampling import each_once

#: s: the least and the greatest overshoot, divided by the speed of the leg. Recorded: 0.13 to 0.28 (PX4), 0.09 to 0.15
#: (ArduCopter); simulated: up to 0.18 and 0.09, minus the noise
OVERSHOOT_S = {"px4": (0.15, 0.19), "ardupilot": (0.07, 0.1)}


@pytest.mark.parametrize(
    ("flavour", "there", "cruise_mm_s"),
    [
        ("px4", (100, 0, 20), 5_000),
        ("ardupilot", (-150, 200, 40), 12_000),
        pytest.param("px4", (0, -300, 12), 8_000, marks=pytest.mark.soak),
        pytest.param("ardupilot", (100, 0, 20), 5_000, marks=pytest.mark.soak),
        pytest.param("px4", (-150, 200, 40), 12_000, marks=pytest.mark.soak),
        pytest.param("ardupilot", (0, -300, 12), 8_000, marks=pytest.mark.soak),
    ],
)
def test_flight_to_a_target_and_home(
    pilot: Callable[..., Any], flavour: str, there: tuple[float, float, float], cruise_mm_s: int
) -> None:
    north_m, east_m, up_m = there
    p = pilot(flavour, cruise_mm_s=cruise_mm_s, wind=Wind(4_000, 300, 1_000))
    p.take_off(20)
    assert p.truth.in_air
    p.go_to(north_m, east_m, up_m)
    fastest, away = 0, []
    for _ in range(600):
        p.wait(0.1)
        t = p.truth
        fastest = max(fastest, t.speed_mm_s)
        away.append(((t.north_mm - north_m * 1000) ** 2 + (t.east_mm - east_m * 1000) ** 2) ** 0.5)
    assert cruise_mm_s * 0.95 < fastest < cruise_mm_s * 1.1
    assert away[-1] < 200
    arrived = next(i for i, distance in enumerate(away) if distance < 200)
    least, most = OVERSHOOT_S[flavour]
    assert least < max(away[arrived:]) / cruise_mm_s < most, "it overshoots less or more than recorded"
    furthest = away.index(max(away[arrived:]), arrived)
    there_and_back = pairwise(away[: arrived + 1]), pairwise(away[furthest:])
    assert all(later < earlier + 150 for way in there_and_back for earlier, later in way), "it strays or oscillates"
    assert abs(p.truth.up_mm - up_m * 1000) < 200
    assert p.truth.speed_mm_s < 100

    assert p.mode(FlightMode.RETURN)[-1] == 0
    p.until(lambda: not p.truth.armed)
    t = p.truth
    assert (abs(t.north_mm) < 700, abs(t.east_mm) < 700, t.up_mm) == (True, True, 0)
    p.wait(1)
    assert p.last("HEARTBEAT").base_mode & 128 == 0


def test_landing_speed_follows_the_configuration(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour, land_mm_s=1_200)
    p.take_off(8)
    p.mode(FlightMode.LAND)
    p.until(lambda: p.truth.up_mm < 2_000)
    assert -1_300 < p.truth.climb_mm_s < -1_100
    p.until(lambda: not p.truth.armed)
    assert not p.truth.crashed
    for wrong in (99, 2_001):
        with pytest.raises(ValueError, match="landing speed must be from 100 to 2000 mm/s"):
            SimulationConfig(land_mm_s=wrong)


def test_return_begins_with_a_climb(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour)
    p.take_off(10)
    p.go_to(60, 0, 8)
    p.wait(20)
    p.mode(FlightMode.RETURN)
    highest = 0
    while p.truth.north_mm > 55_000:
        p.wait(0.1)
        highest = max(highest, p.truth.up_mm)
    assert highest > (29_000 if p.px4 else 14_000)


def test_landed_state_follows_the_phases_of_the_flight(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour)
    p.long(511, 245, 100_000)
    p.take_off(12)
    p.go_to(10, 0, 12)
    p.wait(5)
    p.mode(FlightMode.LAND)
    p.until(lambda: not p.truth.armed)
    p.wait(0.5)
    states = [f.message.landed_state for f in p.seen if f.name == "EXTENDED_SYS_STATE"]
    assert [states[0]] + [b for a, b in pairwise(states) if a != b] == [1, 3, 2, 4, 1]


def test_hold_keeps_its_place_in_wind(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour, wind=Wind(9_000, 45, 1_500))
    p.take_off(20)
    p.mode(FlightMode.LOITER)
    p.wait(3)
    start = p.truth
    p.wait(15)
    assert abs(p.truth.north_mm - start.north_mm) < 1_000
    assert abs(p.truth.east_mm - start.east_mm) < 1_000


#: by speed: the stopping distance, and the time until it is slower than 0.4 m/s, as measured on real autopilots
STOPS = [
    ("px4", "pause", 4.5, 7.7, 3.6),
    ("ardupilot", FlightMode.BRAKE, 10.1, 20.7, 4.6),
    ("ardupilot", FlightMode.BRAKE, 4.0, 7.0, 3.5),
    ("ardupilot", FlightMode.LOITER, 10.1, 18.0, 3.0),
]


@pytest.mark.parametrize(("flavour", "how", "speed_m_s", "away_m", "after_s"), STOPS)
def test_stop_matches_the_recording(
    pilot: Callable[..., Any], flavour: str, how: Any, speed_m_s: float, away_m: float, after_s: float
) -> None:
    p = pilot(flavour, cruise_mm_s=round(speed_m_s * 1000), noise=False)
    p.take_off(20)
    p.go_to(400, 0, 20)
    p.wait(15)
    assert p.truth.speed_mm_s > speed_m_s * 990
    start, start_us = p.truth.north_mm, p.simulation.now_us
    assert p.pause() == [0] if how == "pause" else p.mode(how) == [0]
    p.until(lambda: p.truth.speed_mm_s < 400)
    assert (p.simulation.now_us - start_us) / 1_000_000 == pytest.approx(after_s, abs=0.2)
    p.wait(5)
    assert (p.truth.north_mm - start) / 1000 == pytest.approx(away_m, rel=0.05)
    assert p.truth.speed_mm_s < 150


@pytest.mark.parametrize(("speed_m_s", "flavour"), each_once([1, 2, 6, 8, 12], ["px4", "ardupilot"]))
def test_stop_holds_from_any_speed(pilot: Callable[..., Any], flavour: str, speed_m_s: int) -> None:
    p = pilot(flavour, cruise_mm_s=speed_m_s * 1000, noise=False)
    p.take_off(20)
    p.go_to(400, 0, 20)
    p.wait(15)
    start = p.truth.north_mm
    p.pause() if p.px4 else p.mode(FlightMode.BRAKE)
    furthest = start
    for _ in range(120):
        p.wait(0.1)
        furthest = max(furthest, p.truth.north_mm)
    assert speed_m_s * 0.8 < (furthest - start) / 1000 < speed_m_s * 3.5
    assert furthest - p.truth.north_mm < 2_000, "it hardly comes back"
    assert p.truth.speed_mm_s < 150


def test_telemetry_agrees_with_the_truth(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour)
    for number in (33, 24, 74):
        p.long(511, number, 100_000)
    p.take_off(20)
    p.go_to(50, 30, 25)
    p.wait(30)
    t, position, fix = p.truth, p.last("GLOBAL_POSITION_INT"), p.last("GPS_RAW_INT")
    assert abs(position.relative_alt - t.up_mm) < 200
    assert position.alt - position.relative_alt == p.config.home.amsl_mm
    assert abs(position.lat - t.latitude) < 20
    assert abs(position.lon - t.longitude) < 20
    assert abs(fix.alt - p.config.home.amsl_mm - t.up_mm) < 1_500
    assert position.time_boot_ms * 1000 <= p.simulation.now_us < position.time_boot_ms * 1000 + 200_000


def test_forced_disarm_in_the_air_lets_the_vehicle_fall(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour)
    p.take_off(20)
    assert p.long(400, 0, 21196) == [0]
    assert not p.truth.armed
    p.wait(1)
    assert p.truth.climb_mm_s < -5_000
    p.wait(5)
    assert (p.truth.up_mm, p.truth.in_air) == (0, False)
