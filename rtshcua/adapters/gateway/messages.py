"""The interface of the relay: its configuration, and the messages between it and the process that started it.

That process makes two pairs of `AF_UNIX`, `SOCK_SEQPACKET` sockets, keeps one end of each, and starts
`python -m rtshcua.adapters.gateway` with the other ends inherited and a `RelaySetup` as JSON on its standard input:

- the *control* socket carries the messages below, both ways: `kind` (1 octet), `client` (2, little-endian), payload;
- the *telemetry* socket carries the vehicle's frames to the starter: one or more whole frames a datagram, no header. It
  is lossy: what the reader does not take in time is dropped (and counted).

The relay ends with its starter: at the end of the control socket, or at SIGTERM; it ignores SIGINT. Each session
of FLIGHT has its own pair of `SOCK_SEQPACKET` sockets: the starter sends one end with a message `FLIGHT`
(`send_flight`), gives the other one to FLIGHT (`--connect fd:N`), and closes its own copies of both. The end of that
socket is the end of FLIGHT, and the relay reports it. Both ways a datagram has one or more whole frames.
"""

import socket
from collections.abc import Iterable
from enum import IntEnum
from struct import Struct
from typing import Final, NamedTuple

import msgspec

from rtshcua.mavlink import layouts

_HEAD: Final = Struct("<BH")
#: the most octets of a message or datagram on these sockets
LARGEST: Final = 1 << 16
#: the client number of an `ANSWER` to every client except pilots
EVERY_CLIENT: Final = 0xFFFF


class RelayKind(IntEnum):
    """The kinds of messages on the control socket. The relay sends the first ones, its starter the others."""

    READY = 1
    "All addresses are open. Payload: JSON, the address of each client in the order of the setup, as it is bound."
    FAILED = 2
    "The relay ends, because it could not open an address. Payload: JSON, a `SetupFailure`."
    UP = 3
    "The first whole frame of a client came. `client` is its number from now on. Payload: JSON, an `Up`."
    DOWN = 4
    "A client is gone: it disconnected, lost its place, or was silent for a minute. Payload: the reason, as text."
    CLIENT = 5
    """Frames of a client, within its limits, of which nothing went to the vehicle. Payload: one or more whole frames of
    MAVLink 2 (those of MAVLink 1 are converted), with a right checksum where the dialect has the message; their
    signatures were not verified."""
    PILOT = 6
    """Frames of a pilot, which went to the vehicle, except REQUEST_OPERATOR_CONTROL of its autopilot, or of any while
    the starter has not said which `VEHICLE` it is: that the starter answers. Payload: one or more whole frames."""
    FLIGHT_ENDED = 7
    "The socket of the session was closed by the other side. Nothing of it goes to the vehicle any more. No payload."
    COUNTERS = 8
    "Once a second. Payload: JSON, a `Counters`."

    ANSWER = 16
    "Payload: one or more whole frames for this client (or `EVERY_CLIENT`)."
    WITHHOLD = 17
    """Payload: the system of the vehicle's autopilot, 1 octet, and the message numbers, 3 octets each, little-endian,
    that this client does not get from that autopilot from now on, besides `DIALOGUES`. It replaces the previous list;
    one without numbers ends it."""
    FLIGHT = 18
    "A session begins: its socket is in the ancillary data. It replaces the previous one. No payload."
    VEHICLE = 19
    """Payload: the system of the vehicle, 1 octet. From now on what pilots send to other systems and components passes,
    also REQUEST_OPERATOR_CONTROL."""


