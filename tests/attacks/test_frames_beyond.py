"""Frames that exceed the permit, by false reports of the adapter about the vehicle, or by sending all points at
once.
"""

from math import nan
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.enforcement.frames import HOME_MOVES, NOT_COVERED, OURS, OUT_OF_ORDER, FrameSession
from rtshcua.onboard.ports import Command

AUTOPILOT, ADAPTER = Codec(1, 1), Codec(1, OURS)
ARDUPILOT, PX4 = 3, 12  # MAV_AUTOPILOT
HOME = 488_000  # mm above mean sea level
A, B, C = (473_977_000, 85_456_000), (473_987_000, 85_456_000), (473_987_000, 85_476_000)
AT = 1_000_000


def says(message: Any) -> bytes:
    return AUTOPILOT.pack(message)


def at(latitude: int, longitude: int, home: int = HOME) -> bytes:
    return says(mavlink.MAVLink_global_position_int_message(0, latitude, longitude, home, 0, 0, 0, 0, 0))


def gate(autopilot: int, kind: MotionKind, *path: tuple[int, int]) -> FrameSession:
    """A gate that is open for a command at 20 m."""
    made = FrameSession()
    made.observe(says(mavlink.MAVLink_heartbeat_message(2, autopilot, 0, 0, 0, 3)))
    made.observe(at(*A))
    geo = tuple(part for point in path for part in point)
    made.open(Command(7, "skill", kind, geo, geo, 20_000, 0, not_after_us=2 * AT))
    return made


def takeoff(above_sea: float) -> bytes:
    return ADAPTER.pack(mavlink.MAVLink_command_long_message(1, 1, 22, 0, nan, 0, 0, nan, nan, nan, above_sea))


def target(autopilot: int, point: tuple[int, int]) -> bytes:
    if autopilot == PX4:
        return ADAPTER.pack(mavlink.MAVLink_command_int_message(1, 1, 0, 192, 0, 0, -1, 1, 0, nan, *point, 508.0))
    zeros = (0.0,) * 8
    return ADAPTER.pack(
        mavlink.MAVLink_set_position_target_global_int_message(0, 1, 1, 6, 0x0DF8, *point, 20.0, *zeros)
    )


def test_forged_home_in_flight_changes_no_height() -> None:
    """PX4 receives heights above sea: a home that is reported a kilometre too high would send it there."""
    opened = gate(PX4, MotionKind.CLIMB)
    for home in (HOME + 1_000_000, HOME - 1_000_000, HOME + HOME_MOVES + 1):
        opened.observe(at(*A, home=home))
        assert opened.seal(takeoff((home + 20_000) / 1_000), AT) is NOT_COVERED
        assert isinstance(opened.seal(takeoff(508.0), AT), bytes), "and what was true is true still"


def test_small_forged_changes_do_not_move_home() -> None:
    opened = gate(PX4, MotionKind.CLIMB)
    for home in range(HOME, HOME + 5 * HOME_MOVES, HOME_MOVES // 4):
        opened.observe(at(*A, home=home))
    assert opened.seal(takeoff((HOME + 20_000 + 2 * HOME_MOVES) / 1_000), AT) is NOT_COVERED


def test_home_may_drift_until_next_takeoff() -> None:
    opened = gate(PX4, MotionKind.CLIMB)
    for times in (1, 2):
        home = HOME + times * HOME_MOVES
        opened.observe(at(*A, home=home))
        assert isinstance(opened.seal(takeoff((home + 20_000) / 1_000), AT), bytes)
        opened.open(Command(8, "takeoff", MotionKind.CLIMB, (), (), 20_000, 0, not_after_us=2 * AT))


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4])
def test_path_points_are_sent_one_by_one(autopilot: int) -> None:
    """The direct leg from the start to the last point was never checked."""
    opened = gate(autopilot, MotionKind.COVER, A, B, C)
    opened.observe(at(*C))
    first, second, third = (target(autopilot, point) for point in (A, B, C))
    assert opened.seal(first, AT) == first
    assert opened.seal(second, AT) is OUT_OF_ORDER
    opened.observe(at(*A))
    assert opened.seal(second, AT) == second
    assert opened.seal(third, AT) is OUT_OF_ORDER
    opened.observe(at(B[0] - 300, B[1] + 300))
    assert opened.seal(third, AT) == third


def test_vehicle_without_position_is_sent_to_first_point_only() -> None:
    opened = FrameSession()
    opened.observe(says(mavlink.MAVLink_heartbeat_message(2, ARDUPILOT, 0, 0, 0, 3)))
    opened.open(Command(7, "skill", MotionKind.COVER, (), (*A, *B), 20_000, 0, not_after_us=2 * AT))
    assert isinstance(opened.seal(target(ARDUPILOT, A), AT), bytes)
    assert opened.seal(target(ARDUPILOT, B), AT) is OUT_OF_ORDER


@pytest.mark.parametrize("current", [1, 2, 3])
def test_fence_item_cannot_command_motion(current: int) -> None:
    """ArduPilot flies at once to an item whose `current` is 2, and takes only its height for 3."""
    opened = FrameSession()
    opened.observe(says(mavlink.MAVLink_heartbeat_message(2, ARDUPILOT, 0, 0, 0, 3)))

    def item(now: int) -> bytes:
        return ADAPTER.pack(mavlink.MAVLink_mission_item_int_message(1, 1, 0, 6, 5001, now, 1, 0, 0, 0, 0, *A, 9.0, 1))

    assert isinstance(opened.seal(item(0), AT), bytes)
    assert isinstance(opened.seal(item(current), AT), Refusal)
