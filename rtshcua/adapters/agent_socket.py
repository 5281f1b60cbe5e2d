"""A local socket on which agents and operators follow a flight and hand documents in (docs/agents.md).

A Unix stream socket that its owner alone may use. Every record of the log goes out as its line, and beside it `hello`,
`mission` and `answer`; documents come in as JSON lines. Nothing here ever waits: what a reader does not take stays in a
bounded buffer, and a reader that lets it fill is dropped, as is one that sends what is no line of the kind. A document
that is taken up here is only bytes; the enforcement boundary says whether it is to be trusted.
"""

import errno
import os
import socket
import time
from base64 import b64decode, b64encode
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final, NamedTuple

import msgspec

from rtshcua.onboard.ports import Presented
from rtshcua.wire.document import MAX_DOCUMENT

#: how many may follow a flight at once; one more takes the place of whoever was quiet for longest
MOST_READERS: Final = 8
#: how much may wait for one reader, in bytes
MOST_WAITING: Final = 4 << 20
#: the longest line that may come in: a document in base64, with what stands around it
LONGEST: Final = MAX_DOCUMENT * 4 // 3 + 1024
#: a document comes in no sooner than this after the one before it, in us: verifying takes a third of a millisecond
GAP_US: Final = 20_000
#: the longest path of a Unix socket, in bytes (unix(7))
LONGEST_PATH: Final = 107
_CHUNK: Final = 1 << 16
_PATIENCE_S: Final = 1.0


class SocketTaken(OSError):
    """Another program listens at the path, or something else is there."""


class _Handed(msgspec.Struct, forbid_unknown_fields=True):
    """A line that comes in: a document in base64, and the sender's own number for it."""

    document: str
    id: int = 0


class _Numbered(msgspec.Struct):
    """What is read of a line that is wrong otherwise: the number to answer to."""

    id: int = 0


_read = msgspec.json.Decoder(_Handed).decode
_read_number = msgspec.json.Decoder(_Numbered).decode
_encode = msgspec.json.Encoder().encode


class _Reader:
    """One connection."""

    def __init__(self, link: socket.socket) -> None:
        self.link = link
        self.incoming = bytearray()
        self.waiting = bytearray()

    def tell(self, line: bytes) -> bool:
        """Send a line, or keep it for later; False when the reader is to be dropped."""
        self.waiting += line
        return self.flush() and len(self.waiting) <= MOST_WAITING

    def flush(self) -> bool:
        """Send what waits, as far as the reader takes it now."""
        while self.waiting:
            try:
                sent = self.link.send(self.waiting)
            except BlockingIOError:
                return True
            except OSError:
                return False
            del self.waiting[:sent]
        return True

    def line(self) -> bytes | None:
        """The next whole line, if there is one; raises OSError for a connection that ended or sends too long a line."""
        if b"\n" not in self.incoming:
            try:
                chunk = self.link.recv(_CHUNK)
            except BlockingIOError:
                return None
            if not chunk:
                raise ConnectionResetError(errno.ECONNRESET, "it hung up")
            self.incoming += chunk
        line, newline, _ = bytes(self.incoming).partition(b"\n")
        if len(line) > LONGEST:
            raise OSError(errno.EMSGSIZE, "the line is too long")
        if not newline:
            return None
        del self.incoming[: len(line) + 1]
        return line


class AgentSocket:
    """Listens at a path until it is closed. `greeting` gives what a new reader is told first, as whole lines."""

    def __init__(self, path: Path, greeting: Callable[[], bytes]) -> None:
        self.path = path
        self._greeting = greeting
        self.readers: list[_Reader] = []
        self._senders: dict[int, tuple[_Reader, int]] = {}
        self._count = 0
        self._next_us = 0
        self._listener = _listen(path)

    def poll(self, now_us: int) -> Presented | None:
        """The next document, if one came in: one of each reader in turn, and at most one in `GAP_US`."""
        self._welcome()
        for reader in list(self.readers):
            if not reader.flush():
                self._drop(reader)
        if now_us < self._next_us:
            return None
        for reader in list(self.readers):
            try:
                line = reader.line()
            except OSError:
                self._drop(reader)
                continue
            if line is not None:
                self._next_us = now_us + GAP_US
                self.readers.remove(reader)
                self.readers.append(reader)  # the others come first the next time
                return self._taken(reader, line, now_us)
        return None

    def tell(self, line: bytes) -> None:
        """Tell every reader a line, newline included."""
        for reader in list(self.readers):
            self._send(reader, line)

    def answer(self, sender: int, slug: str, text: str) -> None:
        """Tell the reader that handed a document in what became of it."""
        reader, number = self._senders.pop(sender, (None, 0))
        if reader is not None:
            self._send(reader, _answer(number, slug, text))

    def close(self) -> None:
        """Hang up on all readers, after a last try to send what waits, and take the path away. Twice does nothing."""
        if self._listener.fileno() < 0:
            return
        for reader in list(self.readers):
            reader.flush()
            self._drop(reader)
        self._listener.close()
        with suppress(OSError):
            self.path.unlink()

    def _welcome(self) -> None:
        for _ in range(MOST_READERS):  # and no more: whoever connects again and again must not keep us here
            try:
                link, _ = self._listener.accept()
            except OSError:
                return
            link.setblocking(False)
            if len(self.readers) >= MOST_READERS:
                self._drop(self.readers[0])  # the one that was quiet for longest: a recall must not find it full
            reader = _Reader(link)
            self.readers.append(reader)
            self._send(reader, self._greeting())

    def _taken(self, reader: _Reader, line: bytes, now_us: int) -> Presented | None:
        try:
            handed = _read(line)
            document = b64decode(handed.document, validate=True)
        except (ValueError, msgspec.DecodeError):
            text = "not a line of the kind {id, document}, document in base64"
            self._send(reader, _answer(_number(line), "malformed", text))
            return None
        self._count += 1
        self._senders[self._count] = (reader, handed.id)
        return Presented(now_us, document, self._count)

    def _send(self, reader: _Reader, line: bytes) -> None:
        if not reader.tell(line):
            self._drop(reader)

    def _drop(self, reader: _Reader) -> None:
        if reader in self.readers:
            self.readers.remove(reader)
            self._senders = {key: value for key, value in self._senders.items() if value[0] is not reader}
            reader.link.close()


