"""Frames: round trips, and good frames among garbage."""

import random
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec
from rtshcua.mavlink import tlog

DATA = Path(__file__).parents[1] / "mavlink" / "data"


def heartbeat(custom_mode: int = 0) -> object:
    return mavlink.MAVLink_heartbeat_message(2, 12, 29, custom_mode, 3, 3)


def unknown_frame(payload: bytes, number: int = 60_000) -> bytes:
    assert number not in mavlink.mavlink_map
    return bytes([0xFD, len(payload), 0, 0, 0, 1, 1]) + number.to_bytes(3, "little") + payload + b"\x12\x34"


def test_round_trip() -> None:
    sender, receiver = Codec(7, 191), Codec(1, 1)
    first, second = sender.pack(heartbeat(11)), sender.pack(heartbeat(12))
    received = receiver.parse(first + second)
    assert [(r.name, r.system, r.component, r.sequence, r.message.custom_mode) for r in received] == [
        ("HEARTBEAT", 7, 191, 0, 11),
        ("HEARTBEAT", 7, 191, 1, 12),
    ]
    assert [r.frame for r in received] == [first, second]
    assert not any(r.signed for r in received)
    assert (receiver.damaged, receiver.unknown, receiver.foreign) == (0, 0, 0)


def test_sequence_wraps() -> None:
    sender = Codec(1, 1)
    assert [Codec(1, 1).parse(sender.pack(heartbeat()))[0].sequence for _ in range(258)][-3:] == [255, 0, 1]


def test_only_selected_systems_are_received() -> None:
    receiver = Codec(1, 191, only={1})
    good = receiver.parse(Codec(2, 1).pack(heartbeat()) + Codec(1, 1).pack(heartbeat()))
    assert [r.system for r in good] == [1]
    assert receiver.foreign == 1


def test_bad_checksum_is_counted_and_the_next_frame_found() -> None:
    receiver = Codec(1, 1)
    bad = bytearray(Codec(1, 1).pack(heartbeat(3)))
    bad[12] ^= 1
    assert [r.message.custom_mode for r in receiver.parse(bytes(bad) + Codec(1, 1).pack(heartbeat(4)))] == [4]
    assert receiver.damaged == 1


def test_checksum_cannot_be_switched_off() -> None:
    assert mavlink.MAVLINK_IGNORE_CRC == 0


def test_every_truncation_yields_nothing() -> None:
    frame = Codec(1, 1).pack(heartbeat(0x01020304))
    for length in range(len(frame)):
        receiver = Codec(1, 1)
        assert receiver.parse(frame[:length]) == []
        assert receiver.damaged == (1 if length else 0)


def test_undefined_incompatibility_flag_is_refused() -> None:
    frame = bytearray(Codec(1, 1).pack(heartbeat()))
    frame[2] |= 0x02
    receiver = Codec(1, 1)
    assert receiver.parse(bytes(frame)) == []
    assert receiver.damaged == 1


def test_frame_inside_an_unknown_message_is_not_taken_for_one() -> None:
    inner = Codec(1, 1).pack(heartbeat(99))
    receiver = Codec(1, 1)
    good = receiver.parse(unknown_frame(b"xx" + inner) + Codec(1, 1).pack(heartbeat(5)))
    assert [r.message.custom_mode for r in good] == [5]
    assert (receiver.unknown, receiver.damaged) == (1, 0)


def test_frame_inside_a_known_message_is_not_taken_for_one() -> None:
    inner = Codec(1, 1).pack(heartbeat(99))
    text = mavlink.MAVLink_statustext_message(6, inner.ljust(50, b"\0"))
    assert [r.name for r in Codec(1, 1).parse(Codec(1, 1).pack(text))] == ["STATUSTEXT"]


def test_recorded_frames() -> None:
    for name, autopilot, count in (("px4", 12, 225), ("arducopter", 3, 40)):
        receiver = Codec(255, 190)
        entries = list(tlog.read((DATA / f"{name}.tlog").read_bytes()))
        received = [frame for entry in entries for frame in receiver.parse(entry.frame)]
        assert len(received) + receiver.unknown == len(entries) == count
        assert receiver.damaged == 0
        assert {(r.system, r.component) for r in received} == {(1, 1)}
        assert {r.message.autopilot for r in received if r.name == "HEARTBEAT"} == {autopilot}


def test_recorded_signed_frames() -> None:
    receiver = Codec(255, 190)
    received = [
        frame
        for entry in tlog.read((DATA / "arducopter-signed.tlog").read_bytes())
        for frame in receiver.parse(entry.frame)
    ]
    assert len(received) == 4
    assert all(frame.signed for frame in received)


def test_random_bytes_never_raise_and_never_hide_the_next_datagram() -> None:
    chance = random.Random(2)
    receiver, sender = Codec(1, 1), Codec(1, 1)
    for number in range(2_000):
        noise = bytearray(chance.randbytes(chance.randrange(600)))
        for _ in range(chance.randrange(4)):  # start markers make the parser try
            if noise:
                noise[chance.randrange(len(noise))] = 0xFD
        receiver.parse(bytes(noise))
        assert [r.message.custom_mode for r in receiver.parse(sender.pack(heartbeat(number)))] == [number]


def test_any_payload_with_a_right_checksum_decodes_or_is_counted() -> None:
    chance = random.Random(3)
    receiver = Codec(1, 1)
    kinds = list(mavlink.mavlink_map.items())
    for _ in range(2_000):
        number, kind = chance.choice(kinds)
        payload = chance.randbytes(chance.randrange(1, 256))
        frame = bytes([0xFD, len(payload), 0, 0, 0, 1, 1]) + number.to_bytes(3, "little") + payload
        checksum = mavlink.x25crc(frame[1:])
        checksum.accumulate(bytes([kind.crc_extra]))
        assert len(receiver.parse(frame + checksum.crc.to_bytes(2, "little"))) == 1


@settings(max_examples=settings().max_examples * 2)
@given(st.lists(st.one_of(st.binary(max_size=40), st.integers(0, 2**32 - 1)), max_size=8), st.data())
def test_good_frames_survive_garbage_without_markers(parts: list[bytes | int], data: st.DataObject) -> None:
    sender, receiver = Codec(1, 1), Codec(1, 1)
    datagram, expected = b"", []
    for part in parts:
        if isinstance(part, int):
            datagram += sender.pack(heartbeat(part))
            expected.append(part)
        else:
            datagram += part.replace(b"\xfd", b"\x00")
    assert [r.message.custom_mode for r in receiver.parse(datagram)] == expected
