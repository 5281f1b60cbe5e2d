"""Build the MAVLink messages that adapters send; unused fields are filled in here."""

from collections import deque
from copy import copy
from functools import lru_cache
from math import radians
from typing import Any, Final, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as dialect

from rtshcua.codec.frames import kind_of
from rtshcua.mavlink import enums
from rtshcua.mavlink.layouts import COMMAND_LONG, TEXT_OCTETS
from rtshcua.mavlink.modes import CopterMode, Px4Mode
from rtshcua.model.flat.mission import ALONG, TURN
from rtshcua.onboard.ports import StatusText

NAN = float("nan")

DO_SET_MODE = enums.MAV_CMD_DO_SET_MODE
ARM_DISARM = enums.MAV_CMD_COMPONENT_ARM_DISARM
TAKEOFF = enums.MAV_CMD_NAV_TAKEOFF
REPOSITION = enums.MAV_CMD_DO_REPOSITION
CHANGE_SPEED = enums.MAV_CMD_DO_CHANGE_SPEED
SET_INTERVAL = enums.MAV_CMD_SET_MESSAGE_INTERVAL
REQUEST_MESSAGE = enums.MAV_CMD_REQUEST_MESSAGE
RUN_PREARM_CHECKS = enums.MAV_CMD_RUN_PREARM_CHECKS
FENCE = enums.MAV_MISSION_TYPE_FENCE
RALLY = enums.MAV_MISSION_TYPE_RALLY

Message = Any  # one of pymavlink's classes

_ZEROS = (0.0,) * 7
_COMMAND_LONG = kind_of(COMMAND_LONG)
assert _COMMAND_LONG is not None
_COMMAND = _COMMAND_LONG

_AUTOPILOT = enums.MAV_COMP_ID_AUTOPILOT1


def heartbeat() -> Message:
    """HEARTBEAT of an onboard controller, never of a ground station: that would hide the loss of the real one."""
    return dialect.MAVLink_heartbeat_message(
        enums.MAV_TYPE_ONBOARD_CONTROLLER, enums.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3
    )


def command(system: int, number: int, *parameters: float) -> Message:
    """COMMAND_LONG with up to seven parameters, the rest 0."""
    filled = (*parameters, *_ZEROS[len(parameters) :])
    return _COMMAND.build(*filled, number, system, _AUTOPILOT, 0)  # in wire order


def payload_command(system: int, component: int, number: int, confirmation: int, *parameters: float) -> Message:
    """COMMAND_LONG to a component of the vehicle, with all seven parameters."""
    return _COMMAND.build(*parameters, number, system, component, confirmation)  # in wire order


def set_mode(system: int, mode: Px4Mode | CopterMode) -> Message:
    """DO_SET_MODE to a custom mode."""
    return command(system, DO_SET_MODE, enums.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, *mode.parameters)


def arm(system: int) -> Message:
    """Arm, never by force."""
    return command(system, ARM_DISARM, 1, 0)


def reposition_amsl(
    system: int, latitude: int, longitude: int, amsl_m: float, speed_mm_s: int, heading: int = ALONG
) -> Message:
    """DO_REPOSITION as COMMAND_INT: 1e-7 degree, metres above mean sea level, changing the mode (not `in_hold`).

    Without a heading, PX4 turns the nose along the leg (`MPC_YAW_MODE`); with one, it keeps it from the start of the
    leg on (`Navigator::run`: `rep->current.yaw`, in radians).
    """
    made = _reposition(system, speed_mm_s / 1_000 if speed_mm_s else -1.0, latitude, longitude, amsl_m)
    if heading != ALONG:
        made.param4 = _yaw(heading)
    return made


def stop_here(system: int) -> Message:
    """DO_REPOSITION without place, height or heading: PX4 brakes and stays where it stops ("pause"). As COMMAND_INT,
    where INT32_MAX stands for the NaN of a float (vehicles.md 5; PX4: `Navigator`, DO_REPOSITION).
    """
    return _reposition(system, -1.0, enums.NO_PLACE, enums.NO_PLACE, NAN)


