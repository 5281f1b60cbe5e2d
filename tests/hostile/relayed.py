"""A running relay for tests: a vehicle, FLIGHT and the starter are this process; clients are made by tests."""

import socket
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from select import select
from typing import Any, Final

import msgspec
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.gateway.messages import ClientSetup, Counters, RelayKind, RelayMessage, decoded, encoded, withheld
from rtshcua.adapters.gateway.process import RelayError, RelayProcess
from rtshcua.codec.stream import FrameStream

HERE: Final = "127.0.0.1"
#: how long something may take that has to happen
PATIENCE_S: Final = 20.0
_TRIES: Final = 5
VEHICLE: Final = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
STATION: Final = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
OLD: Final = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)


def beat(speaker: Any = STATION) -> bytes:
    """HEARTBEAT."""
    return bytes(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(speaker))


def arming(confirmation: int = 0) -> bytes:
    """A command that arms the vehicle."""
    return bytes(mavlink.MAVLink_command_long_message(1, 1, 400, confirmation, 1, 0, 0, 0, 0, 0, 0).pack(STATION))


def clock(number: int) -> bytes:
    """SYSTEM_TIME of the vehicle with a number in it, by which a test knows the frame again."""
    return bytes(mavlink.MAVLink_system_time_message(number, number).pack(VEHICLE))


def acknowledged() -> bytes:
    """COMMAND_ACK of the vehicle."""
    return bytes(mavlink.MAVLink_command_ack_message(400, 0).pack(VEHICLE))


def udp(port: int = 0) -> socket.socket:
    """A UDP socket on this machine, with the test's patience."""
    link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
    link.bind((HERE, port))
    link.settimeout(PATIENCE_S)
    return link


def free_port(kind: int = socket.SOCK_DGRAM) -> int:
    """A port that was free a moment ago."""
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind((HERE, 0))
        return int(probe.getsockname()[1])


def numbers(octets: bytes) -> list[int]:
    """The numbers of the `clock` frames among frames, and -1 for each other frame."""
    parser = mavlink.MAVLink(None)
    return [each.time_boot_ms if each.get_type() == "SYSTEM_TIME" else -1 for each in parser.parse_buffer(octets) or []]


def port_of(address: str) -> int:
    """The port in an address."""
    return int(address.rpartition(":")[2])


def know(process: RelayProcess) -> None:
    """The starter of a relay says which system the vehicle is."""
    process.control.send(encoded(RelayKind.VEHICLE, 0, bytes([1])))


class Relayed:
    """A relay with these clients. `vehicle`: the vehicle's socket, to which the relay sends; `flight`: FLIGHT's socket.

    The vehicle was heard, and FLIGHT knows it; the starter has said so, unless it is not `known`.
    """

    def __init__(self, clients: Sequence[ClientSetup], *, known: bool = True) -> None:
        self.vehicle = udp()
        self.process = RelayProcess(f"udpout:{HERE}:{self.vehicle.getsockname()[1]}", clients)
        self.flight = self.process.session()
        self.flight.settimeout(PATIENCE_S)
        self.process.control.settimeout(PATIENCE_S)
        self._kept: list[RelayMessage] = []
        if known:
            self.know()
        self.flight.send(beat())
        self._at = self.vehicle.recvfrom(4_096)[1]

    def know(self) -> None:
        """The starter says which system the vehicle is."""
        know(self.process)

    def says(self, *frames: bytes) -> None:
        """The vehicle sends these frames, each as a datagram."""
        for frame in frames:
            self.vehicle.sendto(frame, self._at)

    def ports(self) -> list[int]:
        """The clients' ports."""
        return [port_of(each) for each in self.process.bound]

    def next(self, kind: RelayKind, wanted: Callable[[RelayMessage], bool] = lambda _: True) -> RelayMessage:
        """The next message of a kind to the starter; others that came before it are set aside."""
        for message in list(self._kept):
            if message.kind is kind and wanted(message):
                self._kept.remove(message)
                return message
        until = time.monotonic() + PATIENCE_S
        while time.monotonic() < until:
            message = decoded(self.process.control.recv(1 << 16))
            if message.kind is kind and wanted(message):
                return message
            self._kept.append(message)
        raise AssertionError(f"no {kind.name} came")

    def came(self, kind: RelayKind) -> RelayMessage | None:
        """A message of a kind that came already."""
        while select([self.process.control], [], [], 0)[0]:
            self._kept.append(decoded(self.process.control.recv(1 << 16)))
        return next((each for each in self._kept if each.kind is kind), None)

    def counters(self, wanted: Callable[[Counters], bool]) -> Counters:
        """The first counters of which this is true."""

        def fits(message: RelayMessage) -> bool:
            return wanted(msgspec.json.decode(message.payload, type=Counters))

        return msgspec.json.decode(self.next(RelayKind.COUNTERS, fits).payload, type=Counters)

    def answer(self, client: int, frames: bytes) -> None:
        """The starter answers a client."""
        self.process.control.send(encoded(RelayKind.ANSWER, client, frames))

    def withhold(self, client: int, *messages: int) -> None:
        """The starter withholds messages from a client."""
        self.process.control.send(encoded(RelayKind.WITHHOLD, client, withheld(1, messages)))

    def close(self) -> None:
        """End everything."""
        self.process.close()
        self.flight.close()
        self.vehicle.close()


def relayed(*clients: ClientSetup, known: bool = True) -> Relayed:
    """A relay with clients whose addresses end in port 0: each gets a free one."""
    for _ in range(_TRIES):
        placed = [
            msgspec.structs.replace(each, address=f"{each.address[:-1]}{free_port(_kind(each.address))}")
            if each.address.endswith(":0")
            else each
            for each in clients
        ]
        with suppress(RelayError):  # another test took the port
            return Relayed(placed, known=known)
    raise AssertionError("the relay did not begin")


def _kind(address: str) -> int:
    return socket.SOCK_STREAM if address.startswith("tcp") else socket.SOCK_DGRAM


def udp_client(port: int) -> socket.socket:
    """A client of a UDP address that has been heard there."""
    link = udp()
    link.connect((HERE, port))
    link.send(beat())
    return link


def tcp_client(port: int) -> socket.socket:
    """A client of a TCP address."""
    link = socket.create_connection((HERE, port), PATIENCE_S)
    link.settimeout(PATIENCE_S)
    return link


def told(receive: Callable[[int], bytes]) -> Iterator[int]:
    """The numbers of the vehicle's frames that come, and -1 for each other frame."""
    stream = FrameStream()
    while True:
        for frame in stream.feed(receive(1 << 16)):
            yield from numbers(frame)


def until(number: int, receive: Callable[[int], bytes]) -> list[int]:
    """All numbers up to this one."""
    found: list[int] = []
    for each in told(receive):
        found.append(each)
        if each == number:
            break
    return found


def sockets_of(process: int) -> int:
    """How many sockets a process has open."""
    return sum(
        each.is_symlink() and str(each.readlink()).startswith("socket:")
        for each in Path(f"/proc/{process}/fd").iterdir()
    )
