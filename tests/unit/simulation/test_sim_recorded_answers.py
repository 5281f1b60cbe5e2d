"""The simulated vehicle answers the requests of recorded sessions like the real autopilots.

Compared are acknowledgements, requested messages, parameters, uploads, modes, landed states, texts, height and place.
Accepted differences are listed here with reasons; a difference that disappears must be removed from the list.
"""

from collections.abc import Mapping

import pytest

from recorded import difference
from recorded.replay import Replay
from recorded.trace import SECOND, Heard, Trace, landed, mode
from rtshcua.simulation.config import AutopilotKind, Boot, SimulationConfig
from rtshcua.simulation.place import HomePosition

LATE_US = 5 * SECOND // 2
"""The greatest time difference of a change: heartbeats come once a second, and a landing takes long."""
UP_M, AWAY_M = 2.0, 5.0

COPTER = SimulationConfig(
    AutopilotKind.ARDUPILOT,
    home=HomePosition(-353_632_621, 1_491_652_371, 584_080),
    cruise_mm_s=10_000,
    return_mm=15_000,
    noise=False,
    boot=Boot.RECORDED,
)
PX4 = SimulationConfig(
    AutopilotKind.PX4,
    home=HomePosition(473_977_432, 85_455_922, 487_889),
    cruise_mm_s=4_400,
    noise=False,
    boot=Boot.RECORDED,
)
"""It was set to 5 m/s, but reached that only at the end of long legs: its simulator's air is dense."""

LANDING = "the height of its simulator strays by half a metre on the ground, which keeps the landing from being noticed"
LIFTED = "the reposition on the ground begins to fly there before the takeoff takes over; here it lifts straight up"
AHEAD = "it sets off 0.3 s later and is 2 m behind; here the orbit crosses the fence before a heartbeat tells of it"
STICK = "the throttle stick of its simulator is down: in LOITER it sinks; here no stick is held"
CURVE = "legs of a mission begin and end with less jerk than anything in GUIDED; here both alike"

YAW = "text '6 EKF# IMU# MAG# in-flight yaw alignment complete', time"
KEPT: Mapping[str, Mapping[str, str]] = {
    "px4-commands": {
        "mode (16973824, True), time 1": AHEAD,
        "mode (50593792, True), time 4": AHEAD,
        "mode (50593792, False), time 4": LANDING,
        "mode (50593792, False), time 4 here": LANDING,
        "landed 1, time 2": LANDING,
        "landed 1, time 2 here": LANDING,
        "landed 2, time 1": LIFTED,
        "landed 3, time 1 here": LIFTED,
        "landed 2, time 1 here": LIFTED,
        "height from 35 s": LIFTED,
        "place from 36 s": LIFTED,
        "place from 72 s": "it flies out to the circle faster than it then circles",
    },
    "arducopter-commands": {
        "text '6 RC#: SaveWaypoint LOW', time 1": "a switch of the remote control, which is not simulated",
        f"{YAW} 1": "the compass is not simulated",
        f"{YAW} 2": "the compass is not simulated",
        "text '6 Mission: # WP', time 1 here": CURVE,
        "height from 110 s": STICK,
        "place from 124 s": CURVE,
    },
    "arducopter-signing": {},
}
CONFIGS = {
    "px4-commands": PX4,
    "arducopter-commands": SimulationConfig(
        **{name: getattr(COPTER, name) for name in COPTER.__slots__} | {"usb": True}
    ),
    "arducopter-signing": COPTER,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", list(KEPT))
def test_answers_match_the_recording(name: str) -> None:
    trace, config = Trace(name), CONFIGS[name]
    real, own = trace.of_vehicle, Replay(trace, config).heard
    differences = [
        *difference.answers(trace.questions, real, own),
        *difference.changes("mode", mode, real, own, LATE_US),
        *difference.changes("landed", landed, real, own, LATE_US),
        *difference.texts(real, own, LATE_US),
        *difference.motion(config.home, real, own, UP_M, AWAY_M),
    ]
    kept = KEPT[name]
    assert [str(d) for d in differences if d.key not in kept] == []
    assert set(kept) == {d.key for d in differences}, "these differ no more"


def test_comparison_detects_differences() -> None:
    """A session is compared with a slightly changed one."""
    trace = Trace("arducopter-signing")
    real = trace.of_vehicle
    late = [Heard(h.at_us + 20 * SECOND, h.received) for h in real]
    assert not list(difference.answers(trace.questions, real, real))
    assert not list(difference.changes("mode", mode, real, real, 0))
    assert not list(difference.texts(real, real, 0))
    assert not list(difference.motion(COPTER.home, real, real, 0, 0))
    assert {d.key for d in difference.answers(trace.questions, real, late)} >= {"0 command 511, acks"}
    assert {d.key for d in difference.changes("mode", mode, real, late, LATE_US)} >= {"mode (4, True), time 1"}
    assert len(list(difference.texts(real, late, LATE_US))) > 10
    assert [d.key for d in difference.motion(COPTER.home, real, [], UP_M, AWAY_M)] == ["position"]
