"""The frame session: which frames pass, by tables written by hand, and with every octet of a permitted frame
flipped.
"""

import struct
from collections.abc import Iterable
from math import inf, nan
from random import Random
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as m

from rtshcua.codec.frames import Codec
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink import signing
from rtshcua.mavlink.layouts import LAYOUTS
from rtshcua.mavlink.parameters import bits_of
from rtshcua.mavlink.signing import EPOCH_US, SignedLink, SigningState
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.enforcement.frames import (
    AFTER_START,
    FORCED_ARMING,
    LATE,
    NO_SESSION,
    NO_VEHICLE,
    NOT_COVERED,
    NOT_DOWN,
    NOT_LISTED,
    NOT_ONE_FRAME,
    NOT_OURS,
    OUT_OF_ORDER,
    STANDS_US,
    TOO_MANY_AHEAD,
    WRONG_TARGET,
    FrameSession,
)
from rtshcua.onboard.ports import Command
from rtshcua.wire.boundary_chain import START
from rtshcua.wire.preparation import ParameterWrite
from virtual.rows import rows

SYSTEM, HOME_AMSL = 3, 488_000
ARDUPILOT, PX4 = 3, 12  # MAV_AUTOPILOT
OURS = 191
GEO = (473_977_000, 85_456_000, 473_978_000, 85_457_000)
NOW = 1_000_000
LATEST = 2_000_000


def command(kind: MotionKind, altitude: int = 20_000, speed: int = 4_000) -> Command:
    return Command(7, "skill", kind, (0, 0, 1, 1), GEO, altitude, speed, not_after_us=LATEST)


def pack(message: Any, system: int = SYSTEM, component: int = OURS) -> bytes:
    return Codec(system, component).pack(message)


def heartbeat(autopilot: int) -> Any:
    return m.MAVLink_heartbeat_message(2, autopilot, 0, 0, 0, 3)


def height(above_sea: int, above_home: int) -> Any:
    return m.MAVLink_global_position_int_message(0, 0, 0, above_sea, above_home, 0, 0, 0, 0)


def parameter(name: str, value: float, kind: int = 9) -> Any:
    return m.MAVLink_param_value_message(name.encode(), value, kind, 1, 0)


def session(autopilot: int, of: Command | None = None) -> FrameSession:
    made = FrameSession()
    made.observe(pack(heartbeat(autopilot), component=1))
    made.observe(pack(height(HOME_AMSL + 5_000, 5_000), component=1))
    made.observe(pack(parameter("FENCE_TYPE", 3), component=1))
    if of is not None:
        made.open(of)
    return made


def long(number: int, *parameters: float, system: int = SYSTEM, component: int = 1) -> Any:
    filled = [*parameters, *[0.0] * (7 - len(parameters))]
    return m.MAVLink_command_long_message(system, component, number, 0, *filled)


def reposition(**other: Any) -> Any:
    fields = {
        "target_system": SYSTEM, "target_component": 1, "frame": 0, "command": 192, "current": 0, "autocontinue": 0,
        "param1": 4.0, "param2": 1, "param3": 0, "param4": nan, "x": GEO[0], "y": GEO[1], "z": 508.0,
    }  # fmt: skip
    return m.MAVLink_command_int_message(**{**fields, **other})


def target(**other: Any) -> Any:
    fields = {
        "time_boot_ms": 0, "target_system": SYSTEM, "target_component": 1, "coordinate_frame": 6, "type_mask": 0x0DF8,
        "lat_int": GEO[0], "lon_int": GEO[1], "alt": 20.0, "vx": 0, "vy": 0, "vz": 0, "afx": 0, "afy": 0, "afz": 0,
        "yaw": 0, "yaw_rate": 0,
    }  # fmt: skip
    return m.MAVLink_set_position_target_global_int_message(**{**fields, **other})


def one(place: int, first: int, last: int) -> list[float]:
    """Parameters `first` to `last`, all 0 but the one at `place`."""
    return [float(number == place) for number in range(first, last + 1)]


K = MotionKind
TAKEOFF = (nan, nan, nan, 508.0)

NOWHERE = {"param1": -1.0, "x": 2**31 - 1, "y": 2**31 - 1, "z": nan}
TRAVELS = (K.FLY, K.COVER)

