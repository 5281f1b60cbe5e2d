from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v10 import ardupilotmega as mavlink1
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.generator.mavcrc import x25crc

from rtshcua.ground.gateway.client_frames import LAYOUTS_OF_CLIENTS, made, received
from rtshcua.mavlink import layouts
from rtshcua.mavlink.layouts import LAYOUTS

#: layouts that begin like the message but do not have all of its fields
SHORT = {69, 82, 242, 256}


def kinds() -> Iterator[tuple[int, Any]]:
    for number in sorted(LAYOUTS_OF_CLIENTS.keys() - LAYOUTS.keys() - {layouts.CONTROL_STATUS, layouts.COMMAND_CANCEL}):
        yield number, mavlink.mavlink_map[number]


def test_layouts_are_those_of_pymavlink() -> None:
    for number, of in kinds():
        layout = LAYOUTS_OF_CLIENTS[number]
        assert layout.extra == of.crc_extra, number
        starts = {name: sum(of.lengths[:place]) for place, name in enumerate(of.ordered_fieldnames)}
        blank = bytes(range(1, 256))[: of.unpacker.size]
        theirs = of.unpacker.unpack(blank)
        ours = layout.fields.unpack(blank[: layout.fields.size])
        if number not in SHORT:
            assert layout.fields.size >= of.unpacker.size - 20, number  # extensions of channels may be left out
        for name, value in zip(layout.names, ours, strict=True):
            if isinstance(value, bytes):
                assert name == "payload", number
            elif name in starts:
                assert value == theirs[starts[name]], (number, name)
            else:
                assert (number, name) in {(69, "target_system"), (256, "initial_timestamp")}, (number, name)


def test_a_control_status_has_the_layout_of_the_development_dialect() -> None:
    """By hand from development.xml of July 2026: flags, gcs_main, and ten secondary stations, which are 0 here."""
    frame = made(layouts.CONTROL_STATUS, {"gcs_main": 255, "flags": 1}, (1, 1), 7)
    assert frame[:12] == bytes([0xFD, 2, 0, 0, 7, 1, 1, 0x00, 0x02, 0, 1, 255])
    checksum = x25crc()
    checksum.accumulate_str("CONTROL_STATUS uint8_t flags uint8_t gcs_main uint8_t gcs_secondary ")
    checksum.accumulate(bytes([10]))
    assert LAYOUTS_OF_CLIENTS[layouts.CONTROL_STATUS].extra == (checksum.crc & 0xFF) ^ (checksum.crc >> 8)


def test_a_cancellation_has_the_layout_of_the_common_dialect() -> None:
    """By hand from common.xml: command, then the target. pymavlink does not have it in the dialect of ArduPilot."""
    frame = made(layouts.COMMAND_CANCEL, {"command": 0x1234, "target_system": 5, "target_component": 6}, (1, 1), 7)
    assert frame[:14] == bytes([0xFD, 4, 0, 0, 7, 1, 1, 80, 0, 0, 0x34, 0x12, 5, 6])
    checksum = x25crc()
    checksum.accumulate_str("COMMAND_CANCEL uint16_t command uint8_t target_system uint8_t target_component ")
    assert LAYOUTS_OF_CLIENTS[layouts.COMMAND_CANCEL].extra == (checksum.crc & 0xFF) ^ (checksum.crc >> 8)


def test_frames_of_the_second_version_are_read() -> None:
    """Those of the first one are converted by the relay."""
    message = mavlink.MAVLink_command_long_message(1, 1, 22, 0, 1.5, 0, 0, 0, 0, 0, 10)
    assert received(message.pack(mavlink1.MAVLink(None, 255, 190), force_mavlink1=True)) is None
    found = received(message.pack(mavlink.MAVLink(None, 255, 190)))
    assert found is not None
    assert found.sender == (255, 190)
    assert (found.fields["command"], found.number("param1"), found.number("param7")) == (22, 1.5, 10.0)
    assert found.is_for(1)
    assert not found.is_for(2)


def test_frames_for_other_components_are_not_for_the_autopilot() -> None:
    sender = mavlink.MAVLink(None, 255, 190)
    targets = {(0, 0): True, (1, 0): True, (1, 1): True, (1, 100): False, (9, 1): False, (0, 154): False}
    for (system, component), wanted in targets.items():
        message = mavlink.MAVLink_command_long_message(system, component, 2000, 0, 0, 0, 0, 0, 0, 0, 0)
        found = received(message.pack(sender))
        assert found is not None
        assert found.is_for(1) is wanted, (system, component)


def test_a_signed_frame_is_read_and_a_damaged_one_is_not() -> None:
    sender = mavlink.MAVLink(None, 255, 190)
    sender.signing.secret_key = bytes(32)
    sender.signing.sign_outgoing = True
    frame = mavlink.MAVLink_set_mode_message(1, 1, 4).pack(sender)
    found = received(frame)
    assert found is not None
    assert found.fields == {"custom_mode": 4, "target_system": 1, "base_mode": 1}
    for damaged in (
        frame[:-1], frame + b"\0", frame[:10], b"", b"\xfd", b"\xfe", bytes(12),
        bytes([*frame[:12], frame[12] ^ 1, *frame[13:]]),
        bytes([*frame[:2], 2, *frame[3:]]), bytes([*frame[:3], 1, *frame[4:]]),
    ):  # fmt: skip
        assert received(damaged) is None, damaged


def test_an_unknown_message_has_no_fields() -> None:
    found = received(bytes([0xFD, 1, 0, 0, 0, 9, 8, 0xFF, 0xFF, 0x00, 7, 0, 0]))
    assert found is not None
    assert (found.message, found.fields, found.sender) == (0xFFFF, {}, (9, 8))
    assert found.whole("any") == -1


def test_a_value_that_is_no_whole_number_is_none() -> None:
    sender = mavlink.MAVLink(None, 255, 190)
    values = {1.0: 1, -3.0: -3, 1.5: -1, float("nan"): -1, float("inf"): -1, float("-inf"): -1}
    for value, wanted in values.items():
        message = mavlink.MAVLink_command_long_message(1, 1, 1, 0, value, 0, 0, 0, 0, 0, 0)
        found = received(message.pack(sender))
        assert found is not None
        assert found.whole("param1") == wanted


def test_a_made_frame_is_one_for_pymavlink() -> None:
    frame = made(layouts.LOG_REQUEST_LIST, {"end": 0xFFFF, "target_system": 1, "target_component": 1}, (1, 191), 300)
    message = mavlink.MAVLink(None).decode(bytearray(frame))
    assert (message.get_type(), message.start, message.end, message.get_seq()) == ("LOG_REQUEST_LIST", 0, 0xFFFF, 44)
    with pytest.raises(ValueError, match="format"):
        made(layouts.LOG_REQUEST_LIST, {"end": 1 << 20}, (1, 191), 0)


@given(st.binary(max_size=300))
def test_no_octets_are_a_fault(octets: bytes) -> None:
    received(octets)
    received(b"\xfd" + octets)
    received(b"\xfe" + octets)
