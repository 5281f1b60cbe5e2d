"""Requests of a ground station when it connects are answered or refused at once."""

import math
import struct
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20 import development

from rtshcua.model.faults import FlightMode, MessageSilence
from rtshcua.simulation.simulated_mark import marked_speed
from virtual import plans as p

Pilots = Callable[..., Any]


def modes_asked(a: Any, number: int) -> tuple[list[int], list[Any]]:
    """Return results and messages, decoded with a dialect that has them."""
    message = mavlink.MAVLink_command_long_message(1, 1, 512, 0, 435, number, 0, 0, 0, 0, 0)
    datagrams = a.simulation.receive(a.codec.pack(message), a.simulation.now_us)
    reader = development.MAVLink(None)
    read = [reader.decode(bytearray(datagram)) for datagram in datagrams]
    acks = [m.result for m in read if m.get_type() == "COMMAND_ACK"]
    return acks, [m for m in read if m.get_type() == "AVAILABLE_MODES"]


def test_modes_are_listed_together_and_singly(pilot: Pilots, flavour: str) -> None:
    a = pilot(flavour).ready()
    acks, modes = modes_asked(a, 0)
    table = a.simulation._autopilot.flavour.modes
    assert acks == [0]
    assert {m.custom_mode for m in modes} == set(table.numbers.values())
    assert [m.mode_index for m in modes] == list(range(1, len(modes) + 1))
    assert {m.number_modes for m in modes} == {len(modes)}
    by_number = {m.custom_mode: m for m in modes}
    assert by_number[table.numbers[FlightMode.MISSION]].standard_mode == 6
    assert by_number[table.numbers[FlightMode.RETURN]].mode_name == table.name(FlightMode.RETURN)
    acks, modes = modes_asked(a, 2)
    assert (acks, [m.mode_index for m in modes]) == ([0], [2])
    refused = 2 if a.px4 else 4
    assert modes_asked(a, 99) == ([refused], [])


@pytest.mark.parametrize("number", [397, 395, 300, 158, 263, 411])
def test_unknown_messages_are_refused(pilot: Pilots, flavour: str, number: int) -> None:
    a = pilot(flavour).ready()
    assert a.long(512, number) == [2 if a.px4 else 4]


@pytest.mark.parametrize("command", [519, 523, 2504, 31010, 9])
def test_unknown_commands_are_unsupported(pilot: Pilots, flavour: str, command: int) -> None:
    assert pilot(flavour).ready().long(command) == [3]


def test_file_and_log_requests_are_answered(pilot: Pilots, flavour: str) -> None:
    a = pilot(flavour).ready()
    ask = struct.pack("<HBBBBBBI", 65_535, 3, 4, 0, 0, 0, 0, 0).ljust(251, b"\0")
    a.send(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, list(ask)))
    sequence, session, opcode, size, asked = struct.unpack_from(
        "<HBBBB", bytes(a.last("FILE_TRANSFER_PROTOCOL").payload)
    )
    assert (sequence, session, opcode, size, asked) == (0, 3, 129, 1, 4)
    a.send(mavlink.MAVLink_log_request_list_message(1, 1, 0, 65_535))
    assert a.last("LOG_ENTRY").num_logs == 0


def test_autopilot_version_reports_capabilities(pilot: Pilots, flavour: str) -> None:
    a = pilot(flavour).ready()
    assert a.long(512, 148) == [0]
    has = a.last("AUTOPILOT_VERSION").capabilities
    for capability in ("MISSION_INT", "COMMAND_INT", "MISSION_FENCE", "MISSION_RALLY", "MAVLINK2"):
        assert has & getattr(mavlink, f"MAV_PROTOCOL_CAPABILITY_{capability}")
    for capability in ("FTP", "SET_ATTITUDE_TARGET", "FLIGHT_TERMINATION"):
        assert not has & getattr(mavlink, f"MAV_PROTOCOL_CAPABILITY_{capability}")
    assert marked_speed(a.last("AUTOPILOT_VERSION")) == 100, "that it is simulated, and how fast it lives"
    assert bytes(a.last("AUTOPILOT_VERSION").flight_custom_version) == bytes(8)