#: autopilot, a frame, and the commands that it carries out
CARRIED: list[tuple[int, Any, tuple[MotionKind, ...]]] = [
    (PX4, long(22, 0, 0, 0, *TAKEOFF), (K.CLIMB,)),
    (PX4, long(22, nan, 0, 0, *TAKEOFF), (K.CLIMB,)),
    (PX4, long(400, 1), (K.CLIMB,)),
    (PX4, reposition(), TRAVELS),
    (PX4, reposition(param2=0), TRAVELS),
    (PX4, long(176, 1, 4, 3), (K.CLIMB,)),  # it is armed in Hold; it does not stop it
    (PX4, reposition(**NOWHERE), (K.HOLD,)),
    (PX4, reposition(**NOWHERE | {"param2": 0}), (K.HOLD,)),
    (PX4, long(176, 1, 4, 5), (K.HOME,)),
    (PX4, long(176, 1, 4, 6), (K.LAND,)),
    (ARDUPILOT, long(176, 1, 4), (K.CLIMB, *TRAVELS)),
    (ARDUPILOT, long(400, 1), (K.CLIMB,)),
    (ARDUPILOT, long(22, 0, 0, 0, 0, 0, 0, 20.0), (K.CLIMB,)),
    (ARDUPILOT, long(178, 1, 4.0, -1), TRAVELS),
    (ARDUPILOT, target(), TRAVELS),
    (ARDUPILOT, target(time_boot_ms=9, vx=1.0), TRAVELS),
    (ARDUPILOT, long(176, 1, 17), (K.HOLD,)),
    (ARDUPILOT, long(176, 1, 6), (K.HOME,)),
    (ARDUPILOT, long(176, 1, 9), (K.LAND,)),
]
EACH = pytest.mark.parametrize(("autopilot", "message", "kinds"), CARRIED)

ALWAYS: list[Any] = [
    m.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3),
    long(511, 33, 100_000),
    long(512, 148),
    long(401),  # requests the results of the pre-arm checks
    m.MAVLink_param_request_read_message(SYSTEM, 1, b"RTL_ALT", -1),
    m.MAVLink_param_request_list_message(SYSTEM, 1),
    m.MAVLink_statustext_message(6, b"going home"),
    m.MAVLink_timesync_message(0, 5),
    m.MAVLink_log_request_list_message(SYSTEM, 1, 0, 0xFFFF),
    m.MAVLink_mission_request_list_message(SYSTEM, 1, 1),
    m.MAVLink_mission_request_int_message(SYSTEM, 1, 0, 1),
    m.MAVLink_mission_request_message(SYSTEM, 1, 0, 1),
    m.MAVLink_mission_ack_message(SYSTEM, 1, 0, 1),
]
BEFORE_FLIGHT: list[Any] = [
    m.MAVLink_mission_count_message(SYSTEM, 1, 4, 1),
    m.MAVLink_mission_clear_all_message(SYSTEM, 1, 1),
    *[
        m.MAVLink_mission_item_int_message(SYSTEM, 1, 0, 0, number, 0, 1, 4, 0, 0, 0, 1, 1, 0, 1)
        for number in range(5_000, 5_005)
    ],
    m.MAVLink_param_set_message(SYSTEM, 1, b"FENCE_ENABLE", 1, 2),
    m.MAVLink_param_set_message(SYSTEM, 1, b"FENCE_TYPE", 7, 2),
]
NEVER: list[Any] = [
    heartbeat(3),
    m.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3),  # a ground station's
    m.MAVLink_heartbeat_message(18, 8, 128, 0, 4, 3),
    m.MAVLink_mission_count_message(SYSTEM, 1, 4, 0),
    m.MAVLink_mission_clear_all_message(SYSTEM, 1, 255),
    m.MAVLink_mission_item_int_message(SYSTEM, 1, 0, 0, 16, 0, 1, 4, 0, 0, 0, 1, 1, 0, 1),
    m.MAVLink_mission_item_int_message(SYSTEM, 1, 0, 0, 5_001, 0, 1, 4, 0, 0, 0, 1, 1, 0, 0),
    m.MAVLink_mission_item_message(SYSTEM, 1, 0, 0, 5_001, 0, 1, 4, 0, 0, 0, 1, 1, 0, 1),
    m.MAVLink_mission_set_current_message(SYSTEM, 1, 0),
    m.MAVLink_param_set_message(SYSTEM, 1, b"FENCE_ENABLE", 0, 2),
    m.MAVLink_param_set_message(SYSTEM, 1, b"FENCE_TYPE", 3, 2),
    m.MAVLink_param_set_message(SYSTEM, 1, b"FENCE_TYPE", 4, 2),  # its own circle and ceiling stay enabled
    m.MAVLink_param_set_message(SYSTEM, 1, b"FENCE_TYPE", 15, 2),
    m.MAVLink_param_set_message(SYSTEM, 1, b"FENCE_RADIUS", 300, 9),
    m.MAVLink_param_set_message(SYSTEM, 1, b"FENCE_TYPE", nan, 2),
    m.MAVLink_param_set_message(SYSTEM, 1, b"ARMING_CHECK", 0, 2),
    m.MAVLink_setup_signing_message(SYSTEM, 1, bytes(32), 0),
    m.MAVLink_set_mode_message(SYSTEM, 1, 9),
    m.MAVLink_manual_control_message(SYSTEM, 0, 0, 500, 0, 0),
    m.MAVLink_rc_channels_override_message(SYSTEM, 1, *[1_500] * 8),
    m.MAVLink_set_attitude_target_message(0, SYSTEM, 1, 0, [1, 0, 0, 0], 0, 0, 0, 1),
    m.MAVLink_file_transfer_protocol_message(0, SYSTEM, 1, bytes(251)),
    m.MAVLink_set_gps_global_origin_message(SYSTEM, 0, 0, 0),
    m.MAVLink_gps_rtcm_data_message(0, 10, bytes(180)),
    m.MAVLink_radio_status_message(0, 0, 100, 0, 0, 0, 0),
    m.MAVLink_command_ack_message(400, 0),
    long(246, 1),  # reboot
    long(185, 1),  # flight termination
    long(400, 0),  # disarm
    long(401, 1),
    long(207, 0),  # fence off
    long(300),
    long(193, 1),
    long(179, 1),
]


