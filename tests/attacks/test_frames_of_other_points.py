"""A permitted path at several heights, facing inward: an adapter that was taken over sends the right place at the
height of another point, a heading that was not permitted, or the next point before its turn. The boundary refuses all
of them.
"""

from math import nan, radians
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as m

from rtshcua.codec.frames import Codec
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import ALONG
from rtshcua.onboard.enforcement.frames import NOT_COVERED, OUT_OF_ORDER, FrameSession
from rtshcua.onboard.ports import Command
from virtual.rows import rows

SYSTEM, OURS, HOME_AMSL, NOW = 1, 191, 488_000, 1_000_000
PX4, ARDUPILOT = 12, 3
EAST, WEST = (473_977_000, 85_458_000), (473_977_000, 85_454_000)
#: two places, each at two heights, the second time facing another way
HEIGHTS, HEADINGS = (10_000, 10_000, 20_000, 20_000), (27_000, 9_000, 27_000, ALONG)
PATH = (EAST, WEST, EAST, WEST)
ORBIT = Command(
    7, "orbit", MotionKind.COVER, (), tuple(part for place in PATH for part in place), 20_000, 4_000,
    heights=HEIGHTS, headings=HEADINGS,
)  # fmt: skip
BOTH = pytest.mark.parametrize("autopilot", [PX4, ARDUPILOT])


def heard(message: Any) -> bytes:
    return Codec(SYSTEM, 1).pack(message)


def at(place: tuple[int, int], height: int) -> bytes:
    """A report that the vehicle is there."""
    return heard(
        m.MAVLink_global_position_int_message(0, *place, HOME_AMSL + height, height, 0, 0, 0, 0)
    )  # fmt: skip


def gate(autopilot: int) -> FrameSession:
    made = FrameSession()
    made.observe(heard(m.MAVLink_heartbeat_message(2, autopilot, 0, 0, 0, 3)))
    made.observe(at(WEST, 10_000))
    made.open(ORBIT)
    return made


def frame(autopilot: int, place: tuple[int, int], height: int, degrees: float | None) -> bytes:
    """To a place at a height, with the nose at a heading, or along the leg."""
    if autopilot == PX4:
        yaw = nan if degrees is None else radians(degrees)
        message = m.MAVLink_command_int_message(
            SYSTEM, 1, 0, 192, 0, 0, 4.0, 1, 0, yaw, *place, (HOME_AMSL + height) / 1_000
        )
    else:
        mask, yaw = (0x0DF8, 0) if degrees is None else (0x09F8, radians(degrees))
        message = m.MAVLink_set_position_target_global_int_message(
            0, SYSTEM, 1, 6, mask, *place, height / 1_000, 0, 0, 0, 0, 0, 0, yaw, 0
        )
    return Codec(SYSTEM, OURS).pack(message)


def test_the_whole_path_passes_in_its_order() -> None:
    for autopilot in (PX4, ARDUPILOT):
        of = gate(autopilot)
        for place, height, degrees in zip(PATH, HEIGHTS, (-90, 90, -90, None), strict=True):
            sent = frame(autopilot, place, height, degrees)
            assert of.seal(sent, NOW) == sent
            of.observe(at(place, height))


@rows(
    ("place", "height", "degrees", "refusal"),
    [
        (EAST, 20_000, -90, OUT_OF_ORDER),  # the right place at the height of the third point
        (WEST, 10_000, 90, OUT_OF_ORDER),  # the next point before its turn
        (EAST, 15_000, -90, NOT_COVERED),  # a height between those of its points
        (EAST, 10_000, -89, NOT_COVERED),
        (EAST, 10_000, -89.98, NOT_COVERED),
        (EAST, 10_000, 270, NOT_COVERED),  # the same heading, but not as it is sent
        (EAST, 10_000, None, NOT_COVERED),
        (WEST, 10_000, None, NOT_COVERED),  # along the leg is permitted there only at the other height
        (EAST, 10_000, 90, NOT_COVERED),  # the heading of the other place
    ],
)
@BOTH
def test_another_height_or_heading_is_refused(
    autopilot: int, place: tuple[int, int], height: int, degrees: float | None, refusal: Any
) -> None:
    assert gate(autopilot).seal(frame(autopilot, place, height, degrees), NOW) is refusal


@BOTH
def test_the_next_level_waits_until_the_height_is_reached(autopilot: int) -> None:
    """Above the right place, but far below: the leg from there was never checked."""
    of = gate(autopilot)
    path = [*zip(PATH, HEIGHTS, (-90, 90, -90, None), strict=True)]
    for place, height, degrees in path[:3]:
        assert isinstance(of.seal(frame(autopilot, place, height, degrees), NOW), bytes)
        of.observe(at(place, 10_000))
    last = frame(autopilot, *path[3])
    assert of.seal(last, NOW) is OUT_OF_ORDER
    of.observe(at(EAST, 16_999))
    assert of.seal(last, NOW) is OUT_OF_ORDER
    of.observe(at(EAST, 17_000))
    assert of.seal(last, NOW) == last