@pytest.mark.parametrize(
    ("flavour", "name", "type_", "value"),
    [
        ("px4", "GF_ACTION", 6, 3.0),
        ("px4", "MIS_TAKEOFF_ALT", 9, 7.5),
        ("px4", "RTL_RETURN_ALT", 9, 45.0),
        ("ardupilot", "FENCE_ENABLE", 2, 1.0),
        ("ardupilot", "RTL_ALT", 6, 1500.0),
        ("ardupilot", "WPNAV_SPEED", 9, 800.0),
    ],
)
def test_parameters_have_their_types(pilot: Pilots, flavour: str, name: str, type_: int, value: float) -> None:
    a = pilot(flavour).ready()

    def encoded(value: float) -> float:
        integer = a.px4 and type_ == 6
        return float(struct.unpack("<f", struct.pack("<i", int(value)))[0]) if integer else value

    a.send(mavlink.MAVLink_param_set_message(1, 1, name.encode(), encoded(value), 6 if a.px4 and type_ == 6 else 9))
    echo = a.last("PARAM_VALUE")
    assert (echo.param_id, echo.param_type, echo.param_value) == (name, type_, encoded(value))
    assert (echo.param_index == 65_535) is not a.px4
    a.send(mavlink.MAVLink_param_request_list_message(1, 1))
    listed = [f.message for f in a.seen if f.name == "PARAM_VALUE"][-a.last("PARAM_VALUE").param_count :]
    assert [m.param_index for m in listed] == list(range(len(listed)))
    assert [m.param_value for m in listed if m.param_id == name] == [encoded(value)]
    a.send(mavlink.MAVLink_param_request_read_message(1, 1, name.encode(), -1))
    assert a.last("PARAM_VALUE").param_value == encoded(value)


@pytest.mark.parametrize("name", ["MAV_SYS_ID", "SYSID_THISMAV"])
def test_system_id_is_a_parameter(pilot: Pilots, name: str) -> None:
    a = pilot("px4" if name == "MAV_SYS_ID" else "ardupilot", system=7).ready()
    a.send(mavlink.MAVLink_param_request_read_message(7, 1, name.encode(), -1))
    value = a.last("PARAM_VALUE").param_value
    assert (struct.unpack("<i", struct.pack("<f", value))[0] if a.px4 else value) == 7


def test_item_counts_are_parameters(pilot: Pilots) -> None:
    a = pilot("ardupilot").ready()
    p.upload(a, p.square(60), p.FENCE)
    assert (a.last("PARAM_VALUE").param_id, a.last("PARAM_VALUE").param_value) == ("FENCE_TOTAL", 4)
    p.upload(a, p.mission(a, [p.takeoff(5)]))
    assert (a.last("PARAM_VALUE").param_id, a.last("PARAM_VALUE").param_value) == ("MIS_TOTAL", 2)


def test_target_is_sent_on_request_if_there_is_one(pilot: Pilots, flavour: str) -> None:
    """Without a target PX4 denies the request; ArduCopter acknowledges it and sends nothing."""
    a = pilot(flavour).ready()
    asked = mavlink.MAVLink_command_long_message(1, 1, 512, 0, 87, 0, 0, 0, 0, 0, 0)
    (refused,) = a.send(asked)
    assert (refused.name, refused.message.result) == ("COMMAND_ACK", 2 if a.px4 else 0)
    a.take_off()
    a.go_to(40, 30, 20)
    a.wait(1)
    told = a.send(asked)
    assert {frame.name for frame in told} == {"POSITION_TARGET_GLOBAL_INT", "COMMAND_ACK"}
    assert [frame.message.result for frame in told if frame.name == "COMMAND_ACK"] == [0]


def test_ignored_parameter_writes_are_not_answered(pilot: Pilots, flavour: str) -> None:
    """PX4: a wrong type; ArduPilot: not a number; both: an unknown name."""
    a = pilot(flavour).ready()
    name, was = ("GF_ACTION", 2.0) if a.px4 else ("FENCE_RADIUS", 300.0)
    for parameter, value, kind in ((name, 3.0, 9) if a.px4 else (name, math.nan, 9), (name + "X", 1.0, 9)):
        replies = a.send(mavlink.MAVLink_param_set_message(1, 1, parameter.encode(), value, kind))
        assert [each.name for each in replies if each.name == "PARAM_VALUE"] == []
    a.send(mavlink.MAVLink_param_request_read_message(1, 1, name.encode(), -1))
    value = a.last("PARAM_VALUE").param_value
    assert (struct.unpack("<i", struct.pack("<f", value))[0] if a.px4 else value) == was


def test_silenced_message_is_not_sent_as_an_answer(pilot: Pilots, flavour: str) -> None:
    fault = MessageSilence(at_us=2_000_000, message="PARAM_VALUE", for_us=2_000_000)
    a = pilot(flavour, faults=(fault,))
    ask = mavlink.MAVLink_param_request_read_message(1, 1, b"RTL_RETURN_ALT" if a.px4 else b"RTL_ALT", -1)
    for at_s, answers in ((1, 1), (3, 0), (5, 1)):
        a.wait(at_s - a.simulation.now_us / 1_000_000)
        assert len([each for each in a.send(ask) if each.name == "PARAM_VALUE"]) == answers