def named(message: Any) -> str:
    return f"{message.get_type()} {getattr(message, 'command', '')}".strip()


def covers(gate: FrameSession, message: Any) -> bool:
    return isinstance(gate.seal(pack(message), NOW), bytes)


@EACH
def test_a_permitted_command_is_carried_out_and_no_other(
    autopilot: int, message: Any, kinds: tuple[MotionKind, ...]
) -> None:
    frame = pack(message)
    assert session(autopilot).seal(frame, NOW) is NO_SESSION
    for kind in K:
        sealed = session(autopilot, command(kind)).seal(frame, NOW)
        assert sealed == (frame if kind in kinds else NOT_COVERED), kind


@pytest.mark.parametrize("autopilot", [PX4, ARDUPILOT])
def test_request_frames_always_pass(autopilot: int) -> None:
    for gate in (session(autopilot), session(autopilot, command(K.LAND))):
        for message in ALWAYS:
            assert covers(gate, message), named(message)


def test_a_fence_passes_until_something_flies() -> None:
    gate = session(PX4)
    for message in BEFORE_FLIGHT:
        assert covers(gate, message), named(message)
    gate.open(command(K.CLIMB))
    gate.close()
    for message in BEFORE_FLIGHT:
        assert gate.seal(pack(message), NOW) is AFTER_START, named(message)


@pytest.mark.parametrize("autopilot", [PX4, ARDUPILOT])
def test_unlisted_frames_never_pass(autopilot: int) -> None:
    for gate in (session(autopilot), *(session(autopilot, command(kind)) for kind in K)):
        for message in NEVER:
            assert not covers(gate, message), named(message)


@rows("forced", [21_196.0, 2_989.0, 1.0, nan, inf])
@rows("on", [0, 1])
def test_forced_arming_and_disarming_are_refused(forced: float, on: int) -> None:
    by_int = reposition(command=400, param1=on, param2=forced)
    for message in (long(400, on, forced), by_int):
        for gate in (session(PX4), session(ARDUPILOT, command(K.CLIMB))):
            assert gate.seal(pack(message), NOW) is FORCED_ARMING


