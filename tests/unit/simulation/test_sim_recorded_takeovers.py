"""The simulated vehicle repeats six recorded flights with takeovers or defects.

The frames of the runtime are sent again at the same times of the autopilot's clock, with the presumed frames of the
pilot's ground station, which are not in the recordings. Compared are acknowledgements, modes, landed states, reported
targets, height, place and rates. Accepted differences are listed with reasons; a difference that disappears must be
removed from the list.
"""

from collections.abc import Mapping
from functools import cache
from math import nan

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from recorded import difference
from recorded.flight import LEAD_US, Flight
from recorded.trace import SECOND, Heard, Trace, landed, mode
from rtshcua.codec.frames import Codec
from rtshcua.model import faults
from rtshcua.simulation.config import AutopilotKind, SimulationConfig
from rtshcua.simulation.place import HomePosition

LATE_US = 5 * SECOND // 2
UP_M, AWAY_M = 2.3, 5.0
"""The height of PX4's simulator drifts by 0.3 m."""
STALLED = "arducopter-dropout"
RATES = ("HEARTBEAT", "EXTENDED_SYS_STATE", "GLOBAL_POSITION_INT", "GPS_RAW_INT", "TIMESYNC", "SYSTEM_TIME")
STATION = Codec(255, 190)


def long(number: int, *params: float) -> bytes:
    message = mavlink.MAVLink_command_long_message(1, 1, number, 0, *params, *[0.0] * (7 - len(params)))
    return STATION.pack(message)


def to(latitude: int, longitude: int, amsl: float) -> bytes:
    message = mavlink.MAVLink_command_int_message(1, 1, 5, 192, 0, 0, -1, 1, 0, nan, latitude, longitude, amsl)
    return STATION.pack(message)


def target(latitude: int, longitude: int, up: float) -> bytes:
    message = mavlink.MAVLink_set_position_target_global_int_message(
        0, 1, 1, 6, 0xDF8, latitude, longitude, up, *[0.0] * 8
    )
    return STATION.pack(message)


PILOT: Mapping[str, tuple[tuple[float, bytes], ...]] = {
    "px4-takeover-race": ((17.09, long(21, 0, 0, 0, nan, nan, nan)),),
    "px4-pilot-pause": ((24.71, long(192, -1, 1, 0, nan, nan, nan, nan)),),
    "px4-pilot-goto": ((24.40, to(473_980_000, 85_440_000, 530.0)),),
    "arducopter-pilot-goto": ((17.76, target(473_980_000, 85_440_000, 42.0)),),  # the target is a guess: up and west
}
#: m/s on the long legs: PX4's simulator has dense air, and reaches the commanded 6 m/s only at their end
REACHED_MM_S = {
    "px4-hover-does-not-stop": 4_700,
    "px4-takeover-race": 5_300,
    "px4-pilot-pause": 4_700,
    "px4-pilot-goto": 4_400,
}
AIR = "its simulator's air is thick: slow at first, faster than here at the end"
JERK = "it begins to climb more gently, and while it turns over"
KEPT: Mapping[str, Mapping[str, str]] = {
    "px4-hover-does-not-stop": {
        "height from 10 s": "it takes off slower than in the other flights",
        "height from 37 s": JERK,
        "place from 37 s": "from 5.6 m/s, which it comes to here never, it flies further past the place of the return",
    },
    "px4-takeover-race": {"place from 38 s": AIR, "place from 62 s": AIR},
    "px4-pilot-pause": {},
    "px4-pilot-goto": {
        "place from 27 s": AIR,
        "place from 50 s": AIR,
    },
    "arducopter-pilot-goto": {
        "mode (6, False), time 1": "the flight before ended in RTL; here it begins anew",
        "mode (0, False), time 1 here": "the flight before ended in RTL; here it begins anew",
        "height from 140 s": JERK,
        "place from 147 s": JERK,
    },
    STALLED: {},
}


