"""The vehicle's MAVLink face: frames in, frames out."""

from collections.abc import Callable, Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec, Message, Received
from rtshcua.simulation import plan_face, questions
from rtshcua.simulation.autopilot import Autopilot
from rtshcua.simulation.command import from_message
from rtshcua.simulation.command_rules import UNSUPPORTED
from rtshcua.simulation.telemetry import radio_status

COMPONENT = mavlink.MAV_COMP_ID_AUTOPILOT1
FENCE_PREFIXES = ("FENCE_", "GF_")
"""How the names of the parameters begin that make the fence another one."""
RADIO = mavlink.MAV_COMP_ID_TELEMETRY_RADIO
_RADIO_INTERVAL_US = 1_000_000


class Face:
    """Answers for an autopilot as (system, 1), and for its radio as (system, 68)."""

    def __init__(self, autopilot: Autopilot, system: int) -> None:
        self._autopilot = autopilot
        self._system = system
        self._codec = Codec(system, COMPONENT)
        self._radio = Codec(system, RADIO)
        self._radio_due_us = 0

    @property
    def damaged(self) -> int:
        """How many stretches of bytes came that were no good frame."""
        return self._codec.damaged

    def handle(self, datagram: bytes) -> list[bytes]:
        """Obeys what a datagram holds; the frames that answer it. Never raises, whatever the bytes."""
        for received in self._codec.parse(datagram):
            handler = _HANDLERS.get(received.name)
            if handler is not None and self._is_for_me(received.message) and self._is_trusted(received):
                handler(self._autopilot, received)
                self._autopilot.tell_mode()
        return self._collect()

    def due(self) -> list[bytes]:
        """The frames to send now: streams that are due, and what happened since."""
        autopilot = self._autopilot
        for number in autopilot.streams.due(autopilot.now_us):
            autopilot.send(autopilot.reports.message(number))
        return self._collect()

    def radio_due(self, now_us: int) -> list[bytes]:
        """The frames that the radio sends now, by the world's time: it runs on while the autopilot's loop halts."""
        if now_us < self._radio_due_us:
            return []
        self._radio_due_us = now_us + _RADIO_INTERVAL_US
        return [self._radio.pack(radio_status(self._autopilot))]

    def _is_for_me(self, message: Message) -> bool:
        system = getattr(message, "target_system", 0)
        component = getattr(message, "target_component", 0)
        return system in (0, self._system) and component in (0, COMPONENT)

    def _is_trusted(self, received: Received) -> bool:
        a = self._autopilot
        return not a.signing.on or a.signing.lets_in(received, a.now_us, optional=not a.flavour.insists(a))

    def _collect(self) -> list[bytes]:
        a, outbox = self._autopilot, self._autopilot.outbox
        if not outbox:
            return []
        frames = [a.signing.seal(self._codec.pack(message), a.now_us) for message in outbox]
        outbox.clear()
        return frames


def _heartbeat(a: Autopilot, received: Received) -> None:
    if received.message.type == mavlink.MAV_TYPE_GCS:
        a.ground_station_seen = True


def _command(a: Autopilot, received: Received) -> None:
    command = from_message(received)
    handle = a.flavour.commands.get(command.number)
    results = (UNSUPPORTED,) if handle is None else handle(a, command)
    _acknowledge(a, received, command.number, results)


def _set_mode(a: Autopilot, received: Received) -> None:
    results = a.flavour.on_set_mode(a, received.message.custom_mode)
    _acknowledge(a, received, mavlink.MAVLINK_MSG_ID_SET_MODE, results)


def _acknowledge(a: Autopilot, received: Received, command: int, results: tuple[int, ...]) -> None:
    for result in results:
        a.send(mavlink.MAVLink_command_ack_message(command, result, 0, 0, received.system, received.component))


def _position_target(a: Autopilot, received: Received) -> None:
    a.flavour.on_position_target(a, received.message)


def _data_stream(a: Autopilot, received: Received) -> None:
    m = received.message
    a.flavour.on_data_stream(a, m.req_stream_id, m.req_message_rate if m.start_stop else 0)


def _param_read(a: Autopilot, received: Received) -> None:
    a.send(a.parameters.read(received.message.param_id, received.message.param_index))


def _param_list(a: Autopilot, _: Received) -> None:
    for message in a.parameters.all():
        a.send(message)


def _param_set(a: Autopilot, received: Received) -> None:
    m = received.message
    a.send(a.parameters.write(m.param_id, m.param_value, m.param_type))
    if m.param_id.startswith(FENCE_PREFIXES):
        a.fence.settings_changed()


def _setup_signing(a: Autopilot, received: Received) -> None:
    a.flavour.on_setup_signing(a, received.message)


def _timesync(a: Autopilot, received: Received) -> None:
    if received.message.tc1 == 0:
        a.send(mavlink.MAVLink_timesync_message(a.now_us * 1000, received.message.ts1))


def _ping(a: Autopilot, received: Received) -> None:
    m = received.message
    if m.target_system == 0:
        a.send(mavlink.MAVLink_ping_message(m.time_usec, m.seq, received.system, received.component))


_HANDLERS: Mapping[str, Callable[[Autopilot, Received], None]] = {
    "HEARTBEAT": _heartbeat,
    "COMMAND_LONG": _command,
    "COMMAND_INT": _command,
    "SET_MODE": _set_mode,
    "SET_POSITION_TARGET_GLOBAL_INT": _position_target,
    "REQUEST_DATA_STREAM": _data_stream,
    "PARAM_REQUEST_READ": _param_read,
    "PARAM_REQUEST_LIST": _param_list,
    "PARAM_SET": _param_set,
    "SETUP_SIGNING": _setup_signing,
    "TIMESYNC": _timesync,
    "PING": _ping,
    **plan_face.HANDLERS,
    **questions.HANDLERS,
}