def _number(line: bytes) -> int:
    """The sender's own number for a line that is none of ours, as far as it can be read; else 0."""
    try:
        return _read_number(line).id
    except (ValueError, msgspec.DecodeError, RecursionError):
        return 0


def _answer(number: int, slug: str, text: str) -> bytes:
    return _encode({"type": "answer", "id": number, "slug": slug, "text": text}) + b"\n"


def _listen(path: Path) -> socket.socket:
    """A listening socket of mode 0600 at `path`; one that a crash left behind is replaced, nothing else ever is."""
    if len(os.fsencode(path)) > LONGEST_PATH:
        text = f"a socket's path has at most {LONGEST_PATH} bytes"
        raise OSError(errno.ENAMETOOLONG, text, str(path))
    if path.is_socket() and not _answers(path):
        path.unlink()
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    before = os.umask(0o177)
    try:
        listener.bind(str(path))
        listener.listen(MOST_READERS)
    except OSError as error:
        listener.close()
        if error.errno == errno.EADDRINUSE:
            text = "another program listens there, or it is no socket"
            raise SocketTaken(errno.EADDRINUSE, text, str(path)) from None
        raise OSError(error.errno, error.strerror, str(path)) from None
    finally:
        os.umask(before)
    listener.setblocking(False)
    return listener


def _answers(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
        link.settimeout(_PATIENCE_S)  # one whose queue is full does not answer, and is there
        try:
            link.connect(str(path))
        except ConnectionRefusedError:
            return False
        except OSError:
            return True
        return True


# -------------------------------------------------------------------------------- the end of who hands in


class Answered(NamedTuple):
    """What the flight said: `accepted`, or why not, and a text for a person."""

    slug: str
    text: str


class _Line(msgspec.Struct):
    """What is read of a line; most are records of the log."""

    type: str = ""
    id: int = 0
    slug: str = ""
    text: str = ""
    flight: str = ""


_read_line = msgspec.json.Decoder(_Line).decode
_NUMBER = 1


def hand_in(path: Path, document: bytes, *, patience_s: float = 10.0) -> Answered:
    """Hand a document to the flight that listens at `path`. Raises OSError, TimeoutError without an answer."""
    line = msgspec.json.encode({"id": _NUMBER, "document": b64encode(document).decode()}) + b"\n"
    said = _asked(path, line, lambda said: said.type == "answer" and said.id in (0, _NUMBER), patience_s)
    return Answered(said.slug, said.text)


def flight_at(path: Path, *, patience_s: float = 10.0) -> bytes:
    """The id of the flight that listens at `path`, as it says itself. Raises OSError."""
    said = _asked(path, b"", lambda said: said.type == "hello", patience_s)
    try:
        return bytes.fromhex(said.flight)
    except ValueError:
        raise ConnectionError(f"what listens at `{path}` says no id of a flight") from None


def _asked(path: Path, line: bytes, wanted: Callable[[_Line], bool], patience_s: float) -> _Line:
    """The first line that is wanted, after sending one. Raises OSError, TimeoutError without an answer."""
    until_s = time.monotonic() + patience_s
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
        link.settimeout(patience_s)
        try:
            link.connect(str(path))
        except OSError as error:
            if path.exists() and not path.is_socket():
                raise OSError(errno.ENXIO, "no agent socket of a flight", str(path)) from None
            if error.errno is None:
                raise OSError(errno.ENAMETOOLONG, "the path is too long for a socket", str(path)) from None
            raise OSError(error.errno, error.strerror, str(path)) from None
        link.sendall(line)
        waiting = b""
        while (left_s := until_s - time.monotonic()) > 0:
            link.settimeout(left_s)
            chunk = link.recv(_CHUNK)
            if not chunk:
                raise ConnectionResetError("the flight hung up: it is over, or it did not take the document")
            *lines, waiting = (waiting + chunk).split(b"\n")
            for each in lines:
                said = _read_line(each)
                if wanted(said):
                    return said
    raise TimeoutError("the flight did not answer")
