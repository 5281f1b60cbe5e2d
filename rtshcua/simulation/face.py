"""The vehicle's MAVLink interface: frames in, frames out.

Requests for files, logs and partial plans are refused at once: QGroundControl sends them all when it connects, and
waits seconds for each missing answer.
"""

import struct
from collections.abc import Callable, Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec, Message, ReceivedFrame, maker
from rtshcua.mavlink.radio import RADIO, RADIO_SYSTEM
from rtshcua.simulation.autopilot import Autopilot
from rtshcua.simulation.command import from_message
from rtshcua.simulation.commands import UNSUPPORTED
from rtshcua.simulation.config import Equipment
from rtshcua.simulation.mission_protocol import Peer, Transfer
from rtshcua.simulation.telemetry import radio_status

COMPONENT = mavlink.MAV_COMP_ID_AUTOPILOT1
FENCE_PREFIXES = ("FENCE_", "GF_")
"""Name prefixes of the parameters that change the fence."""
_NEVER = 1 << 62

_COMMANDS = frozenset({"COMMAND_LONG", "COMMAND_INT"})
_COMMAND_ACK = maker(mavlink.MAVLink_command_ack_message)


class Face:
    """The MAVLink endpoint of an autopilot as (system, 1), and of its radio, if fitted, as (51, 68). The radio reports
    every `radio_us`.
    """

    def __init__(self, autopilot: Autopilot, system: int, radio_us: int = 1_000_000) -> None:
        self._autopilot = autopilot
        self._radio_us = radio_us
        self._system = system
        self._codec = Codec(system, COMPONENT)
        self._radio = Codec(RADIO_SYSTEM, RADIO)
        self._others: set[int] = set()  # the components of this system that were heard
        self.radio_due_us = 0 if Equipment.RADIO in autopilot.extras else _NEVER
        """When the radio sends next, in simulation time: the radio runs on while the autopilot's loop is halted."""

    @property
    def damaged(self) -> int:
        """The number of received byte sequences that were not valid frames."""
        return self._codec.damaged

    def parse(self, datagram: bytes) -> list[ReceivedFrame]:
        """Return the valid frames of a datagram, in order. Never raises."""
        return [] if self._autopilot.off_us else self._codec.parse(datagram)

    def lets_in(self, received: ReceivedFrame) -> bool:
        """Return whether a trusted frame is for the autopilot."""
        if received.system == self._system:
            self._others.add(received.component)
        return received.name in _HANDLERS and self._is_for_me(received)

    def trusts(self, received: ReceivedFrame) -> bool:
        """Return whether a frame may be obeyed: it is signed, or need not be. To be asked once for each frame."""
        a = self._autopilot
        return a.signing.accept(received, a.now_us) or a.flavour.obeys_unsigned(a, received.name)

    def obey(self, received: ReceivedFrame) -> list[bytes]:
        """Obey an accepted frame and return the answering frames. Never raises."""
        if self._autopilot.off_us:
            return []
        _HANDLERS[received.name](self._autopilot, received)
        self._autopilot.follow_mode()
        self._autopilot.tell_mode()
        return self._collect()

    def restart(self) -> None:
        """Restart the frame sequence after an autopilot restart."""
        damaged = self._codec.damaged
        self._codec = Codec(self._system, COMPONENT)
        self._codec.damaged = damaged

    def due(self) -> list[bytes]:
        """Return the frames to send now: due streams and queued messages."""
        autopilot = self._autopilot
        if autopilot.off_us:
            return []
        builders, outbox = autopilot.reports.builders, autopilot.outbox
        for number in autopilot.streams.due(autopilot.now_us):
            message = builders[number]()
            if message is not None:
                outbox.append(message)
        return self._collect() if outbox else []

    def radio(self, now_us: int) -> bytes:
        """Return the radio's frame, due since `radio_due_us`."""
        self.radio_due_us = now_us + self._radio_us
        return self._radio.pack(radio_status(self._autopilot))

    def _is_for_me(self, received: ReceivedFrame) -> bool:
        """Return whether a frame is addressed to the autopilot. ArduCopter obeys commands to components that it has not
        heard (recorded: 100 and 154); it would pass them on to others.
        """
        message = received.message
        if getattr(message, "target_system", 0) not in (0, self._system):
            return False
        component = getattr(message, "target_component", 0)
        if component in (0, COMPONENT):
            return True
        takes = self._autopilot.flavour.speaks_for_payload and received.name in _COMMANDS
        return takes and component not in self._others

    def _collect(self) -> list[bytes]:
        a, outbox = self._autopilot, self._autopilot.outbox
        frames = [self._codec.pack(message) for message in outbox]
        outbox.clear()
        return [a.signing.seal(frame, a.now_us) for frame in frames] if a.signing.on else frames


def _heartbeat(a: Autopilot, received: ReceivedFrame) -> None:
    if received.message.type == mavlink.MAV_TYPE_GCS:
        a.ground_station_seen = True


def _command(a: Autopilot, received: ReceivedFrame) -> None:
    command = from_message(received)
    handle = a.flavour.commands.get(command.number)
    results = (UNSUPPORTED,) if handle is None else handle(a, command)
    _acknowledge(a, received, command.number, results)


def _set_mode(a: Autopilot, received: ReceivedFrame) -> None:
    results = a.flavour.on_set_mode(a, received.message.custom_mode)
    _acknowledge(a, received, mavlink.MAVLINK_MSG_ID_SET_MODE, results)


