"""Frames in datagrams: pymavlink is the oracle."""

import struct
from itertools import pairwise
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v10 import ardupilotmega as old
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.gateway.frames import (
    MOST_SHARED,
    asks_for_control,
    good_frames,
    numbers_in,
    parcels,
    upgraded,
    without,
)
from rtshcua.mavlink.framing import frames_in, with_flags

SPEAKER = mavlink.MAVLink(None, srcSystem=7, srcComponent=8)
OLD = old.MAVLink(None, srcSystem=7, srcComponent=8)


def some(number: int) -> bytes:
    """One of some frames of several messages and lengths."""
    messages = (
        mavlink.MAVLink_heartbeat_message(2, 3, 0, number, 0, 3),
        mavlink.MAVLink_attitude_message(number, 0, 0, 0, 0, 0, 0),
        mavlink.MAVLink_command_ack_message(400, 0),
        mavlink.MAVLink_statustext_message(6, b"low battery" * 4),
        mavlink.MAVLink_named_value_int_message(number, b"x", number),
    )
    return bytes(messages[number % len(messages)].pack(SPEAKER))


SOME = tuple(some(number) for number in range(10))
NUMBERS = (0, 30, 77, 253, 252)
several = st.lists(st.sampled_from(range(10)), min_size=1, max_size=30)


@given(several)
def test_whole_frames_and_their_numbers(picked: list[int]) -> None:
    datagram = b"".join(SOME[each] for each in picked)
    assert list(numbers_in(datagram) or ()) == [NUMBERS[each % 5] for each in picked]
    assert list(frames_in(datagram)) == [SOME[each] for each in picked]
    assert good_frames(datagram) == ([SOME[each] for each in picked], 0)
    assert without(datagram, {0, 77}) == b"".join(SOME[each] for each in picked if NUMBERS[each % 5] not in {0, 77})


@given(several, st.integers(1, 400), st.sampled_from((b"", b"\0", b"\xfd", b"\xfe", b"\xfd\xff\0")))
def test_cut_or_extended_datagram_is_not_whole(picked: list[int], cut: int, more: bytes) -> None:
    frames = [SOME[each] for each in picked]
    whole = b"".join(frames)
    ends = {sum(map(len, frames[:count])) for count in range(len(frames) + 1)}
    part = whole[: max(0, len(whole) - cut)]
    if len(part) not in ends:
        assert numbers_in(part) is None
        assert good_frames(part) == ([], len(part))
    if more:
        assert numbers_in(whole + more) is None
    assert numbers_in(b"") is None


@given(st.binary(max_size=400))
def test_any_octets_are_taken(octets: bytes) -> None:
    found = numbers_in(octets)
    good, garbage = good_frames(octets)
    assert (found is None) <= (good == [] and garbage == len(octets))
    if found is not None:
        assert b"".join(frames_in(octets)) == octets


@given(st.sampled_from(range(10)), st.integers(1, 60), st.integers(1, 255))
def test_frame_with_a_changed_octet_is_no_good(picked: int, place: int, change: int) -> None:
    frame = bytearray(SOME[picked])
    place %= len(frame)
    frame[place] ^= change
    good, garbage = good_frames(bytes(frame))
    if frame[7:10] == SOME[picked][7:10]:  # another message number may be that of no known message
        assert good == []
        assert garbage == len(frame)


def test_frames_of_one_sender_are_left_out() -> None:
    speakers = [(1, 1), (1, 100), (2, 1)]
    frames = [
        bytes(mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 0, 3).pack(mavlink.MAVLink(None, *each)))
        for each in speakers
    ] + [bytes(old.MAVLink_heartbeat_message(2, 3, 0, 0, 0, 3).pack(old.MAVLink(None, 1, 154)))]
    assert without(b"".join(frames), {0}, (1, 1)) == b"".join(frames[1:])
    assert without(b"".join(frames), {0}, (1, 154)) == b"".join(frames[:3])
    assert without(b"".join(frames), {0}) == b""


