"""Frames from a byte stream, with any bytes between them."""

from random import Random

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec
from rtshcua.codec.stream import FrameStream
from rtshcua.mavlink.framing import checksum

CODEC = Codec(1, 1)
BEAT = CODEC.pack(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3))
TIME = CODEC.pack(mavlink.MAVLink_timesync_message(5, 0xFDFDFD))


def unknown(number: int = 410) -> bytes:
    """A frame of a message that the dialect does not have; its payload looks like the beginning of another one."""
    head = bytes([9, 0, 0, 7, 1, 1]) + number.to_bytes(3, "little")
    return b"\xfd" + head + b"\xfd" * 9 + checksum(head + b"\xfd" * 9).to_bytes(2, "little")


def old() -> bytes:
    """A heartbeat of MAVLink 1."""
    link = mavlink.MAVLink(None, 1, 1)
    packed: bytes = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3).pack(link, force_mavlink1=True)
    return packed


@pytest.mark.parametrize("size", [1, 2, 7, 1_000])
def test_frames_are_found_across_any_chunks(size: int) -> None:
    stream, data = FrameStream(), BEAT + b"noise" + TIME + unknown() + BEAT + b"\xfd" + TIME + BEAT
    found = [frame for at in range(0, len(data), size) for frame in stream.feed(data[at : at + size])]
    assert found == [BEAT, TIME, BEAT, TIME, BEAT]
    assert stream.counts.octets == len(data)
    assert (stream.counts.frames, stream.counts.garbage) == (5, len("noise") + 1)


def test_damaged_frame_loses_only_itself() -> None:
    stream, hurt = FrameStream(), bytearray(TIME)
    hurt[12] ^= 1
    assert stream.feed(BEAT + bytes(hurt) + TIME + BEAT) == [BEAT, TIME, BEAT]


def test_another_incompatibility_flag_begins_no_frame() -> None:
    odd = bytearray(BEAT)
    odd[2] = 4
    assert FrameStream().feed(bytes(odd) + BEAT) == [BEAT]


def test_frames_of_mavlink_1_are_counted_and_left_out() -> None:
    stream = FrameStream()
    assert stream.feed(old() + old() + BEAT) == [BEAT]
    assert (stream.counts.old, stream.counts.garbage) == (2, 0)


def test_unverifiable_frame_without_successor_is_scanned() -> None:
    stream = FrameStream()
    assert stream.feed(unknown()) == []
    assert stream.feed(b"x" + BEAT * 20)[-1] == BEAT


def test_garbage_is_counted_without_delaying_frames() -> None:
    stream, chance = FrameStream(), Random(1)
    assert stream.feed(chance.randbytes(5_000)) == []
    assert stream.counts.frames == 0
    assert stream.counts.garbage > 4_000
    for _ in range(30):  # longer than any apparent frame in the garbage
        found = stream.feed(BEAT)
    assert found == [BEAT]