REFUSED: list[tuple[str, int, MotionKind, Any]] = [
    ("PX4 keeps its target where a height is given", PX4, K.HOLD, reposition(**NOWHERE | {"z": 508.0})),
    ("and where a heading is", PX4, K.HOLD, reposition(**NOWHERE | {"param4": 1.0})),
    ("one coordinate is a place", PX4, K.HOLD, reposition(**NOWHERE | {"x": GEO[0]})),
    ("a stop has no speed", PX4, K.HOLD, reposition(**NOWHERE | {"param1": 4.0})),
    ("a stop has no other flag", PX4, K.HOLD, reposition(**NOWHERE | {"param2": 2})),
    ("a place is no stop", PX4, K.HOLD, reposition()),
    ("nor is the mode, to PX4", PX4, K.HOLD, long(176, 1, 4, 3)),
    ("a stop is no leg", PX4, K.FLY, reposition(**NOWHERE)),
    ("ArduCopter is stopped by its mode", ARDUPILOT, K.HOLD, reposition(**NOWHERE)),
    ("too high", PX4, K.CLIMB, long(22, 0, 0, 0, nan, nan, nan, 510.001)),
    ("above home instead of above sea", PX4, K.CLIMB, long(22, 0, 0, 0, nan, nan, nan, 20.0)),
    ("at a pitch", PX4, K.CLIMB, long(22, 1, 0, 0, *TAKEOFF)),
    ("no height", PX4, K.CLIMB, long(22, 0, 0, 0, nan, nan, nan, nan)),
    ("somewhere else", PX4, K.CLIMB, long(22, 0, 0, 0, nan, 47.0, 8.0, 508.0)),
    ("at 0 N, 0 E", PX4, K.CLIMB, long(22, 0, 0, 0, nan, 0, 0, 508.0)),
    ("above sea instead of above home", ARDUPILOT, K.CLIMB, long(22, 0, 0, 0, 0, 0, 0, 508.0)),
    ("too high", ARDUPILOT, K.CLIMB, long(22, 0, 0, 0, 0, 0, 0, 20.003)),
    ("infinitely high", ARDUPILOT, K.CLIMB, long(22, 0, 0, 0, 0, 0, 0, inf)),
    ("mode without the flag", PX4, K.HOLD, long(176, 0, 4, 3)),
    ("another sub-mode", PX4, K.HOLD, long(176, 1, 4, 4)),
    ("offboard", PX4, K.FLY, long(176, 1, 6)),
    ("more than a mode", ARDUPILOT, K.LAND, long(176, 1, 9, 0, 1)),
    ("another mode", ARDUPILOT, K.FLY, long(176, 1, 5)),
    ("too fast", ARDUPILOT, K.FLY, long(178, 1, 4.01, -1)),
    ("climb speed", ARDUPILOT, K.FLY, long(178, 2, 4.0, -1)),
    ("throttle", ARDUPILOT, K.FLY, long(178, 1, 4.0, 50)),
    ("speed while climbing", ARDUPILOT, K.CLIMB, long(178, 1, 4.0, -1)),
    ("takeoff while flying", ARDUPILOT, K.FLY, long(22, 0, 0, 0, 0, 0, 0, 20.0)),
    ("as fast as it likes", PX4, K.FLY, reposition(param1=-1)),
    ("too fast", PX4, K.FLY, reposition(param1=5.0)),
    ("an orbit", PX4, K.FLY, reposition(command=34)),
    ("a circle", PX4, K.FLY, reposition(param3=10)),
    ("a heading", PX4, K.FLY, reposition(param4=1.0)),
    ("another flag", PX4, K.FLY, reposition(param2=3)),
    ("another frame", PX4, K.FLY, reposition(frame=6, z=20.0)),
    ("another place", PX4, K.FLY, reposition(x=GEO[0] + 1)),
    ("x of one point, y of another", PX4, K.FLY, reposition(y=GEO[3])),
    ("too high", PX4, K.FLY, reposition(z=510.01)),
    ("a position target", PX4, K.FLY, target()),
    ("a position target above sea", PX4, K.FLY, target(alt=508.0)),
    ("a reposition above sea", ARDUPILOT, K.FLY, reposition()),
    *[("more than arming", PX4, K.CLIMB, long(400, 1, *one(place, 2, 7))) for place in range(3, 8)],
    *[("more than a climb", PX4, K.CLIMB, long(22, 0, *one(place, 2, 3), *TAKEOFF)) for place in (2, 3)],
    *[("more than a climb", ARDUPILOT, K.CLIMB, long(22, *one(place, 1, 6), 20.0)) for place in range(1, 7)],
    *[("more than a speed", ARDUPILOT, K.FLY, long(178, 1, 4.0, -1, *one(place, 4, 7))) for place in range(4, 8)],
    *[("more than a mode", PX4, K.HOLD, long(176, 1, 4, 3, *one(place, 4, 7))) for place in range(4, 8)],
    ("as a reposition", ARDUPILOT, K.FLY, reposition(z=20.0, frame=6)),
    ("by velocity", ARDUPILOT, K.FLY, target(type_mask=0x0DC7, vx=5)),
    ("with a heading", ARDUPILOT, K.FLY, target(type_mask=0x09F8)),
    ("above sea", ARDUPILOT, K.FLY, target(coordinate_frame=5)),
    ("above ground", ARDUPILOT, K.FLY, target(coordinate_frame=11)),
    ("another place", ARDUPILOT, K.FLY, target(lon_int=GEO[1] - 1)),
    ("too high", ARDUPILOT, K.FLY, target(alt=20.01)),
    ("a return to a place", ARDUPILOT, K.HOME, target()),
]  # fmt: skip


@rows(("why", "autopilot", "kind", "message"), REFUSED, ids=lambda value: str(value)[:40])
def test_nearly_matching_frames_are_refused(why: str, autopilot: int, kind: MotionKind, message: Any) -> None:
    assert session(autopilot, command(kind)).seal(pack(message), NOW) is NOT_COVERED, why


def test_without_a_speed_the_vehicle_takes_its_own() -> None:
    free = command(K.FLY, speed=0)
    assert covers(session(PX4, free), reposition(param1=-1))
    assert not covers(session(PX4, free), reposition(param1=0))
    assert not covers(session(PX4, free), reposition(param1=4.0))
    assert not covers(session(ARDUPILOT, free), long(178, 1, 0, -1))