@cache
def again(name: str) -> Flight:
    trace = Trace(name, wall=name == STALLED)
    home = next(h.message for h in trace.heard if h.name == "HOME_POSITION")
    speed = REACHED_MM_S.get(name, 9_400)
    config = SimulationConfig(
        AutopilotKind.PX4 if name.startswith("px4") else AutopilotKind.ARDUPILOT,
        home=HomePosition(home.latitude, home.longitude, home.altitude),
        cruise_mm_s=speed,
        max_speed_mm_s=speed,
        noise=False,
    )
    stall = (faults.Stall(17_600_000 + LEAD_US, 4_950_000),) if name == STALLED else ()
    return Flight(trace, config, PILOT.get(name, ()), stall)


@pytest.mark.slow
@pytest.mark.parametrize("name", list(KEPT))
def test_takeover_matches_the_recording(name: str) -> None:
    flight = again(name)
    real, own, home = flight.real, flight.own, flight.home
    differences = [
        *difference.acknowledgements(real, [h for h in own if h.at_us >= 0]),
        *difference.changes("mode", mode, real, own, LATE_US),
        *difference.changes("landed", landed, real, own, LATE_US),
        *difference.targets(home, real, own, UP_M, AWAY_M, LATE_US),
        *difference.motion(home, real, own, UP_M, AWAY_M),
        *difference.rates(RATES, real, own, 0.03),
    ]
    kept = KEPT[name]
    assert [str(d) for d in differences if d.key not in kept] == []
    assert set(kept) == {d.key for d in differences}, "these differ no more"


def moved_m(home: HomePosition, heard: list[Heard], from_s: float, to_s: float) -> float:
    """Return the distance between the places at two times."""
    places = [
        home.local(h.message.lat, h.message.lon)
        for h in heard
        if h.name == "GLOBAL_POSITION_INT" and from_s * SECOND <= h.at_us <= to_s * SECOND
    ]
    (north, east), (last_north, last_east) = places[0], places[-1]
    return float(((last_north - north) ** 2 + (last_east - east) ** 2) ** 0.5)


def test_each_recording_shows_its_takeover() -> None:
    """The defects are checked directly, so that no tolerance above can hide them."""
    flight = again("px4-hover-does-not-stop")
    for side in (flight.real, flight.own):
        assert moved_m(flight.home, side, 25.4, 35.0) > 40, "told to hold, it flies on"
    flight = again("px4-takeover-race")
    for side in (flight.real, flight.own):
        landing = [h.at_us for h in side if h.name == "EXTENDED_SYS_STATE" and h.message.landed_state == 4]
        assert 16.9 < landing[0] / SECOND < 17.5, "the landing is told at once"
        modes = {h.message.custom_mode for h in side if h.name == "HEARTBEAT" and h.at_us < 50 * SECOND}
        assert 100925440 not in modes, "by no heartbeat"
    flight = again("px4-pilot-pause")
    for side in (flight.real, flight.own):
        assert moved_m(flight.home, side, 29, 36) < 1.5
    flight = again(STALLED)
    for side in (flight.real, flight.own):
        assert not [h for h in side if 17.65 * SECOND < h.at_us < 22.5 * SECOND]
        burst = [h for h in side if 22.5 * SECOND < h.at_us < 22.6 * SECOND and h.name == "COMMAND_ACK"]
        assert len(burst) >= 5


def test_comparison_detects_differences() -> None:
    """A flight is compared with a slightly changed one."""
    flight = again("px4-pilot-pause")
    real = flight.real
    late = [Heard(h.at_us + 20 * SECOND, h.received) for h in real]
    few = [h for number, h in enumerate(real) if number % 2]
    assert not list(difference.acknowledgements(real, real))
    assert not list(difference.targets(flight.home, real, real, 0.0, 0.0, 1))
    assert not list(difference.rates(RATES, real, real, 0.0))
    assert {d.key for d in difference.acknowledgements(real, few)} >= {"command 511"}
    seen = {d.key for d in difference.targets(flight.home, real, late, UP_M, AWAY_M, LATE_US)}
    assert any(key.startswith("target place") for key in seen)
    assert any(key.startswith("targets only") for key in seen)
    assert {d.key for d in difference.rates(RATES, real, few, 0.03)} >= {"rate of TIMESYNC"}
