"""The vehicle counts as started again by the time since its start, in a frame whose checksum is right."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.ground.gateway.client_frames import made
from rtshcua.ground.gateway.vehicle_seen import VehicleSeen
from rtshcua.mavlink import layouts

TIMED = (layouts.SYSTEM_TIME, layouts.GLOBAL_POSITION_INT)


def frame(number: int, boot_ms: int) -> bytes:
    return made(number, {"time_boot_ms": boot_ms, "lat": 473_977_400, "time_unix_usec": 5}, (1, 1), 0)


def damaged(octets: bytes) -> bytes:
    return octets[:-1] + bytes([octets[-1] ^ 1])


def restarts(*frames: bytes) -> list[bool]:
    seen = VehicleSeen(1)
    return [seen.restarted(seen.take(each, 0)) for each in frames]


@pytest.mark.parametrize("number", TIMED)
def test_time_that_goes_back_is_another_start(number: int) -> None:
    times = 60_000, 60_020, 58_100, 60_000, 400, 0, 2_300, 100_000, 97_000
    found = restarts(*(frame(number, each) for each in times))
    assert found == [False, False, False, False, True, False, False, False, True]


@pytest.mark.parametrize("number", TIMED)
def test_a_damaged_frame_is_no_other_start(number: int) -> None:
    before, after = frame(number, 60_000), frame(number, 60_040)
    assert restarts(before, damaged(frame(number, 100)), after) == [False] * 3
    assert restarts(before, damaged(frame(number, 0xFFFF_FFFF)), after) == [False] * 3
    longer = before[:1] + b"\xff" + before[2:10] + bytes(257)
    assert restarts(before, longer, after) == [False] * 3


@given(st.lists(st.tuples(st.integers(0, 20_000), st.booleans()), max_size=12))
def test_damaged_frames_that_come_alone_change_nothing(frames: list[tuple[int, bool]]) -> None:
    """Among frames in order, a damaged one with any time, between two that are whole."""
    octets, now_ms = [], 100_000
    for other_ms, is_damaged in frames:
        now_ms += 100
        octets.append(frame(layouts.GLOBAL_POSITION_INT, now_ms))
        if is_damaged:
            octets.append(damaged(frame(layouts.GLOBAL_POSITION_INT, 90_000 + other_ms)))
    assert not any(restarts(*octets))
