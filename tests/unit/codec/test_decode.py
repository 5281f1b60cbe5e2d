"""Decoding, against pymavlink's own decoder: every kind of message, payloads of any bytes and any length."""

from random import Random

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec, Message, kind_of, maker
from rtshcua.mavlink.framing import checksum
from virtual.rows import rows

NOT_MADE = ("_header", "_payload", "_msgbuf", "_crc")


def frame_of(number: int, payload: bytes) -> bytes:
    head = bytes([0xFD, len(payload), 0, 0, 9, 1, 2]) + number.to_bytes(3, "little") + payload
    extra = bytes([mavlink.mavlink_map[number].crc_extra])
    return head + checksum(head[1:] + extra).to_bytes(2, "little")


def decoded(frame: bytes) -> Message:
    [received] = Codec(255, 0).parse(frame)
    return received.message


def test_decoded_messages_match_pymavlink() -> None:
    chance, receiver = Random(5), mavlink.MAVLink(None)
    for number, of in mavlink.mavlink_map.items():
        kind = kind_of(number)
        assert kind is not None
        assert kind.name == of.msgname
        size = of.unpacker.size
        for length in {1, size, max(1, size - 1), chance.randrange(1, size + 1), min(255, size + 9)}:
            frame = frame_of(number, chance.randbytes(length))
            ours, theirs = decoded(frame), receiver.decode(bytearray(frame))
            assert isinstance(ours, type(theirs))
            assert ours.get_type() == theirs.get_type()
            assert set(of.fieldnames) <= vars(ours).keys() <= vars(theirs).keys()
            for name, value in vars(theirs).items():
                assert name in NOT_MADE or repr(getattr(ours, name)) == repr(value), (of.msgname, name)


def test_messages_share_no_state() -> None:
    one, other = (decoded(frame_of(mavlink.MAVLINK_MSG_ID_HEARTBEAT, bytes([mode]))) for mode in (1, 2))
    one.custom_mode += 10
    assert (one.custom_mode, other.custom_mode) == (11, 2)


def test_decoded_message_packs_to_same_frame() -> None:
    sender = mavlink.MAVLink(None, 1, 2)
    sender.seq = 9
    for number in (0, 33, 76, 253):
        kind = kind_of(number)
        assert kind is not None
        frame = frame_of(number, bytes(range(1, 1 + kind.fields.size)))
        assert decoded(frame).pack(sender) == frame


def test_every_message_is_packed_as_pymavlink_packs_it() -> None:
    chance, ours, theirs = Random(6), Codec(3, 4), mavlink.MAVLink(None, 3, 4)
    for number, of in mavlink.mavlink_map.items():
        kind = kind_of(number)
        assert kind is not None
        for zeros in (0, of.unpacker.size // 2, of.unpacker.size):
            payload = chance.randbytes(of.unpacker.size - zeros).ljust(of.unpacker.size, b"\0")
            message = decoded(frame_of(number, payload))
            assert ours.pack(message) == message.pack(theirs), of.msgname
            theirs.seq = (theirs.seq + 1) % 256


def test_every_message_of_numbers_is_made_as_its_constructor_makes_it() -> None:
    for of in mavlink.mavlink_map.values():
        if "char" in of.fieldtypes:
            continue
        fields, defaults = list(range(len(of.fieldnames))), len(of.__init__.__defaults__ or ())
        for given in {len(fields), len(fields) - defaults}:
            ours, theirs = maker(of)(*fields[:given]), of(*fields[:given])
            assert isinstance(ours, type(theirs))
            assert set(of.fieldnames) <= vars(ours).keys() <= vars(theirs).keys()
            assert all(getattr(ours, name) == vars(theirs)[name] for name in vars(theirs) if name not in NOT_MADE)


@rows("bit", range(8 * 14))
def test_frame_with_wrong_checksum_is_refused(bit: int) -> None:
    frame = bytearray(frame_of(0, b"\1\2"))
    assert decoded(bytes(frame)).custom_mode == 0x201
    frame[bit // 8] ^= 1 << bit % 8
    assert Codec(255, 0).parse(bytes(frame)) == []


def test_message_not_in_dialect_has_no_kind() -> None:
    assert kind_of(60_000) is None