def test_heights_above_sea_follow_home_as_the_autopilot_tells_it() -> None:
    gate = session(PX4, command(K.FLY))
    assert covers(gate, reposition(z=510.0))
    gate.observe(pack(height(500_000, 5_000), component=1))
    assert not covers(gate, reposition())
    assert covers(gate, reposition(z=515.0))
    for foreign in (
        pack(height(0, 0), component=154),
        pack(height(0, 0), system=SYSTEM + 1, component=1),
        pack(heartbeat(PX4), component=1),
    ):
        gate.observe(foreign)
        assert covers(gate, reposition(z=515.0))


def test_amsl_altitudes_are_refused_without_home_altitude() -> None:
    gate = FrameSession()
    gate.observe(pack(heartbeat(PX4), component=1))
    gate.open(command(K.FLY))
    assert not covers(gate, reposition())
    assert not covers(gate, reposition(z=20.0))


def test_the_first_autopilot_that_is_known_is_the_vehicle() -> None:
    gate = FrameSession()
    assert gate.seal(pack(ALWAYS[1]), NOW) is NO_VEHICLE
    for nobody in (
        pack(heartbeat(8), component=1),
        pack(heartbeat(PX4), component=2),
        pack(heartbeat(PX4), system=0, component=1),
        pack(m.MAVLink_global_position_int_message(0, 0, PX4, 0, 0, 0, 0, 0, 0), component=1),
        b"",
        pack(heartbeat(PX4), component=1)[:-1],
    ):
        gate.observe(nobody)
        assert gate.seal(pack(ALWAYS[1]), NOW) is NO_VEHICLE
    gate.observe(pack(heartbeat(ARDUPILOT), component=1))
    gate.observe(pack(heartbeat(PX4), component=1))
    gate.observe(pack(heartbeat(PX4), system=SYSTEM + 1, component=1))
    gate.open(command(K.LAND))
    assert covers(gate, long(176, 1, 9))
    assert gate.seal(pack(ALWAYS[0], system=SYSTEM + 1), NOW) is NOT_OURS


@pytest.mark.parametrize("message", BEFORE_FLIGHT, ids=named)
def test_a_fence_is_not_handed_to_a_vehicle_that_is_armed(message: Any) -> None:
    """This does not depend on who armed it, because a run may begin in flight."""
    gate = FrameSession()
    gate.observe(pack(heartbeat(PX4), component=1))
    gate.observe(pack(parameter("FENCE_TYPE", 7), component=1))
    assert not isinstance(gate.seal(pack(message), NOW), Refusal)
    gate.observe(pack(m.MAVLink_heartbeat_message(2, PX4, 128, 0, 4, 3), component=1))
    assert gate.seal(pack(message), NOW) is AFTER_START
    gate.observe(pack(heartbeat(PX4), system=SYSTEM + 1, component=1))
    assert gate.seal(pack(message), NOW) is AFTER_START, "another vehicle tells nothing of this one"
    gate.observe(pack(heartbeat(PX4), component=1))
    assert not isinstance(gate.seal(pack(message), NOW), Refusal)


def test_before_a_vehicle_is_known_only_a_greeting_leaves() -> None:
    """On some links a vehicle waits for a first message."""
    gate = FrameSession()
    who = long(512, 0)  # asks for a HEARTBEAT
    for greeting in (ALWAYS[0], who):
        assert gate.seal(pack(greeting), NOW) == pack(greeting)
    for other in (
        pack(ALWAYS[0], system=255),
        pack(ALWAYS[0], component=1),
        pack(heartbeat(PX4)),
        pack(long(176, 1, 9)),
        pack(who, system=255),
        pack(who, component=1),
        pack(long(512, 148)),
        pack(long(512, 0, 1)),
        pack(long(511, 0)),
        pack(long(400, 0)),
    ):
        assert gate.seal(other, NOW) is NO_VEHICLE


def test_we_speak_as_ourselves_and_to_the_autopilot_alone() -> None:
    gate = session(PX4, command(K.LAND))
    assert gate.seal(pack(ALWAYS[0], component=190), NOW) is NOT_OURS
    assert gate.seal(pack(ALWAYS[0], system=255), NOW) is NOT_OURS
    for system, component in ((0, 1), (SYSTEM + 1, 1), (SYSTEM, 0), (SYSTEM, 154)):
        message = long(176, 1, 4, 6, system=system, component=component)
        assert gate.seal(pack(message), NOW) is WRONG_TARGET
        asking = m.MAVLink_param_request_list_message(system, component)
        assert gate.seal(pack(asking), NOW) is WRONG_TARGET


