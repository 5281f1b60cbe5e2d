"""Requests of a gateway's clients: what is passed on to the vehicle, what is refused, and whose answers they get."""

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as m

from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.adapters.vehicle.link import SHORTEST_US
from rtshcua.codec.frames import Codec
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.enforcement.frames import OURS, FrameSession
from rtshcua.onboard.ports import Command
from virtual.policy import POLICY

AUTOPILOT = Codec(1, 1)


def driver(capacity: int | None = None) -> Driver:
    """A driver that has heard its vehicle and waits for no answer."""
    made = Driver(POLICY, FrameSession())
    made.carried_by(capacity)
    made.receive(AUTOPILOT.pack(m.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)), 1_000_000)
    return made


def frame(message: Any, component: int = OURS, system: int = 1) -> bytes:
    return Codec(system, component).pack(message)


def long(number: int, *parameters: float) -> Any:
    return m.MAVLink_command_long_message(1, 1, number, 0, *[*parameters, *[0.0] * (7 - len(parameters))])


def slug(of: Driver, message: Any, **more: int) -> str:
    sealed = of.pass_on(frame(message, **more), 2_000_000)
    return sealed.slug if isinstance(sealed, Refusal) else ""


PASSED: list[Any] = [
    m.MAVLink_param_request_read_message(1, 1, b"RTL_ALT", -1),
    m.MAVLink_param_request_list_message(1, 1),
    m.MAVLink_log_request_list_message(1, 1, 0, 0xFFFF),
    m.MAVLink_timesync_message(0, 5),
    long(512, 148),
    long(511, 74, SHORTEST_US),
    long(511, 74, -1),  # VFR_HUD, which this flight does not need
    long(511, 74, 0),
]
REFUSED: list[tuple[Any, str]] = [
    (m.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3), "not-a-request"),
    (m.MAVLink_statustext_message(6, b"land"), "not-a-request"),
    (m.MAVLink_mission_request_list_message(1, 1, 0), "not-a-request"),
    (m.MAVLink_mission_ack_message(1, 1, 0, 1), "not-a-request"),
    (m.MAVLink_mission_count_message(1, 1, 4, 1), "not-a-request"),
    (m.MAVLink_param_set_message(1, 1, b"FENCE_ENABLE", 1, 2), "not-a-request"),
    (m.MAVLink_log_request_data_message(1, 1, 1, 0, 90), "not-a-request"),
    (m.MAVLink_log_erase_message(1, 1), "not-a-request"),
    (m.MAVLink_manual_control_message(1, 0, 0, 500, 0, 0), "not-a-request"),
    (long(400, 1), "not-a-request"),
    (long(401), "not-a-request"),
    (long(176, 1, 4, 6), "not-a-request"),
    (long(511, float("nan"), 1), "not-a-request"),
    (long(511, 30, float("inf")), "not-a-request"),
    (long(511, 30, SHORTEST_US - 1), "rate"),
    (long(511, 0, 1_000_000), "rate"),  # HEARTBEAT
    (long(511, 77, -1), "rate"),  # COMMAND_ACK
    (long(511, 33, -1), "rate"),  # GLOBAL_POSITION_INT, which the policy needs
    (long(511, 33, 0), "rate"),
    (long(511, 33, 60_000_000), "rate"),
]


def test_what_is_passed_on() -> None:
    for message in PASSED:
        assert slug(driver(), message) == "", message


def test_what_is_refused_and_why() -> None:
    for message, why in REFUSED:
        assert slug(driver(), message) == why, message


def test_needed_report_may_become_more_frequent_and_no_rarer() -> None:
    made = driver()
    needed_us = made.stream_requests.plan.intervals["GLOBAL_POSITION_INT"]
    assert slug(made, long(511, 33, needed_us)) == ""
    assert slug(made, long(511, 33, needed_us + 1_000)) == "rate"


@pytest.mark.parametrize("more", [{"component": 190}, {"system": 255}, {"system": 2}])
def test_gate_refuses_other_senders_and_targets(more: dict[str, int]) -> None:
    assert slug(driver(), PASSED[1], **more) == "frame/not-ours"
    assert slug(driver(), m.MAVLink_param_request_list_message(1, 0)) == "frame/wrong-target"
    assert slug(driver(), m.MAVLink_param_request_list_message(2, 1)) == "frame/wrong-target"


def test_frame_of_the_permitted_command_is_no_request() -> None:
    """A gate that is open for a landing lets its frames out, but not as a request."""
    made = driver()
    gate = made.link._frames
    assert isinstance(gate, FrameSession)
    gate.open(Command(1, "land", MotionKind.LAND, (), (), 0, 0))
    land = long(176, 1, 4, 6)
    assert isinstance(gate.seal(frame(land), 2_000_000), bytes)
    assert slug(made, land) == "not-a-request"


def test_nothing_is_passed_on_before_a_vehicle_was_heard() -> None:
    assert slug(Driver(POLICY, FrameSession()), PASSED[0]) == "no-vehicle"


def test_octets_that_are_no_frame_are_refused() -> None:
    whole = frame(PASSED[0])
    for octets in (b"", b"x", whole[:-1], whole + whole, whole[:2] + b"\1" + whole[3:], bytes(300)):
        sealed = driver().pass_on(octets, 2_000_000)
        assert isinstance(sealed, Refusal)
        assert sealed.slug == "not-a-request"


def test_rates_of_a_line_of_known_capacity_are_not_changed() -> None:
    assert slug(driver(11_520), long(511, 30, 100_000)) == "rate"


def test_answer_to_a_passed_rate_is_not_taken_for_our_own() -> None:
    made = driver()
    requests = made.stream_requests
    assert slug(made, long(511, 30, 100_000)) == ""
    (ours, *_) = requests.due(1, 2_000_001)
    assert ours.command == 511
    assert slug(made, long(511, 30, 100_000)) == "busy"
    made.receive(AUTOPILOT.pack(m.MAVLink_command_ack_message(511, 4, 0, 0, 1, OURS)), 2_000_010)
    assert requests._asking is not None, "it was the answer to the client's request"
    made.receive(AUTOPILOT.pack(m.MAVLink_command_ack_message(511, 4, 0, 0, 1, OURS)), 2_000_020)
    assert requests._asking is None
    assert len(requests._refused) == 1