def in_hold(reposition: Message) -> Message:
    """The same DO_REPOSITION for a vehicle in Hold: it requests no mode, so it cannot undo a pilot's mode. PX4 from
    1.14 to 1.17 answers "unsupported" and obeys it, but only in Hold and within half a second (recorded;
    `Navigator::run`, `Loiter::on_active`); from 1.18 on it answers correctly (pull request 27563).
    """
    made = copy(reposition)
    made.param2 = 0.0
    return made


def _reposition(system: int, speed_m_s: float, latitude: int, longitude: int, amsl_m: float) -> Message:
    return dialect.MAVLink_command_int_message(
        system, _AUTOPILOT, enums.MAV_FRAME_GLOBAL, REPOSITION, 0, 0,
        speed_m_s, enums.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE, 0, NAN, latitude, longitude, amsl_m,
    )  # fmt: skip


def position_target(system: int, latitude: int, longitude: int, height_m: float, heading: int = ALONG) -> Message:
    """SET_POSITION_TARGET_GLOBAL_INT: a place at a height in metres above home, and the heading of the nose."""
    mask, yaw = (enums.POSITION_ONLY, 0.0) if heading == ALONG else (enums.POSITION_AND_YAW, _yaw(heading))
    return dialect.MAVLink_set_position_target_global_int_message(
        0, system, _AUTOPILOT, enums.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, mask,
        latitude, longitude, height_m, 0, 0, 0, 0, 0, 0, yaw, 0,
    )  # fmt: skip


