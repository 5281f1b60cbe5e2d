"""The mission protocol's messages, handed to the vehicle's end of it."""

from collections.abc import Callable, Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Received
from rtshcua.simulation.autopilot import Autopilot


def _peer(received: Received) -> tuple[int, int]:
    return received.system, received.component


def _count(a: Autopilot, received: Received) -> None:
    m = received.message
    a.transfer.count(_peer(received), m.mission_type, m.count, a.now_us)


def _item(a: Autopilot, received: Received) -> None:
    a.transfer.item(_peer(received), received.message, a.now_us)


def _request_list(a: Autopilot, received: Received) -> None:
    a.transfer.request_list(_peer(received), received.message.mission_type, a.now_us)


def _request(a: Autopilot, received: Received) -> None:
    a.transfer.request(_peer(received), received.message, a.now_us)


def _acknowledged(a: Autopilot, received: Received) -> None:
    a.transfer.acknowledged(_peer(received), received.message.type, a.now_us)


def _clear_all(a: Autopilot, received: Received) -> None:
    a.transfer.clear_all(_peer(received), received.message.mission_type)


def _set_current(a: Autopilot, received: Received) -> None:
    """MISSION_SET_CURRENT: answered with MISSION_CURRENT, or with a text."""
    if not a.mission.select(received.message.seq):
        a.say(mavlink.MAV_SEVERITY_CRITICAL, "WPM: WP CURR CMD: Not in list")


def _partial(a: Autopilot, received: Received) -> None:
    """Parts of a plan are not read or written: refused at once."""
    result, kind = mavlink.MAV_MISSION_UNSUPPORTED, received.message.mission_type
    a.send(mavlink.MAVLink_mission_ack_message(*_peer(received), result, kind))


HANDLERS: Mapping[str, Callable[[Autopilot, Received], None]] = {
    "MISSION_COUNT": _count,
    "MISSION_ITEM": _item,
    "MISSION_ITEM_INT": _item,
    "MISSION_REQUEST_LIST": _request_list,
    "MISSION_REQUEST": _request,
    "MISSION_REQUEST_INT": _request,
    "MISSION_ACK": _acknowledged,
    "MISSION_CLEAR_ALL": _clear_all,
    "MISSION_SET_CURRENT": _set_current,
    "MISSION_REQUEST_PARTIAL_LIST": _partial,
    "MISSION_WRITE_PARTIAL_LIST": _partial,
}