def test_frames_before_a_bad_one_are_good() -> None:
    bad = SOME[1][:-1] + bytes([SOME[1][-1] ^ 1])
    assert good_frames(SOME[0] + bad + SOME[2]) == ([SOME[0]], len(bad) + len(SOME[2]))


def test_message_outside_of_the_dialect_cannot_be_verified() -> None:
    unknown = bytes([0xFD, 3, 0, 0, 1, 7, 8, 0xFF, 0xFF, 0x7F]) + bytes(5)
    assert good_frames(unknown) == ([unknown], 0)
    assert good_frames(unknown[:2] + b"\x02" + unknown[3:])[0] == []


def test_flag_that_nobody_knows_is_no_good() -> None:
    assert good_frames(with_flags(SOME[1], 2))[0] == []


@given(st.lists(st.integers(0, 9), min_size=1, max_size=200))
def test_parcels_keep_order_and_size(picked: list[int]) -> None:
    datagrams = [SOME[each] for each in picked]
    made = parcels(datagrams)
    assert b"".join(made) == b"".join(datagrams)
    assert all(len(each) <= MOST_SHARED for each in made)
    assert all(numbers_in(each) for each in made)
    # no two neighbours would fit into one
    assert all(len(one) + len(next(frames_in(two))) > MOST_SHARED for one, two in pairwise(made))


def test_long_datagram_is_divided_between_frames() -> None:
    made = parcels([b"".join(SOME) * 10])
    assert len(made) > 1
    assert all(len(each) <= MOST_SHARED and numbers_in(each) for each in made)


def test_frame_of_mavlink_1_becomes_the_same_message() -> None:
    chance = Random(1)
    for number, of in sorted(old.mavlink_map.items()):
        payload = chance.randbytes(struct.calcsize(of.unpacker.format))
        if chance.random() < 0.3:
            payload = payload[: len(payload) // 2] + bytes(len(payload) - len(payload) // 2)
        message = old.MAVLink_message(number, of.msgname)
        frame = bytes(message._pack(OLD, of.crc_extra, payload))
        assert frame[0] == 0xFE
        (made,), garbage = good_frames(frame)
        assert garbage == 0
        assert upgraded(frame) == made
        heard = mavlink.MAVLink(None).parse_buffer(made)
        assert len(heard) == 1, of.msgname
        assert (heard[0].get_srcSystem(), heard[0].get_srcComponent(), heard[0].get_msgId()) == (7, 8, number)
        assert made[10 : 10 + made[1]].ljust(len(payload), b"\0") == payload


def test_frame_of_mavlink_1_with_a_wrong_checksum_is_no_good() -> None:
    frame = bytes(old.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(OLD))
    assert good_frames(frame)[0] != []
    for place in range(1, len(frame)):
        changed = frame[:place] + bytes([frame[place] ^ 4]) + frame[place + 1 :]
        assert good_frames(changed)[0] == [], place


@pytest.mark.parametrize("frame", [SOME[0], b"\xfe\x00\x00\x01\x01\x03\x00\x00"])
def test_other_frames_stay_as_they_are(frame: bytes) -> None:
    assert upgraded(frame) == frame


@given(st.tuples(st.integers(0, 255), st.integers(0, 255)), st.sampled_from((0, 1, 7)), st.booleans(), st.booleans())
def test_requests_for_control_of_the_vehicle_are_told_from_those_to_others(
    target: tuple[int, int], system: int, whole: bool, asks: bool
) -> None:
    command = 32_100 if asks else 400
    made = mavlink.MAVLink_command_int_message if whole else mavlink.MAVLink_command_long_message
    values = (6, command, 0, 0, 0, 0, 0, 0, 0, 0, 0) if whole else (command, 0, 1, 0, 0, 0, 0, 0, 0)
    frame = bytes(made(*target, *values).pack(SPEAKER))
    to_vehicle = target[0] in (0, system) and target[1] in (0, 1)
    assert asks_for_control(frame, system) is (asks and (to_vehicle or system == 0))
    assert not any(asks_for_control(each, system) for each in SOME)