def test_a_camera_is_asked_for_reports_on_images_and_for_nothing_else() -> None:
    gate = session(PX4, command(K.LAND))
    for allowed in (
        long(512, 263, 7, component=100),
        long(512, 263, 16_777_216, component=105),
        long(512, 262, component=101),
    ):
        assert isinstance(gate.seal(pack(allowed), NOW), bytes), allowed
    for refused in (
        long(512, 263, 7, component=99),
        long(512, 263, 7, component=106),
        long(512, 263, 7, component=154),
        long(512, 263, 7, component=0),
        long(512, 263, 7, system=SYSTEM + 1, component=100),
        long(512, 263, 7, 1, component=100),
        long(512, 262, 1, component=100),
        long(512, 259, component=100),
        long(511, 263, 100_000, component=100),
        long(2000, 0, 0, 1, 1, component=100),
        long(400, 1, component=100),
        long(400, 1, 21196, component=100),
        m.MAVLink_command_int_message(SYSTEM, 100, 0, 512, 0, 0, 263, 7, 0, 0, 0, 0, 0),
        m.MAVLink_param_request_list_message(SYSTEM, 100),
    ):
        assert gate.seal(pack(refused), NOW) is WRONG_TARGET, refused
    assert session(PX4).seal(pack(long(512, 263, 7, component=100)), NOW) is not WRONG_TARGET
    assert FrameSession().seal(pack(long(512, 263, 7, component=100)), NOW) is NO_VEHICLE


def test_a_command_begins_in_its_time_and_goes_on_after_it() -> None:
    gate, land = session(PX4, command(K.LAND)), pack(long(176, 1, 4, 6))
    assert gate.seal(land, LATEST + 1) is LATE
    assert gate.seal(land, LATEST) == land
    assert gate.seal(land, LATEST + 5_000_000) == land
    gate.open(command(K.LAND))
    assert gate.seal(land, LATEST + 5_000_000) is LATE, "another command begins anew"


@pytest.mark.parametrize("autopilot", [PX4, ARDUPILOT])
def test_a_path_is_flown_point_after_point(autopilot: int) -> None:
    """A leg out of order would be unchecked. A path may pass one place twice."""
    a, b, c = (100, 100), (200, 100), (200, 300)
    path = (a, b, a, c)
    covering = Command(
        7, "skill", K.COVER, (), tuple(part for point in path for part in point), 20_000, 4_000, not_after_us=LATEST
    )

    def to(point: tuple[int, int]) -> bytes:
        x, y = point
        return pack(reposition(x=x, y=y) if autopilot == PX4 else target(lat_int=x, lon_int=y))

    gate = session(autopilot, covering)
    assert gate.seal(to(b), NOW) is OUT_OF_ORDER
    for point, later in ((a, c), (a, c), (b, c), (b, c), (a, (1, 1)), (c, b), (c, a)):
        assert isinstance(gate.seal(to(later), NOW), Refusal)
        assert gate.seal(to(point), NOW) == to(point)
    assert gate.seal(to(a), NOW) is OUT_OF_ORDER, "and never back"
    gate.open(covering)
    assert gate.seal(to(c), NOW) is OUT_OF_ORDER
    assert gate.seal(to(a), NOW) == to(a)


def test_frames_of_a_finished_or_second_command_are_refused() -> None:
    gate = session(ARDUPILOT, command(K.LAND))
    gate.open(command(K.HOLD))
    assert not covers(gate, long(176, 1, 9))
    assert covers(gate, long(176, 1, 17))
    gate.close()
    assert gate.seal(pack(long(176, 1, 17)), NOW) is NO_SESSION


def damaged(frame: bytes) -> Iterable[bytes]:
    yield b""
    yield frame[:-1]
    yield frame + b"\0"
    yield frame + frame
    yield b"\xfe" + frame[1:]
    yield frame[:2] + b"\1" + frame[3:]  # says that it is signed
    yield frame[:3] + b"\1" + frame[4:]
    yield frame[:9] + b"\1" + frame[10:]  # another message, whose number ends alike
    yield frame[:1] + bytes([255]) + frame[2:10] + frame[10:-2].ljust(255, b"\0") + frame[-2:]
    yield bytes(8)


def test_only_one_whole_unsigned_frame_leaves() -> None:
    gate = session(PX4, command(K.LAND))
    for octets in damaged(pack(long(176, 1, 4, 6))):
        assert gate.seal(octets, NOW) is NOT_ONE_FRAME


