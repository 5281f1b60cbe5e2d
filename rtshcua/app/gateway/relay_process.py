"""The relay's process, as its starter sees it (`rtshcua/adapters/gateway`)."""

import socket
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Final

import msgspec

from rtshcua.adapters.gateway.messages import (
    LARGEST,
    ClientSetup,
    RelayKind,
    RelayMessage,
    RelaySetup,
    SetupFailure,
    decoded,
    encoded,
    send_flight,
    withheld,
)
from rtshcua.app.gateway.configuration import ConfiguredClient
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal

_MODULE: Final = "rtshcua.adapters.gateway"
#: how long the relay may take to open its addresses, and to end, in seconds
_START_S, _STOP_S = 20.0, 2.0
#: how many datagrams of a socket are read before the other one has its turn
_MOST_AT_ONCE: Final = 256


class StartedRelay:
    """A relay that is started, until `stop`. It has its own session, so that Ctrl-C in a terminal does not reach it.

    `vehicle` is the vehicle's address; `opened` are those of the clients in their order, as they are bound.
    """

    def __init__(self, vehicle: str, clients: Sequence[ConfiguredClient]) -> None:
        self.control, control = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.telemetry, telemetry = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.vehicle, self._clients = vehicle, tuple(clients)
        self.opened: tuple[str, ...] = ()
        setup = RelaySetup(
            vehicle,
            control.fileno(),
            telemetry.fileno(),
            tuple(ClientSetup(each.name, each.address, each.pilot, each.peers, each.rate) for each in clients),
        )
        with control, telemetry:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", _MODULE], stdin=subprocess.PIPE, start_new_session=True,
                pass_fds=(control.fileno(), telemetry.fileno()),
            )  # fmt: skip
        assert self._process.stdin is not None
        with suppress(BrokenPipeError), self._process.stdin as stdin:
            stdin.write(msgspec.json.encode(setup))

    def await_ready(self) -> Refusal | None:
        """Wait until all addresses are open; the refusal if one cannot be opened."""
        self.control.settimeout(_START_S)
        try:
            message = decoded(self.control.recv(LARGEST))
        except (OSError, ValueError):
            return Refusal("relay", "the relay of the gateway did not start", "", ExitCode.FAULT)
        finally:
            self.control.setblocking(False)
            self.telemetry.setblocking(False)
        if message.kind is RelayKind.READY:
            self.opened = msgspec.json.decode(message.payload, type=tuple[str, ...])
            return None
        if message.kind is not RelayKind.FAILED:
            return Refusal("relay", f"the relay of the gateway began with {message.kind.name}", "", ExitCode.FAULT)
        failure = msgspec.json.decode(message.payload, type=SetupFailure)
        who = "the vehicle" if failure.client is None else f"client `{self._clients[failure.client].name}`"
        return Refusal("link", f"{who}: {failure.text}", failure.help, ExitCode.LINK)

    def messages(self) -> Iterator[RelayMessage]:
        """The messages that have arrived. Raises `ConnectionError` after the end of the relay."""
        for _ in range(_MOST_AT_ONCE):
            try:
                datagram = self.control.recv(LARGEST)
            except BlockingIOError:
                return
            if not datagram:
                raise ConnectionResetError("the relay ended")
            yield decoded(datagram)

    def frames(self) -> Iterator[bytes]:
        """The datagrams of the vehicle's frames that have arrived."""
        for _ in range(_MOST_AT_ONCE):
            try:
                datagram = self.telemetry.recv(LARGEST)
            except OSError:
                return
            if not datagram:
                return
            yield datagram

    def answer(self, client: int, frames: bytes) -> None:
        """Send frames to a client. If the relay is behind, they are lost, as on any link."""
        with suppress(OSError):
            self.control.send(encoded(RelayKind.ANSWER, client, frames))

    def withhold(self, client: int, numbers: frozenset[int]) -> None:
        """Set the vehicle's messages that a client does not get."""
        with suppress(OSError):
            self.control.send(encoded(RelayKind.WITHHOLD, client, withheld(tuple(sorted(numbers)))))

    def connect_flight(self) -> socket.socket:
        """Return the flight's end of a new connection to the vehicle. Raises OSError."""
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with ours:
            self.control.setblocking(True)
            try:
                send_flight(self.control, ours)
            finally:
                self.control.setblocking(False)
        return theirs

    def again(self) -> "StartedRelay | Refusal":
        """A new relay in the place of this one, which ended."""
        self.stop()
        relay = StartedRelay(self.vehicle, self._clients)
        refusal = relay.await_ready()
        if refusal is not None:
            relay.stop()
        return refusal or relay

    def stop(self) -> None:
        """End the relay."""
        self.control.close()
        self.telemetry.close()
        for end in (self._process.terminate, self._process.kill):
            try:
                self._process.wait(_STOP_S)
                return
            except subprocess.TimeoutExpired:
                end()
        self._process.wait()