def _acknowledge(a: Autopilot, received: ReceivedFrame, command: int, results: tuple[int, ...]) -> None:
    for result in results:
        a.send(_COMMAND_ACK(command, result, 0, 0, received.system, received.component))


def _position_target(a: Autopilot, received: ReceivedFrame) -> None:
    a.flavour.on_position_target(a, received.message)


def _local_target(a: Autopilot, received: ReceivedFrame) -> None:
    a.flavour.on_local_target(a, received.message)


def _data_stream(a: Autopilot, received: ReceivedFrame) -> None:
    m = received.message
    a.flavour.on_data_stream(a, m.req_stream_id, m.req_message_rate if m.start_stop else 0)


def _param_read(a: Autopilot, received: ReceivedFrame) -> None:
    a.send(a.parameters.read(received.message.param_id, received.message.param_index))


def _param_list(a: Autopilot, _: ReceivedFrame) -> None:
    for message in a.parameters.all():
        a.send(message)


def _param_set(a: Autopilot, received: ReceivedFrame) -> None:
    m = received.message
    a.send(a.parameters.write(m.param_id, m.param_value, m.param_type))
    if m.param_id.startswith(FENCE_PREFIXES):
        a.fence.settings_changed()


def _setup_signing(a: Autopilot, received: ReceivedFrame) -> None:
    a.flavour.on_setup_signing(a, received.message)


def _timesync(a: Autopilot, received: ReceivedFrame) -> None:
    if received.message.tc1 == 0:
        a.send(mavlink.MAVLink_timesync_message((a.now_us + a.since_us) * 1000, received.message.ts1))


def _ping(a: Autopilot, received: ReceivedFrame) -> None:
    m = received.message
    if m.target_system == 0:
        a.send(mavlink.MAVLink_ping_message(m.time_usec, m.seq, received.system, received.component))


def _transfers(step: Callable[[Transfer, Peer, Message, int], None]) -> Callable[[Autopilot, ReceivedFrame], None]:
    """Return a handler that passes a mission protocol message to the vehicle's transfer."""
    return lambda a, received: step(a.transfer, (received.system, received.component), received.message, a.now_us)


def _set_current(a: Autopilot, received: ReceivedFrame) -> None:
    """Handle MISSION_SET_CURRENT: answer with MISSION_CURRENT, or with a text."""
    if not a.mission.select(received.message.seq):
        a.say(mavlink.MAV_SEVERITY_CRITICAL, "WPM: WP CURR CMD: Not in list")


def _partial(a: Autopilot, received: ReceivedFrame) -> None:
    """Refuse partial reads and writes of a plan."""
    result, kind = mavlink.MAV_MISSION_UNSUPPORTED, received.message.mission_type
    a.send(mavlink.MAVLink_mission_ack_message(received.system, received.component, result, kind))


_NAK, _UNKNOWN_COMMAND = 129, 7
"""MAV_FTP_OPCODE and MAV_FTP_ERR."""
_FTP_SIZE = 251


def _file(a: Autopilot, received: ReceivedFrame) -> None:
    """Answer FILE_TRANSFER_PROTOCOL: the vehicle has no files."""
    m = received.message
    sequence, session, opcode = struct.unpack_from("<HBB", bytes(m.payload))
    head = struct.pack("<HBBBBBBIB", (sequence + 1) % 65_536, session, _NAK, 1, opcode, 0, 0, 0, _UNKNOWN_COMMAND)
    payload = list(head.ljust(_FTP_SIZE, b"\0"))
    a.send(mavlink.MAVLink_file_transfer_protocol_message(0, received.system, received.component, payload))


def _logs(a: Autopilot, _: ReceivedFrame) -> None:
    """Answer LOG_REQUEST_LIST: the vehicle has no logs."""
    a.send(mavlink.MAVLink_log_entry_message(0, 0, 0, 0, 0))


_HANDLERS: Mapping[str, Callable[[Autopilot, ReceivedFrame], None]] = {
    "HEARTBEAT": _heartbeat,
    "COMMAND_LONG": _command,
    "COMMAND_INT": _command,
    "SET_MODE": _set_mode,
    "SET_POSITION_TARGET_GLOBAL_INT": _position_target,
    "SET_POSITION_TARGET_LOCAL_NED": _local_target,
    "REQUEST_DATA_STREAM": _data_stream,
    "PARAM_REQUEST_READ": _param_read,
    "PARAM_REQUEST_LIST": _param_list,
    "PARAM_SET": _param_set,
    "SETUP_SIGNING": _setup_signing,
    "TIMESYNC": _timesync,
    "PING": _ping,
    "MISSION_COUNT": _transfers(Transfer.count),
    "MISSION_ITEM": _transfers(Transfer.item),
    "MISSION_ITEM_INT": _transfers(Transfer.item),
    "MISSION_REQUEST_LIST": _transfers(Transfer.request_list),
    "MISSION_REQUEST": _transfers(Transfer.request),
    "MISSION_REQUEST_INT": _transfers(Transfer.request),
    "MISSION_ACK": _transfers(Transfer.acknowledged),
    "MISSION_CLEAR_ALL": _transfers(Transfer.clear_all),
    "MISSION_SET_CURRENT": _set_current,
    "MISSION_REQUEST_PARTIAL_LIST": _partial,
    "MISSION_WRITE_PARTIAL_LIST": _partial,
    "FILE_TRANSFER_PROTOCOL": _file,
    "LOG_REQUEST_LIST": _logs,
}