#: what an ordinary client never gets from the vehicle, because it belongs to a dialogue with FLIGHT or with a pilot;
#: the answers of the gateway to the client's own dialogues come as `ANSWER`
DIALOGUES: Final = frozenset(
    {
        layouts.MISSION_WRITE_PARTIAL_LIST, layouts.MISSION_ITEM, layouts.MISSION_REQUEST, layouts.MISSION_REQUEST_LIST,
        layouts.MISSION_COUNT, layouts.MISSION_CLEAR_ALL, layouts.MISSION_ACK, layouts.MISSION_REQUEST_INT,
        layouts.MISSION_ITEM_INT, layouts.COMMAND_ACK, layouts.COMMAND_CANCEL, layouts.FILE_TRANSFER_PROTOCOL,
        layouts.SETUP_SIGNING, layouts.TUNNEL, layouts.CONTROL_STATUS,
    }
)  # fmt: skip


class ClientSetup(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A client's own address, as `adapters/vehicle/address.py` reads it, and its limits.

    `peers`: how many senders (`udpin`) or connections (`tcpin`) at once; each is a client with a number of its own.
    `rate`: frames a second that are passed on, and as many at once; a pilot has no such limit. A sender keeps its place
    until it was silent for `silence_s`, a connection too if it never sent a frame; then another one may take it.
    """

    name: str
    address: str
    pilot: bool = False
    peers: int = 4
    rate: int = 200
    silence_s: int = 10


class RelaySetup(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the relay is started with: the vehicle's address, the descriptors it inherits, and the clients.

    `silence_s`: how long the vehicle's sender (UDP) or connection keeps its place while another one is heard.
    """

    vehicle: str
    control: int
    telemetry: int
    clients: tuple[ClientSetup, ...]
    silence_s: int = 3


class SetupFailure(msgspec.Struct, frozen=True):
    """Why the relay cannot begin: the client's index in the setup, None for the vehicle; what was found, and help."""

    client: int | None
    text: str
    help: str


class Up(msgspec.Struct, frozen=True):
    """A new client: its index in the setup, and where it is (`127.0.0.1:40312`, or the device)."""

    index: int
    peer: str


class ClientCounts(msgspec.Struct):
    """Counts of one client since it is up: frames passed on from it, frames beyond its rate, octets that are no frame;
    octets sent to it, and datagrams for it that were lost.
    """

    client: int
    frames: int = 0
    dropped: int = 0
    garbage: int = 0
    sent: int = 0
    lost: int = 0


class Counters(msgspec.Struct):
    """Counts since the start: datagrams or reads of the vehicle's link, their octets, octets outside of frames,
    datagrams of strangers at the vehicle's address; datagrams lost for FLIGHT, on the telemetry socket, on the control
    socket; connections and senders for which a client's address had no place. `trouble`: why the vehicle cannot be
    heard.
    """

    vehicle: int = 0
    vehicle_octets: int = 0
    garbage: int = 0
    strangers: int = 0
    flight_lost: int = 0
    telemetry_lost: int = 0
    control_lost: int = 0
    turned_away: int = 0
    trouble: str | None = None
    clients: tuple[ClientCounts, ...] = ()


class RelayMessage(NamedTuple):
    """A message of the control socket. `client`: its number, 0 where it concerns none."""

    kind: RelayKind
    client: int
    payload: bytes


def encoded(kind: RelayKind, client: int = 0, payload: bytes = b"") -> bytes:
    """A message as a datagram."""
    return _HEAD.pack(kind, client) + payload


def decoded(datagram: bytes) -> RelayMessage:
    """The message in a datagram. Raises ValueError for one that is none."""
    if len(datagram) < _HEAD.size:
        raise ValueError("datagram is too short for a message")
    kind, client = _HEAD.unpack_from(datagram)
    return RelayMessage(RelayKind(kind), client, datagram[_HEAD.size :])


def withheld(system: int, numbers: Iterable[int]) -> bytes:
    """The payload of `WITHHOLD`."""
    return bytes([system]) + b"".join(number.to_bytes(3, "little") for number in numbers)


def send_flight(control: socket.socket, flight: socket.socket) -> None:
    """Give the relay its end of a new session's socket. Raises OSError."""
    socket.send_fds(control, [encoded(RelayKind.FLIGHT)], [flight.fileno()])
