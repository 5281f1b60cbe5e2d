"""A session's flight: the process of `rtshcua run --wait --live`, and the connection to its agent socket."""

import json
import os
import signal
import socket
import subprocess
import sys
from base64 import b64encode
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

#: the longest line of a flight that is read, in octets: the description of a mission with many steps
_LONGEST: Final = 4 << 20
_CHUNK: Final = 1 << 16
#: starts a flight that the kernel ends with the thread that started it (PR_SET_PDEATHSIG, SIGKILL). With the gateway
#: its link ends too, and the next flight brings the vehicle down, which this one must not hinder
_WITH_US: Final = (
    "import ctypes, os, sys; ctypes.CDLL(None).prctl(1, 9, 0, 0, 0); "
    "os.getppid() == int(sys.argv[1]) and os.execv(sys.argv[2], sys.argv[2:])"
)
#: how long a flight that waits may take to end, in seconds
_STOP_S: Final = 10.0


class _Lines:
    """The JSON objects in a stream of lines. What is no object is dropped."""

    def __init__(self) -> None:
        self._kept = bytearray()

    def feed(self, octets: bytes) -> Iterator[dict[str, Any]]:
        """The objects of the lines that are now complete."""
        self._kept += octets
        if len(self._kept) > _LONGEST and b"\n" not in self._kept:
            self._kept.clear()
        *lines, rest = bytes(self._kept).split(b"\n")
        self._kept = bytearray(rest)
        for line in lines:
            with suppress(ValueError, RecursionError):
                found = json.loads(line)
                if isinstance(found, dict):
                    yield found


class FlightProcess:
    """A flight that was started. It has its own session, so that Ctrl-C in a terminal does not reach it: `interrupt`
    passes it on. `words` are the options of `rtshcua run`, `link` is its end of the relay's connection.
    """

    def __init__(self, words: Sequence[str], link: socket.socket, environment: Mapping[str, str]) -> None:
        options = ["run", *words, "--connect", f"fd:{link.fileno()}", "--json"]
        self._process = subprocess.Popen(
            [
                sys.executable, "-I", "-S", "-c", _WITH_US, str(os.getpid()),
                sys.executable, "-P", "-m", "rtshcua", *options,
            ],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
            pass_fds=(link.fileno(),), env={**os.environ, **environment},
        )  # fmt: skip
        assert self._process.stdout is not None
        assert self._process.stderr is not None
        for stream in (self._process.stdout, self._process.stderr):
            os.set_blocking(stream.fileno(), False)
        self._out, self._err = _Lines(), bytearray()

    @property
    def descriptors(self) -> tuple[int, int]:
        """The descriptors of its output and errors, to wait for."""
        assert self._process.stdout is not None
        assert self._process.stderr is not None
        return self._process.stdout.fileno(), self._process.stderr.fileno()

    def events(self) -> Iterator[dict[str, Any]]:
        """The events that it printed since the last call."""
        out, err = self.descriptors
        yield from self._out.feed(_read(out))
        self._err += _read(err)
        del self._err[:-_CHUNK]

    @property
    def errors(self) -> str:
        """The end of what it printed as errors."""
        return self._err.decode("utf-8", "replace").strip()

    def interrupt(self) -> None:
        """Ask it to bring the vehicle down and to end, as Ctrl-C does."""
        with suppress(ProcessLookupError):
            self._process.send_signal(signal.SIGINT)

    def kill(self) -> None:
        """End it at once. The next flight closes its log and brings the vehicle down."""
        self._process.kill()

    def ended(self) -> int | None:
        """The exit code, if it ended; negative for a signal."""
        return self._process.poll()

    def stop(self) -> None:
        """End a flight that waits, and collect the process."""
        self.interrupt()
        try:
            self._process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            self._process.terminate()
            self._process.wait()
        self.close()

    def close(self) -> None:
        """Close the streams of an ended flight."""
        for stream in (self._process.stdout, self._process.stderr):
            if stream is not None:
                stream.close()


class AgentLink:
    """The connection to a flight's agent socket. No call waits."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._link: socket.socket | None = None
        self._lines = _Lines()
        self._unsent = bytearray()

    def connect(self) -> bool:
        """Whether the flight listens and this is connected."""
        if self._link is not None:
            return True
        link = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            link.connect(str(self.path))
        except OSError:
            link.close()
            return False
        link.setblocking(False)
        self._link, self._lines = link, _Lines()
        return True

    @property
    def descriptor(self) -> int | None:
        """The descriptor to wait for; None if it is not connected."""
        return None if self._link is None else self._link.fileno()

    def lines(self) -> Iterator[dict[str, Any]]:
        """The lines of the flight since the last call. A connection that ends is closed."""
        self._flush()
        while self._link is not None:
            try:
                chunk = self._link.recv(_CHUNK)
            except BlockingIOError:
                return
            except OSError:
                chunk = b""
            if not chunk:
                self.close()
                return
            yield from self._lines.feed(chunk)

    def hand_in(self, number: int, document: bytes) -> None:
        """Hand in a signed document; the answer has this number."""
        self._send({"id": number, "document": b64encode(document).decode()})

    def request(self, number: int, frame: bytes) -> None:
        """Hand in a frame for the vehicle; the answer has this number."""
        self._send({"id": number, "request": b64encode(frame).decode()})

    def record(self, number: int, text: str) -> None:
        """Hand in a line for the flight's log."""
        self._send({"id": number, "client": text})

    def close(self) -> None:
        """Close the connection."""
        if self._link is not None:
            self._link.close()
        self._link = None
        self._unsent.clear()

    def _send(self, line: Mapping[str, object]) -> None:
        if self._link is not None:
            self._unsent += json.dumps(line, ensure_ascii=False).encode() + b"\n"
            self._flush()

    def _flush(self) -> None:
        while self._unsent and self._link is not None:
            try:
                sent = self._link.send(self._unsent)
            except BlockingIOError:
                return
            except OSError:
                self.close()
                return
            del self._unsent[:sent]


def _read(descriptor: int) -> bytes:
    """What a pipe has; nothing at its end."""
    found = bytearray()
    with suppress(BlockingIOError):
        while chunk := os.read(descriptor, _CHUNK):
            found += chunk
    return bytes(found)
