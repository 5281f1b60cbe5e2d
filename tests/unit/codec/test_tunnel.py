"""Messages over TUNNEL frames: in any order, with losses and repetitions, and with hostile frames."""

from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec, ReceivedFrame
from rtshcua.codec.tunnel import (
    CHUNK,
    LONGEST,
    MOST_OF_ONE,
    MOST_OPEN,
    PAYLOAD_TYPE,
    Assembler,
    Whole,
    answer_name,
    messages,
    name_of,
)
from virtual.rows import rows

NAME = b"12345678"


def frames(data: bytes, kind: int = 1, name: bytes = NAME) -> list[ReceivedFrame]:
    """Encode and decode frames."""
    codec = Codec(1, 191)
    found = [codec.parse(codec.pack(message)) for message in messages(kind, name, data)]
    assert all(len(each) == 1 for each in found)
    return [each for (each,) in found]


def crafted(payload: bytes, length: int | None = None, payload_type: int = PAYLOAD_TYPE) -> ReceivedFrame:
    codec = Codec(1, 191)
    octets = list(payload.ljust(128, b"\0"))
    message = mavlink.MAVLink_tunnel_message(0, 0, payload_type, len(payload) if length is None else length, octets)
    (found,) = codec.parse(codec.pack(message))
    return found


def head(index: int, count: int, name: bytes = NAME) -> bytes:
    return b"\1" + name + index.to_bytes(2, "little") + count.to_bytes(2, "little")


@rows("length", [1, CHUNK - 1, CHUNK, CHUNK + 1, 3 * CHUNK, 1_000, LONGEST])
def test_tunnel_roundtrip(length: int) -> None:
    data = bytes(n % 251 for n in range(length))
    assembler = Assembler()
    found = [assembler.take("a", frame) for frame in frames(data)]
    assert found[-1] == Whole(1, NAME, data)
    assert not any(found[:-1])
    assert assembler.unfinished == 0


def test_trailing_zeros_are_preserved() -> None:
    (frame,) = frames(b"x" + bytes(40))
    assert Assembler().take("a", frame) == Whole(1, NAME, b"x" + bytes(40))


@pytest.mark.parametrize("length", [0, LONGEST + 1])
def test_message_of_invalid_length_is_refused(length: int) -> None:
    with pytest.raises(ValueError):
        list(messages(1, NAME, bytes(length)))


@given(st.binary(min_size=1, max_size=2_000), st.integers(0, 2**32))
def test_lost_repeated_and_out_of_order(data: bytes, seed: int) -> None:
    """Each round loses half of the frames at random; repetitions fill the gaps."""
    chance, assembler, whole, rounds = Random(seed), Assembler(), None, 0
    while whole is None:
        sent = frames(data) * 2
        chance.shuffle(sent)
        for frame in sent:
            if chance.random() < 0.5 and whole is None:
                whole = assembler.take("a", frame)
        rounds += 1
        assert rounds < 100
    assert whole == Whole(1, NAME, data)


@rows(
    "frame",
    [
        crafted(b""),
        crafted(head(0, 1)),
        crafted(head(0, 1) + b"x", length=200),
        crafted(head(0, 1) + b"x", payload_type=0),
        crafted(head(1, 1) + b"x"),
        crafted(head(0, 0) + b"x"),
        crafted(head(0, 2) + b"short"),
        crafted(head(0, 65_535) + b"x" * CHUNK),
    ],
    ids=range(8),
)
def test_foreign_frames_are_ignored(frame: ReceivedFrame) -> None:
    assembler = Assembler()
    assert assembler.take("a", frame) is None
    assert assembler.unfinished == 0


def test_other_messages_are_passed_over() -> None:
    codec = Codec(1, 191)
    (found,) = codec.parse(codec.pack(mavlink.MAVLink_ping_message(1, 2, 3, 4)))
    assert Assembler().take("a", found) is None


def test_contradicting_chunks_discard_the_message() -> None:
    data = bytes(range(200))
    first, second = frames(data)
    for bad in (crafted(head(0, 2) + b"x" * CHUNK), crafted(head(0, 3) + b"x" * CHUNK)):
        assembler = Assembler()
        assert assembler.take("a", first) is None
        assert assembler.take("a", bad) is None
        assert assembler.unfinished == 0
        assert assembler.take("a", second) is None
        assert assembler.take("a", first) == Whole(1, NAME, data)


def test_senders_do_not_disturb_each_other() -> None:
    data = bytes(range(200))
    first, second = frames(data)
    assembler = Assembler()
    assembler.take("a", first)
    assembler.take("b", crafted(head(0, 2) + b"x" * CHUNK))
    assert assembler.take("a", second) == Whole(1, NAME, data)


def test_memory_is_bounded() -> None:
    assembler = Assembler()
    for sender in range(100):
        for number in range(10):
            assembler.take(sender, crafted(head(0, 2, number.to_bytes(8, "big")) + b"x" * CHUNK))
            assert assembler.unfinished <= MOST_OPEN
    alone = Assembler()
    for number in range(10):
        alone.take("a", crafted(head(0, 2, number.to_bytes(8, "big")) + b"x" * CHUNK))
    assert alone.unfinished == MOST_OF_ONE


@given(st.lists(st.binary(max_size=128), max_size=30))
def test_arbitrary_input_raises_nothing(payloads: list[bytes]) -> None:
    assembler = Assembler()
    for payload in payloads:
        assembler.take("a", crafted(payload))
    assert assembler.unfinished <= MOST_OF_ONE


def test_names() -> None:
    assert name_of(b"a") != name_of(b"b")
    assert len(name_of(b"")) == len(NAME)
    assert len({answer_name(name, data) for name in (NAME, b"23456789") for data in (b"a", b"b")}) == 4
    assert len(answer_name(NAME, b"")) == len(NAME)
