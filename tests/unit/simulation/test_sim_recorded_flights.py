"""The simulated vehicle repeats recorded flights with the same commands at the same times.

Compared second by second are modes, landed states, estimator flags, fixes, texts, height and place. Accepted
differences are listed with reasons; a difference that disappears must be removed from the list.
"""

from collections.abc import Mapping
from dataclasses import replace
from math import nan
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from recorded import difference
from recorded.trace import SECOND, Heard, Trace, landed, mode
from rtshcua.codec.frames import Codec
from rtshcua.model import faults
from rtshcua.simulation.config import AutopilotKind, Boot, SimulationConfig
from rtshcua.simulation.place import HomePosition
from rtshcua.simulation.world import Simulation

LATE_US = 5 * SECOND // 2
UP_M, AWAY_M = 2.0, 5.0

COPTER = SimulationConfig(
    AutopilotKind.ARDUPILOT,
    home=HomePosition(-353_632_620, 1_491_652_370, 584_080),
    cruise_mm_s=10_000,
    return_mm=15_000,
    noise=False,
    boot=Boot.RECORDED,
    faults=(
        # set to 8 m/s; its simulator has less wind near the ground
        faults.WindStep(65_900_000, 4_000, 90),
        faults.WindStep(91_000_000, 3_300, 90),
        faults.WindStep(99_000_000, 2_700, 90),
        faults.GpsLoss(77_900_000, 8_000_000),
        faults.BatteryVoltage(100_900_000, 10_200),
    ),
)
PX4 = SimulationConfig(
    AutopilotKind.PX4,
    home=HomePosition(473_977_440, 85_455_945, 488_140),
    cruise_mm_s=4_200,
    noise=False,
    boot=Boot.RECORDED,
)
STREAMS = (1, 24, 33, 230, 193, 245)


def long(number: int, *params: float) -> Any:
    return mavlink.MAVLink_command_long_message(1, 1, number, 0, *params, *[0.0] * (7 - len(params)))


def to(home: HomePosition, north: float, east: float, amsl: float) -> Any:
    return mavlink.MAVLink_command_int_message(1, 1, 5, 192, 0, 0, -1, 1, 0, nan, *home.globe(north, east), amsl)


def target(home: HomePosition, north: float, east: float) -> Any:
    place = home.globe(north, east)
    return mavlink.MAVLink_set_position_target_global_int_message(0, 1, 1, 6, 0xDF8, *place, 15.0, *[0.0] * 8)


#: the sent messages, with their times by the autopilot's clock
SENT: Mapping[str, tuple[tuple[float, Any], ...]] = {
    "arducopter": (
        (42.31, long(176, 1, 4)),
        (42.36, long(400, 1)),
        (42.38, long(22, 0, 0, 0, 0, 0, 0, 15)),
        (54.05, target(COPTER.home, 40, 0)),
        (66.2, target(COPTER.home, 40, 40)),
        (107.0, long(176, 1, 6)),
    ),
    "px4": (
        (10.10, long(400, 1)),
        (10.11, long(22, -1, 0, 0, nan, nan, nan, 503)),
        (26.00, to(PX4.home, 40, 0, 503)),
        (39.72, to(PX4.home, 40, 40, 503)),
        (84.90, long(20)),
    ),
}
CONFIGS = {"arducopter": COPTER, "px4": PX4}
YAW = "text '6 EKF# IMU# MAG# in-flight yaw alignment complete', time"
KEPT: Mapping[str, Mapping[str, str]] = {
    "arducopter": {
        "text '6 RC#: SaveWaypoint LOW', time 1": "a switch of the remote control, which is not simulated",
        f"{YAW} 1": "the compass is not simulated",
        f"{YAW} 2": "the compass is not simulated",
        "base 89, time 1": "the very first heartbeat is as if a place were held",
        "base 81, time 2": "on the ground after a return it tells that it holds no place any more",
        "base 89, time 2 here": "on the ground after a return it tells that it holds no place any more",
        "height from 110 s": "a climb out of a landing begins more gently",
        "place from 88 s": "its simulator's wind has a profile; here it changes in three steps",
    },
    "px4": {
        "place from 45 s": "it flew the second leg slower than the first; here both alike",
        "mode (50593792, True), time 1": "between arming and the takeoff came a heartbeat, by chance",
    },
}


def flown(name: str, until_us: int) -> list[Heard]:
    """Return the frames of the simulated vehicle."""
    simulation, codec, heard = Simulation(CONFIGS[name]), Codec(255, 190), list[Heard]()

    def take(datagrams: list[bytes]) -> None:
        found = [received for datagram in datagrams for received in codec.parse(datagram)]
        heard.extend(Heard(simulation.now_us, received) for received in found if received.component == 1)

    messages = [(0.1, long(511, number, 100_000)) for number in STREAMS]
    messages += SENT[name]
    beat = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3)
    messages += [(float(second), beat) for second in range(until_us // SECOND)]
    for at, message in sorted(messages, key=lambda entry: entry[0]):
        while simulation.now_us < at * SECOND:
            take(simulation.advance(min(simulation.now_us + 100_000, round(at * SECOND))))
        take(simulation.receive(codec.pack(message), simulation.now_us))
    return heard


def status(heard: Heard) -> object:
    return heard.message.system_status if heard.name == "HEARTBEAT" else None


def base(heard: Heard) -> object:
    return heard.message.base_mode if heard.name == "HEARTBEAT" else None


def estimator(heard: Heard) -> object:
    """Return whether the position is valid."""
    if heard.name not in ("ESTIMATOR_STATUS", "EKF_STATUS_REPORT"):
        return None
    return bool(heard.message.flags & mavlink.ESTIMATOR_POS_HORIZ_ABS)


def fix(heard: Heard) -> object:
    return heard.message.fix_type if heard.name == "GPS_RAW_INT" else None


def prearm(heard: Heard) -> object:
    if heard.name != "SYS_STATUS":
        return None
    return bool(heard.message.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK)


@pytest.mark.slow
@pytest.mark.parametrize("name", list(KEPT))
def test_flight_matches_the_recording(name: str) -> None:
    real = Trace(name).of_vehicle
    own = flown(name, real[-1].at_us)
    differences = [
        *difference.texts(real, own, LATE_US),
        *difference.motion(CONFIGS[name].home, real, own, UP_M, AWAY_M),
    ]
    for read in (mode, base, status, landed, estimator, fix, prearm):
        differences += difference.changes(read.__name__, read, real, own, LATE_US)
    kept = KEPT[name]
    assert [str(d) for d in differences if d.key not in kept] == []
    assert set(kept) == {d.key for d in differences}, "these differ no more"


def test_both_configurations_boot_as_recorded() -> None:
    assert replace(COPTER, faults=()).boot is PX4.boot is Boot.RECORDED
