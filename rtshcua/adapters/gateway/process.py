"""Starts the relay's process and ends it."""

import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Final

import msgspec

from rtshcua.adapters.gateway.messages import (
    LARGEST,
    ClientSetup,
    RelayKind,
    RelaySetup,
    SetupFailure,
    decoded,
    send_flight,
)

#: how long the process may take to open all addresses, and to end, in s
_PATIENCE_S: Final = 20.0
_ENDING_S: Final = 2.0
_BUFFER: Final = 1 << 20


class RelayError(Exception):
    """The relay did not begin. `failure` says why; `of_address`: because an address cannot be opened."""

    def __init__(self, failure: SetupFailure, *, of_address: bool) -> None:
        super().__init__(failure.text)
        self.failure, self.of_address = failure, of_address


class RelayProcess:
    """A running relay. `control` and `telemetry` are the starter's ends of its sockets, non-blocking; `bound`: the
    address of each client as it is open; `pid`: its process. It has its own session, so that Ctrl-C in a terminal does
    not reach it. Raises RelayError.
    """

    def __init__(self, vehicle: str, clients: Sequence[ClientSetup], silence_s: int = 3) -> None:
        self.control, control = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.telemetry, telemetry = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.control.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER)
        setup = RelaySetup(vehicle, control.fileno(), telemetry.fileno(), tuple(clients), silence_s)
        with control, telemetry:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "rtshcua.adapters.gateway"], stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL, pass_fds=[control.fileno(), telemetry.fileno()], start_new_session=True,
            )  # fmt: skip
        self.pid = self._process.pid
        assert self._process.stdin is not None
        with suppress(OSError), self._process.stdin as words:
            words.write(msgspec.json.encode(setup))
        self.bound = self._greeted()
        self.control.setblocking(False)
        self.telemetry.setblocking(False)

    def session(self) -> socket.socket:
        """Begin a session of FLIGHT, and end the one before: the end of its socket for FLIGHT, to be closed by us once
        FLIGHT has it. Raises OSError where the relay has ended.
        """
        flight, relay = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with relay:
            timeout_s = self.control.gettimeout()
            self.control.setblocking(True)
            try:
                send_flight(self.control, relay)
            finally:
                self.control.settimeout(timeout_s)
        return flight

    def poll(self) -> int | None:
        """The exit code of the process; None while it runs."""
        return self._process.poll()

    def wait(self, patience_s: float) -> int:
        """Wait for the end of the process, and return its exit code. Raises subprocess.TimeoutExpired."""
        return self._process.wait(patience_s)

    def close(self) -> None:
        """End the process; a second time does nothing."""
        self.control.close()
        self.telemetry.close()
        try:
            self._process.wait(_ENDING_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _greeted(self) -> tuple[str, ...]:
        self.control.settimeout(_PATIENCE_S)
        greeting, until_s = b"", time.monotonic() + _PATIENCE_S
        with suppress(OSError):
            greeting = self.control.recv(LARGEST)
        if greeting:
            kind, _, payload = decoded(greeting)
            if kind is RelayKind.READY:
                return msgspec.json.decode(payload, type=tuple[str, ...])
            failure = msgspec.json.decode(payload, type=SetupFailure)
        else:
            late = time.monotonic() >= until_s
            text = "the relay did not begin in time" if late else "the relay's process ended before it began"
            failure = SetupFailure(None, text, "its own message is on the standard error stream")
        self.close()
        raise RelayError(failure, of_address=bool(greeting))