def _yaw(heading: int) -> float:
    """A heading in 1/100 degree as a yaw in radians, from -pi to pi."""
    return radians((heading if heading <= TURN // 2 else heading - TURN) / 100)


def number_of(message: str) -> int | None:
    """The message's number on the wire; None when the dialect has no such message."""
    number: int | None = getattr(dialect, f"MAVLINK_MSG_ID_{message}", None)
    return number


def message_interval(system: int, message: str, interval_us: int) -> Message:
    """SET_MESSAGE_INTERVAL by the name of a message that the dialect has."""
    return command(system, SET_INTERVAL, number_of(message) or 0, interval_us)


@lru_cache(maxsize=16)
def request(system: int, message: str) -> Message:
    """REQUEST_MESSAGE: once, by the name of a message in the dialect. The returned message is shared: send it only."""
    return command(system, enums.MAV_CMD_REQUEST_MESSAGE, number_of(message) or 0)


def request_of(system: int, component: int, message: str, parameter: int = 0) -> Message:
    """REQUEST_MESSAGE to a component, with parameter 2: the index of an image."""
    padded = (number_of(message) or 0, parameter, 0.0, 0.0, 0.0, 0.0, 0.0)
    return _COMMAND.build(*padded, REQUEST_MESSAGE, system, component, 0)  # in wire order


def time_sync(now_ns: int) -> Message:
    """TIMESYNC with our monotonic time, which is returned together with the vehicle's."""
    return dialect.MAVLink_timesync_message(0, now_ns)


def status_text(severity: int, text: str) -> Message:
    """STATUSTEXT of at most 50 octets."""
    return dialect.MAVLink_statustext_message(severity, text.encode("ascii", "replace")[:TEXT_OCTETS])


def parameter_read(system: int, name: str) -> Message:
    """PARAM_REQUEST_READ by name."""
    return dialect.MAVLink_param_request_read_message(system, _AUTOPILOT, name.encode(), -1)


def parameter_set(system: int, name: str, value: float, kind: int) -> Message:
    """PARAM_SET; the value is encoded as the flavour needs it."""
    return dialect.MAVLink_param_set_message(system, _AUTOPILOT, name.encode(), value, kind)


class FenceItem(NamedTuple):
    """One MISSION_ITEM_INT: the command, a place in 1e-7 degree, and `param1`: corners of its ring, or radius in m."""

    command: int
    latitude: int
    longitude: int
    parameter: float


def fence_count(system: int, items: int) -> Message:
    """MISSION_COUNT of a fence that is to be uploaded."""
    return dialect.MAVLink_mission_count_message(system, _AUTOPILOT, items, FENCE)


def fence_item(system: int, number: int, frame: int, item: FenceItem) -> Message:
    """MISSION_ITEM_INT of a fence."""
    return dialect.MAVLink_mission_item_int_message(
        system, _AUTOPILOT, number, frame, item.command, 0, 1, item.parameter, 0, 0, 0, item.latitude, item.longitude,
        0, FENCE,
    )  # fmt: skip


def fence_list(system: int) -> Message:
    """MISSION_REQUEST_LIST: request the number of items of the fence."""
    return dialect.MAVLink_mission_request_list_message(system, _AUTOPILOT, FENCE)


def rally_list(system: int) -> Message:
    """MISSION_REQUEST_LIST: request the number of rally points."""
    return dialect.MAVLink_mission_request_list_message(system, _AUTOPILOT, RALLY)


def rally_received(system: int) -> Message:
    """MISSION_ACK that ends this request: only the number is wanted."""
    return dialect.MAVLink_mission_ack_message(system, _AUTOPILOT, dialect.MAV_MISSION_ACCEPTED, RALLY)


def fence_request(system: int, number: int) -> Message:
    """MISSION_REQUEST_INT: one item of the fence."""
    return dialect.MAVLink_mission_request_int_message(system, _AUTOPILOT, number, FENCE)


def fence_received(system: int) -> Message:
    """MISSION_ACK that ends a download."""
    return dialect.MAVLink_mission_ack_message(system, _AUTOPILOT, dialect.MAV_MISSION_ACCEPTED, FENCE)


LONGEST: Final = 200  # characters
#: A text whose next chunk is missing is taken as complete after this long.
CHUNK_US: Final = 1_000_000
#: How many texts are accepted at once, and how often one more is; the rest is counted.
BURST: Final = 20
EARNED_US: Final = 500_000


def quoted(text: str) -> str:
    """The text with all characters that do not print, or that a terminal or log could interpret, as escapes."""
    return "".join([each if each.isprintable() else each.encode("unicode_escape").decode() for each in text])[:LONGEST]


class StatusTexts:
    """Collects the texts of one component, up to a limit. A long text comes in chunks with one `id` (MAVLink 2)."""

    def __init__(self) -> None:
        self._id = 0
        #: the chunks of an incomplete text
        self.parts: list[str] = []
        self._severity = 0
        self._at_us = 0
        self._left = BURST
        self._paid_us: int | None = None
        self._dropped = 0

    def take(self, message: Any, now_us: int) -> list[StatusText]:
        """Take in one STATUSTEXT; return the texts that are complete now."""
        part: str = message.text
        said: list[StatusText] = []
        if not (self.parts and message.id == self._id and message.chunk_seq == len(self.parts)):
            said += self._finish(now_us)
        self._id, self._severity, self._at_us = message.id, message.severity, now_us
        self.parts.append(part)
        if len(part) < TEXT_OCTETS or not message.id or len(self.parts) * TEXT_OCTETS >= LONGEST:
            said += self._finish(now_us)
        return said

    def due(self, now_us: int) -> list[StatusText]:
        """The text whose end did not come in time."""
        return self._finish(now_us) if self.parts and now_us - self._at_us > CHUNK_US else []

    def _finish(self, now_us: int) -> list[StatusText]:
        text = quoted("".join(self.parts).rstrip("\0\t\r\n "))
        self.parts = []
        if not text:
            return []
        if self._paid_us is None:
            self._paid_us = now_us
        earned = (now_us - self._paid_us) // EARNED_US
        self._left = min(BURST, self._left + earned)
        self._paid_us += earned * EARNED_US
        if not self._left:
            self._dropped += 1
            return []
        self._left -= 1
        if self._dropped:
            text, self._dropped = f"{text} ({self._dropped} texts before it were left out)", 0
        return [StatusText(now_us, self._severity, text)]


#: How many texts may wait: older ones are dropped.
KEPT: Final = 4
EACH_US: Final = 200_000


class Announcer:
    """Keeps texts for ground stations until the link is idle."""

    def __init__(self) -> None:
        #: the texts to send
        self.waiting: deque[tuple[int, str]] = deque(maxlen=KEPT)
        self._sent_us: int | None = None

    def add(self, severity: int, text: str) -> None:
        """Queue a text; a long one is cut to 50 octets."""
        self.waiting.append((severity, text))

    def due(self, now_us: int, *, busy: bool) -> list[Message]:
        """The next text, unless the link is busy or was just used for one."""
        if busy or not self.waiting or (self._sent_us is not None and now_us - self._sent_us < EACH_US):
            return []
        self._sent_us = now_us
        return [status_text(*self.waiting.popleft())]