@EACH
def test_no_octet_that_the_autopilot_acts_on_may_change(
    autopilot: int, message: Any, kinds: tuple[MotionKind, ...]
) -> None:
    """Every bit of the whole payload is flipped; a frame that passes must mean the same."""
    gate = session(autopilot, command(kinds[0]))
    frame = pack(message)
    size = LAYOUTS[message.get_msgId()].fields.size
    whole = frame[:1] + bytes([size]) + frame[2:10] + frame[10:-2].ljust(size, b"\0") + frame[-2:]
    assert gate.seal(whole, NOW) == whole
    meant = meaning(message.get_type(), whole)
    passed = set()
    for bit in range(8 * size):
        turned = bytearray(whole)
        turned[10 + bit // 8] ^= 1 << bit % 8
        if isinstance(gate.seal(bytes(turned), NOW), bytes):
            passed.add(bit // 8)
            assert same(meaning(message.get_type(), bytes(turned)), meant), (bit, turned)
    assert len(passed) < size


def meaning(name: str, frame: bytes) -> tuple[Any, ...]:
    """The fields of a frame that an autopilot acts on, read by pymavlink."""
    kind = m.mavlink_map[int.from_bytes(frame[7:10], "little")]
    values = dict(zip(kind.ordered_fieldnames, kind.unpacker.unpack(frame[10:-2]), strict=True))
    ignored = {
        "COMMAND_LONG": ("confirmation",),
        "COMMAND_INT": ("current", "autocontinue"),
        "SET_POSITION_TARGET_GLOBAL_INT":
            ("time_boot_ms", "vx", "vy", "vz", "afx", "afy", "afz", "yaw", "yaw_rate"),
    }[name]  # fmt: skip
    return tuple(value for field, value in values.items() if field not in ignored)


def same(got: tuple[Any, ...], meant: tuple[Any, ...]) -> bool:
    """Equal except for the rounding of floats, home's height, and the kind of NaN."""
    return all(
        one == other or (one != one and other != other) or (isinstance(one, float) and abs(one - other) <= 2.002)
        for one, other in zip(got, meant, strict=True)
    )


def test_no_message_that_we_do_not_know_leaves() -> None:
    """Of the whole dialect, with random payloads, in every session."""
    chance = Random(7)
    gates = [session(autopilot, command(kind)) for autopilot in (PX4, ARDUPILOT) for kind in K]
    for number, kind in m.mavlink_map.items():
        payload = chance.randbytes(kind.unpacker.size)
        frame = bytes([0xFD, len(payload), 0, 0, 0, SYSTEM, OURS]) + number.to_bytes(3, "little") + payload + b"\0\0"
        passed = any(isinstance(gate.seal(frame, NOW), bytes) for gate in gates)
        assert not passed or number in (111, 253), kind.msgname  # TIMESYNC and STATUSTEXT may have any content


class FakeSigner:
    def __init__(self) -> None:
        self.asked: list[tuple[bytes, int]] = []

    def sign(self, frame: bytes, now_us: int) -> bytes:
        self.asked.append((frame, now_us))
        return b"signed " + frame


def test_only_passing_frames_are_signed() -> None:
    signer = FakeSigner()
    gate = FrameSession()
    gate.sign_with(signer)
    with pytest.raises(RuntimeError, match="signed already"):
        gate.sign_with(FakeSigner())
    gate.observe(pack(heartbeat(PX4), component=1))
    gate.open(command(K.LAND))
    land = pack(long(176, 1, 4, 6))
    assert gate.seal(land, NOW) == b"signed " + land
    assert gate.seal(pack(long(176, 1, 4, 5)), NOW) is NOT_COVERED
    assert signer.asked == [(land, NOW)]


# ---------------------------------------------------------------- parameters that a preparation lists


def test_a_frame_that_is_not_signed_ahead_does_not_count_as_refused() -> None:
    """No attempt to send it was recorded."""
    gate, of = session(PX4), command(K.LAND)
    assert gate.sign_ahead(b"no frame", of, NOW) is NOT_ONE_FRAME
    assert gate.sign_ahead(pack(m.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)), of, NOW) is NOT_COVERED
    assert gate.chain.stopped == 0
    assert gate.chain.aside == START


def test_a_flood_to_sign_ahead_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(signing, "MOST_AHEAD", 50)
    gate, of = session(PX4), command(K.LAND)
    gate.sign_with(SignedLink(bytes(32), SigningState(0, {}), EPOCH_US, NOW))
    land = pack(long(176, 1, 4, 6))
    found = [gate.sign_ahead(land, of, NOW) for _ in range(51)]
    assert isinstance(found[-2], bytes)
    assert found[-1] is TOO_MANY_AHEAD


def bits(value: float) -> int:
    found = bits_of(value)
    assert found is not None
    return found


def setting(name: str, value: float, kind: int = 9) -> Any:
    return m.MAVLink_param_set_message(SYSTEM, 1, name.encode(), value, kind)


def down(gate: FrameSession, autopilot: int, at_us: int = NOW, *, landed: int = 1, mode: int = 0) -> None:
    gate.observe(pack(m.MAVLink_heartbeat_message(2, autopilot, mode, 0, 4, 3), component=1), at_us)
    gate.observe(pack(m.MAVLink_extended_sys_state_message(0, landed), component=1), at_us)


def prepared(autopilot: int, name: str, value: float) -> FrameSession:
    gate = session(autopilot)
    down(gate, autopilot)
    gate.prepare([ParameterWrite(name, 0, bits(value))], LATEST)
    return gate


def test_listed_parameter_is_set_only_to_its_listed_value() -> None:
    gate = prepared(ARDUPILOT, "FENCE_RADIUS", 300.0)
    assert covers(gate, setting("FENCE_RADIUS", 300.0))
    assert covers(gate, setting("FENCE_RADIUS", 300.0, 4)), "ArduPilot has the type of its own"
    for other in (
        setting("FENCE_RADIUS", 300.0001),
        setting("FENCE_RADIUS", 50.0),
        setting("FENCE_RADIUS", nan),
        setting("FENCE_RADIUSX", 300.0),
        setting("FENCE_ALT_MAX", 300.0),
    ):
        assert gate.seal(pack(other), NOW) is NOT_LISTED
    gate.prepared()
    assert gate.seal(pack(setting("FENCE_RADIUS", 300.0)), NOW) is NOT_LISTED


def test_px4s_integers_are_listed_by_their_number() -> None:
    gate = prepared(PX4, "GF_ACTION", 3.0)
    three = struct.unpack("<f", struct.pack("<i", 3))[0]
    assert covers(gate, setting("GF_ACTION", three, 6))
    assert gate.seal(pack(setting("GF_ACTION", 3.0, 6)), NOW) is NOT_LISTED, "as an integer these octets are another"
    assert gate.seal(pack(setting("GF_ACTION", three, 9)), NOW) is NOT_LISTED


@pytest.mark.parametrize(("landed", "mode", "age_us"), [
    (2, 0, 0), (3, 0, 0), (4, 0, 0), (0, 0, 0), (1, 128, 0), (1, 0, STANDS_US),
], ids=["in the air", "takes off", "lands", "does not say", "armed", "said so long ago"])  # fmt: skip
def test_parameter_is_not_set_unless_on_ground(landed: int, mode: int, age_us: int) -> None:
    at_us = NOW + 10 * STANDS_US
    gate = session(ARDUPILOT)
    gate.prepare([ParameterWrite("FENCE_RADIUS", 0, bits(300.0))], at_us)
    down(gate, ARDUPILOT, at_us - age_us, landed=landed, mode=mode)
    assert gate.seal(pack(setting("FENCE_RADIUS", 300.0)), at_us) is NOT_DOWN
    down(gate, ARDUPILOT, at_us)
    assert covers_at(gate, setting("FENCE_RADIUS", 300.0), at_us)
    assert gate.seal(pack(setting("FENCE_RADIUS", 300.0)), at_us + 1) is NOT_LISTED, "its time is over"


def covers_at(gate: FrameSession, message: Any, at_us: int) -> bool:
    return isinstance(gate.seal(pack(message), at_us), bytes)


def test_vehicle_without_landed_report_is_not_on_ground() -> None:
    gate = session(ARDUPILOT)
    gate.observe(pack(heartbeat(ARDUPILOT), component=1))
    gate.observe(pack(m.MAVLink_extended_sys_state_message(0, 1), component=1))
    assert not gate.stands(0)
    assert not gate.stands(NOW)


def test_position_of_another_vehicle_is_ignored() -> None:
    gate = session(ARDUPILOT)
    other = SYSTEM + 1
    gate.observe(pack(heartbeat(ARDUPILOT), component=1), NOW)
    gate.observe(pack(m.MAVLink_extended_sys_state_message(0, 1), system=other, component=1), NOW)
    gate.observe(pack(parameter("FENCE_TYPE", 15), system=other, component=1), NOW)
    gate.observe(pack(parameter("FENCE_RADIUS", 15), component=1), NOW)
    assert not gate.stands(NOW)
    assert not covers(gate, setting("FENCE_TYPE", 15))


def test_a_command_ends_a_preparation() -> None:
    gate = prepared(ARDUPILOT, "FENCE_RADIUS", 300.0)
    gate.open(command(K.CLIMB))
    assert not gate.stands(NOW)
    assert gate.seal(pack(setting("FENCE_RADIUS", 300.0)), NOW) is NOT_LISTED
    gate.close()
    assert gate.seal(pack(setting("FENCE_RADIUS", 300.0)), NOW) is NOT_LISTED
    gate.prepare([ParameterWrite("FENCE_RADIUS", 0, bits(300.0))], LATEST)
    assert covers(gate, setting("FENCE_RADIUS", 300.0)), "down again, it may be put back"


def test_invalid_fence_type_is_ignored() -> None:
    gate = session(ARDUPILOT)
    gate.observe(pack(parameter("FENCE_TYPE", nan), component=1))
    assert covers(gate, setting("FENCE_TYPE", 4))
    assert gate.seal(pack(setting("FENCE_TYPE", 7)), NOW) is NOT_LISTED
