"""A local socket on which agents or operators follow a flight and hand in documents (docs/agents.md).

A Unix stream socket for its owner alone, or also for a group of users. Operators have their own socket, so that agents
cannot block a recall: it accepts only its owner, by the kernel's information about the peer (SO_PEERCRED). One process
never occupies all places of a socket.

Every record of the log is sent as its line, together with `hello`, `mission` and `answer`; documents come in as JSON
lines. A gateway hands in two further kinds of lines: what it says of one of its clients, for the log, and a client's
request to the vehicle, as a frame. No call here waits: unsent data stays in a bounded buffer, and a reader that fills
it is dropped, as is one that sends malformed lines. A document is only bytes here; the enforcement boundary decides
whether it can be trusted.
"""

import errno
import os
import re
import socket
import struct
import time
from base64 import b64decode, b64encode
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Final, NamedTuple

import msgspec

from rtshcua.onboard.ports import Presented
from rtshcua.wire.document import FLIGHT_BYTES, MAX_DOCUMENT, MAX_WITHOUT_MISSION

#: the most readers at one socket; another one takes the place of the reader that was silent for longest
MOST_READERS: Final = 8
#: the most readers of one process; another one takes the place of one of its own
MOST_OF_A_PEER: Final = 4
#: how many connections are accepted in one turn of the flight, at about 50 us each; how many are taken from the queue
#: for that, most of them to be closed, at 15 us; and how many may wait in the queue
MOST_WELCOMED: Final = 2
MOST_TAKEN: Final = 5
MOST_QUEUED: Final = 32
#: the interval of accepted connections of one process, in us, and how many it may be ahead; others are closed
WELCOME_US: Final = 20_000
AHEAD: Final = 4
#: the most unsent bytes for one reader
MOST_WAITING: Final = 4 << 20
#: the most bytes sent to one reader at once: the rest waits for the next turn
AT_ONCE: Final = 1 << 14
#: the longest inbound line: a document in base64 with its envelope
LONGEST: Final = MAX_DOCUMENT * 4 // 3 + 1024
#: the least interval between two documents, in us: verifying one takes a third of a millisecond
GAP_US: Final = 20_000
#: the longest path of a Unix socket, in bytes (unix(7))
LONGEST_PATH: Final = 107
#: the limits on long lines of one user, in bytes: a second, and at once. Shorter ones, such as a recall, do not count
WORK_RATE: Final = 1 << 17
WORK_AT_ONCE: Final = 1 << 19
SHORT: Final = MAX_WITHOUT_MISSION * 4 // 3 + 64
#: the lines about clients of one user: the interval in us that each takes, and how many may come at once
CLIENT_LINES: Final = (200_000, 50)
#: the same for requests to the vehicle
REQUESTS: Final = (50_000, 40)
#: the longest frame in a request, in bytes; a frame with a full payload
MOST_FRAME: Final = 267
#: the most bytes of a text about a client
CLIENT_BYTES: Final = 200
#: the least interval after a line that is not a document, in us: nothing of it is verified
LIGHT_GAP_US: Final = 2_000
_CHUNK: Final = 1 << 16
_CREDENTIALS: Final = struct.Struct("iII")
_TIME: Final = struct.Struct("ll")  # timeval
_PATIENCE_S: Final = 1.0
#: how long a client that found no place waits before it tries again
AGAIN_S: Final = 0.02


class SocketTaken(OSError):
    """Another program listens at the path, or another kind of file is there."""


class _Handed(msgspec.Struct, forbid_unknown_fields=True):
    """An inbound line: a document in base64, or a text about a client, or a frame in base64; and the sender's number
    for it.
    """

    document: str | None = None
    client: str = ""
    request: str = ""
    id: int = 0


#: the answer to a line without a document
NO_LINE: Final = ("malformed", "expected a line `{id, document}` with the document in base64")
_NO_CLIENT: Final = ("malformed", f"the text about a client is not a JSON object of at most {CLIENT_BYTES} bytes")
_NO_REQUEST: Final = ("malformed", "the request is not one frame in base64")


class Encoded(NamedTuple):
    """A document in base64, not decoded yet."""

    at_us: int
    text: str
    sender: int

    def decoded(self) -> Presented:
        """The document, or the error for an invalid one."""
        try:
            return Presented(self.at_us, b64decode(self.text, validate=True), self.sender)
        except ValueError:
            return Presented(self.at_us, b"", self.sender, NO_LINE)


class ClientLine(NamedTuple):
    """What a gateway says of one of its clients: a small JSON object."""

    at_us: int
    text: str
    sender: int


class FrameRequest(NamedTuple):
    """A client's request to the vehicle: one unsigned frame, not checked yet."""

    at_us: int
    frame: bytes
    sender: int


#: an inbound line
Handed = Presented | Encoded | ClientLine | FrameRequest


class _Numbered(msgspec.Struct):
    """The readable part of an otherwise malformed line: its number, for the answer."""

    id: int = 0


_read = msgspec.json.Decoder(_Handed).decode
_read_object = msgspec.json.Decoder(dict[str, msgspec.Raw]).decode
_read_number = msgspec.json.Decoder(_Numbered).decode
_encode = msgspec.json.Encoder().encode


class Peer(NamedTuple):
    """The process and user at the other end, from the kernel; 0 and None where it does not say."""

    process: int
    user: int | None


class _Reader:
    """One connection."""

    def __init__(self, link: socket.socket, peer: Peer) -> None:
        self.link = link
        self.peer = peer
        self.incoming = bytearray()
        self.seen = 0  # how much of that was searched without finding the end of a line
        self.waiting: deque[memoryview] = deque()  # unsent lines, and the rest of one
        self.waits = 0  # their size in bytes

    def tell(self, line: bytes) -> bool:
        """Send a line, or queue it; return False when the reader is to be dropped."""
        waits = bool(self.waiting)
        self.waiting.append(memoryview(line))
        self.waits += len(line)
        return (waits or self.flush()) and self.waits <= MOST_WAITING

    def flush(self, most: int = AT_ONCE) -> bool:
        """Send queued data as far as the reader accepts it now, up to this many bytes."""
        while self.waiting and most > 0:
            first = self.waiting[0]
            try:
                sent = self.link.send(first[:most])
            except BlockingIOError:
                return True
            except OSError:
                return False
            if sent == len(first):
                self.waiting.popleft()
            else:
                self.waiting[0] = first[sent:]
            self.waits -= sent
            most -= sent
        return True

    @property
    def unread(self) -> bool:
        """Whether received data was not processed yet."""
        if self.incoming.find(b"\n", self.seen) >= 0:
            return True
        try:
            return bool(self.link.recv(1, socket.MSG_PEEK))
        except OSError:
            return False

    def line(self) -> bytes | None:
        """The next whole line, if any. Raises OSError for a closed connection or a line that is too long."""
        end = self.incoming.find(b"\n", self.seen)
        if end < 0:
            self.seen = len(self.incoming)
            try:
                chunk = self.link.recv(_CHUNK)
            except BlockingIOError:
                return None
            if not chunk:
                raise ConnectionResetError(errno.ECONNRESET, "the client closed the connection")
            self.incoming += chunk
            end = self.incoming.find(b"\n", self.seen)
        if (len(self.incoming) if end < 0 else end) > LONGEST:
            raise OSError(errno.EMSGSIZE, "the line is too long")
        if end < 0:
            return None
        with memoryview(self.incoming) as octets:
            line = bytes(octets[:end])
        del self.incoming[: end + 1]
        self.seen = 0
        return line


class AgentSocket:
    """Listens at a path until it is closed. `greeting` returns the first lines for a new reader. `own`: only its own
    user and root are accepted, whatever the socket's mode. `group`: the id of a group whose users may connect too.
    `numbers` counts documents; the sockets of one flight share it. `encoded`: long documents are returned in base64.
    """

    def __init__(
        self,
        path: Path,
        greeting: Callable[[], bytes],
        *,
        own: bool = False,
        group: int | None = None,
        numbers: Iterator[int] | None = None,
        encoded: bool = False,
    ) -> None:
        self.path = path
        self._encoded = encoded
        self._greeting = greeting
        self._own = own
        self.readers: list[_Reader] = []
        #: the users whose connections were accepted
        self.users: set[int] = set()
        self._senders: dict[int, tuple[_Reader, int]] = {}
        self._numbers = count(1) if numbers is None else numbers
        self._next_us = 0
        # by user: the time of the last count, and the remaining budget
        self._budgets: dict[int | None, tuple[int, int]] = {}
        # by user and kind of line: until when its share is used
        self._used: dict[tuple[int | None, tuple[int, int]], int] = {}
        self._welcomed: dict[int, int] = {}  # by process: until when it has used its share of connections
        self._listener = _listen(path, group)
        self._place = _place(path)

    def poll(self, now_us: int) -> Handed | None:
        """The next line, if any: one of each reader in turn. After a document the next line is taken `GAP_US` later,
        after another line `LIGHT_GAP_US` later.
        """
        self._welcome(now_us)
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
        """Send a line, newline included, to every reader."""
        for reader in list(self.readers):
            self._send(reader, line)

    def answer(self, sender: int, slug: str, text: str) -> None:
        """Send the result of a document to the reader that handed it in."""
        reader, number = self._senders.pop(sender, (None, 0))
        if reader is not None:
            self._send(reader, _answer(number, slug, text))

    def close(self) -> None:
        """Close all connections after a last attempt to send, and remove the path. Closing twice does nothing."""
        if self._listener.fileno() < 0:
            return
        for reader in list(self.readers):
            reader.flush(MOST_WAITING)
            self._drop(reader)
        self._listener.close()
        with suppress(OSError):
            if self._place == _place(self.path):  # a file that another program put there since is kept
                self.path.unlink()

    def _welcome(self, now_us: int) -> None:
        """Accept some of the waiting connections, but no more: repeated connections must not keep the flight busy."""
        welcomed = 0
        for _ in range(MOST_TAKEN):
            try:
                link, _ = self._listener.accept()
            except OSError:
                return
            link.setblocking(False)
            reader = _Reader(link, peer_of(link))
            if not self._may_come(reader.peer.process, now_us) or not self._has_place(reader.peer):
                link.close()  # it may try again
                continue
            self.readers.append(reader)
            if reader.peer.user is not None:
                self.users.add(reader.peer.user)
            self._send(reader, self._greeting())
            welcomed += 1
            if welcomed == MOST_WELCOMED:
                return

    def _may_come(self, process: int, now_us: int) -> bool:
        """Whether another connection of a process may be accepted now, which is then counted. 0: unknown process."""
        if process == 0:
            return True
        until_us = max(self._welcomed.get(process, 0), now_us)
        if until_us > now_us + (AHEAD - 1) * WELCOME_US:
            return False
        self._welcomed = {each: until for each, until in self._welcomed.items() if until > now_us}
        self._welcomed[process] = until_us + WELCOME_US
        return True

    def _has_place(self, peer: Peer) -> bool:
        """Whether another reader of this peer is accepted. It may replace the reader that was silent for longest, or
        one of its own process if that has used its share. A reader with unprocessed data is never replaced.
        """
        if self._own and peer.user not in (None, 0, os.geteuid()):
            return False
        alike = [reader for reader in self.readers if peer.process and reader.peer.process == peer.process]
        if len(alike) < MOST_OF_A_PEER and len(self.readers) < MOST_READERS:
            return True
        may_go = alike if len(alike) >= MOST_OF_A_PEER else [*alike, *self.readers]
        quiet = next((reader for reader in may_go if not reader.unread), None)
        if quiet is None:
            return False
        self._drop(quiet)
        return True

    def _has_budget(self, user: int | None, octets: int, now_us: int) -> bool:
        """Whether this many more bytes of a user may be processed now, which are then counted."""
        at_us, left = self._budgets.get(user, (now_us, WORK_AT_ONCE))
        left = min(WORK_AT_ONCE, left + (now_us - at_us) * WORK_RATE // 1_000_000)
        may = octets <= left
        self._budgets[user] = now_us, left - octets if may else left
        return may

    def _may_take(self, user: int | None, kind: tuple[int, int], now_us: int) -> bool:
        """Whether another line of this kind of a user may be taken now, which is then counted."""
        each_us, at_once = kind
        earliest_us = now_us - each_us * at_once
        used_us = max(self._used.get((user, kind), earliest_us), earliest_us) + each_us
        if used_us > now_us:
            return False
        self._used[user, kind] = used_us
        return True

    def _light(self, reader: _Reader, handed: _Handed, now_us: int) -> ClientLine | FrameRequest | None:
        """Take a line that is not a document."""
        self._next_us = now_us + LIGHT_GAP_US
        kind = CLIENT_LINES if handed.client else REQUESTS
        if not self._may_take(reader.peer.user, kind, now_us):
            text = f"of one user {1_000_000 // kind[0]} such lines a second are taken: hand it in again later"
            self._send(reader, _answer(handed.id, "busy", text))
            return None
        frame = b"" if handed.client else _frame_in(handed.request)
        wrong = NO_LINE if handed.document is not None or (handed.client and handed.request) else None
        if wrong is None and handed.client:
            wrong = None if _is_small_object(handed.client) else _NO_CLIENT
        elif wrong is None:
            wrong = None if frame else _NO_REQUEST
        if wrong is not None:
            self._send(reader, _answer(handed.id, *wrong))
            return None
        number = next(self._numbers)
        self._senders[number] = (reader, handed.id)
        return ClientLine(now_us, handed.client, number) if handed.client else FrameRequest(now_us, frame, number)

    def _taken(self, reader: _Reader, line: bytes, now_us: int) -> Handed | None:
        if len(line) > SHORT and not self._has_budget(reader.peer.user, len(line), now_us):
            text = f"of one user {WORK_RATE >> 10} KiB a second are looked at: hand it in again later"
            self._send(reader, _answer(_number(line), "busy", text))
            return None
        try:
            handed = _read(line)
            if handed.client or handed.request:
                return self._light(reader, handed, now_us)
            if handed.document is None:
                raise ValueError
            later = self._encoded and len(line) > SHORT
            document = b"" if later else b64decode(handed.document, validate=True)
        except (ValueError, msgspec.DecodeError):
            self._send(reader, _answer(_number(line), *NO_LINE))
            return None
        number = next(self._numbers)
        self._senders[number] = (reader, handed.id)
        return Encoded(now_us, handed.document, number) if later else Presented(now_us, document, number)

    def _send(self, reader: _Reader, line: bytes) -> None:
        if not reader.tell(line):
            self._drop(reader)

    def _drop(self, reader: _Reader) -> None:
        if reader in self.readers:
            self.readers.remove(reader)
            self._senders = {key: value for key, value in self._senders.items() if value[0] is not reader}
            reader.link.close()


def _is_small_object(text: str) -> bool:
    """Whether a text is a JSON object of at most `CLIENT_BYTES`."""
    try:
        if len(text) > CLIENT_BYTES or len(text.encode()) > CLIENT_BYTES:
            return False
        _read_object(text)
    except (ValueError, msgspec.DecodeError, RecursionError):
        return False
    return True


def _frame_in(text: str) -> bytes:
    """The octets in base64, if one frame can have so many; else none."""
    try:
        frame = b64decode(text, validate=True) if len(text) <= 2 * MOST_FRAME else b""
    except ValueError:
        return b""
    return frame if len(frame) <= MOST_FRAME else b""


def _number(line: bytes) -> int:
    """The sender's number in a malformed line, as far as it can be read; else 0."""
    try:
        return _read_number(line).id
    except (ValueError, msgspec.DecodeError, RecursionError):
        return 0


def _answer(number: int, slug: str, text: str) -> bytes:
    return _encode({"type": "answer", "id": number, "slug": slug, "text": text}) + b"\n"


def peer_of(link: socket.socket) -> Peer:
    """The process and user at the other end, on Linux (unix(7), SO_PEERCRED); unknown elsewhere."""
    option = getattr(socket, "SO_PEERCRED", None)
    if option is None:
        return Peer(0, None)
    try:
        process, user, _ = _CREDENTIALS.unpack(link.getsockopt(socket.SOL_SOCKET, option, _CREDENTIALS.size))
    except OSError:
        return Peer(0, None)
    return Peer(process, user)


def _place(path: Path) -> tuple[int, int]:
    """The identity of the file at a path."""
    found = path.lstat()
    return found.st_dev, found.st_ino


def _listen(path: Path, group: int | None) -> socket.socket:
    """A listening socket at `path` with mode 0600, or 0660 with a group. It replaces a socket that a crash left, and
    nothing else.
    """
    if len(os.fsencode(path)) > LONGEST_PATH:
        text = f"a socket's path has at most {LONGEST_PATH} bytes"
        raise OSError(errno.ENAMETOOLONG, text, str(path))
    if path.is_socket() and not _answers(path):
        path.unlink()
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    before = os.umask(0o177)
    try:
        listener.bind(str(path))
        if group is not None:
            os.chown(path, -1, group)
            path.chmod(0o660)
        listener.listen(MOST_QUEUED)
    except OSError as error:
        listener.close()
        if error.errno == errno.EADDRINUSE:
            text = "another program listens there, or the path is not a socket"
            raise SocketTaken(errno.EADDRINUSE, text, str(path)) from None
        raise OSError(error.errno, error.strerror, str(path)) from None
    finally:
        os.umask(before)
    listener.setblocking(False)
    return listener


def _answers(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
        link.settimeout(_PATIENCE_S)  # a socket with a full queue does not answer, but it is in use
        try:
            link.connect(str(path))
        except ConnectionRefusedError:
            return False
        except OSError:
            return True
        return True


# -------------------------------------------------------------------------------- the client's side


class FlightReply(NamedTuple):
    """The flight's answer: `accepted`, or the slug of a refusal, and a text for people."""

    slug: str
    text: str


class _Line(msgspec.Struct):
    """The readable fields of a line; most lines are records of the log."""

    type: str = ""
    id: int = 0
    slug: str = ""
    text: str = ""
    flight: str = ""


_read_line = msgspec.json.Decoder(_Line).decode
_NUMBER = 1
_FLIGHT = re.compile(rf"[0-9a-f]{{{2 * FLIGHT_BYTES}}}")
#: the longest line that a client accepts, in bytes: a flight sends a mission in one
LONGEST_TOLD: Final = 16 << 20


def hand_in(path: Path, document: bytes, *, patience_s: float = 10.0) -> FlightReply:
    """Send a document to the flight that listens at `path`. Raises OSError, and TimeoutError without an answer."""
    line = msgspec.json.encode({"id": _NUMBER, "document": b64encode(document).decode()}) + b"\n"
    said = _asked(path, line, lambda said: said.type == "answer" and said.id in (0, _NUMBER), patience_s)
    return FlightReply(said.slug, said.text)


def flight_at(path: Path, *, patience_s: float = 10.0) -> bytes:
    """The id of the flight that listens at `path`, by its own statement. Raises OSError."""
    return _named(_asked(path, b"", lambda said: said.type == "hello", patience_s), path)


def _flight_of(line: bytes, path: Path) -> bytes:
    """The flight's id in its first line. Raises OSError for another line."""
    said = _told(line)
    if said.type != "hello":
        raise ConnectionError("the program that listens there is not a flight: it did not send the identity line first")
    return _named(said, path)


def _named(said: _Line, path: Path) -> bytes:
    if _FLIGHT.fullmatch(said.flight) is None:
        raise ConnectionError(f"what listens at `{path}` sent no flight id")
    return bytes.fromhex(said.flight)


class _Told:
    """Splits received octets into lines; none is searched twice."""

    def __init__(self) -> None:
        self.longest = LONGEST_TOLD
        self._rest = bytearray()

    def take(self, chunk: bytes) -> list[bytes]:
        """The lines that end in this chunk, without their ends. Raises OSError for an endless line."""
        first, *more = chunk.split(b"\n")
        self._rest += first
        if len(self._rest) > self.longest:
            raise ConnectionError("the program that listens there is not a flight: its line is too long")
        if not more:
            return []
        lines = [bytes(self._rest), *more[:-1]]
        self._rest = bytearray(more[-1])
        return lines


class FlightFollower:
    """A persistent connection to the flight at `path`, for its lines and for documents. Raises OSError where none
    listens, or its first line with the flight's id does not come in time. After that no call waits.
    """

    def __init__(self, path: Path, *, patience_s: float = 10.0) -> None:
        self._number = 0
        self._path = path
        self._unsent = bytearray()
        self._link = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._lines = _Told()
        #: the flight's id, by its own statement
        self.flight = b""
        until_s = time.monotonic() + patience_s
        try:
            _connect(self._link, path, patience_s)
            self._ahead = self._first(until_s)
            self.flight = _flight_of(self._ahead[0], path)
            self._link.setblocking(False)
        except BaseException:
            self._link.close()
            raise

    def fileno(self) -> int:
        """The descriptor to wait for before `receive`."""
        return self._link.fileno()

    def _first(self, until_s: float) -> list[bytes]:
        """The first lines; they may come in pieces, within the total time limit."""
        self._lines.longest = _CHUNK
        while (left_s := until_s - time.monotonic()) > 0:
            self._link.settimeout(left_s)
            chunk = self._link.recv(_CHUNK)
            if not chunk:
                raise ConnectionResetError(errno.ECONNRESET, "the flight closed the connection", str(self._path))
            lines = self._lines.take(chunk)
            if lines:
                self._lines.longest = LONGEST_TOLD
                return lines
        raise TimeoutError("the flight did not send its identity")

    def receive(self) -> list[bytes | FlightReply] | None:
        """The received records, as lines, and replies; None once the flight closed the connection. Raises OSError
        where the peer is not a flight.
        """
        lines, self._ahead = self._ahead, []
        if not lines:
            try:
                chunk = self._link.recv(_CHUNK)
            except BlockingIOError:
                return []
            except ConnectionResetError:
                return None
            if not chunk:
                return None
            lines = self._lines.take(chunk)
        found: list[bytes | FlightReply] = []
        for line in lines:
            said = _told(line)
            found.append(FlightReply(said.slug, said.text) if said.type == "answer" else line + b"\n")
        return found

    def hand_in(self, document: bytes) -> None:
        """Hand a document in; `receive` returns the reply. Raises OSError where the flight closed the connection."""
        self._number += 1
        self._unsent += msgspec.json.encode({"id": self._number, "document": b64encode(document).decode()}) + b"\n"
        self.flush()

    @property
    def unsent(self) -> bool:
        """Whether data waits to be sent: call `flush` once the descriptor can be written."""
        return bool(self._unsent)

    def flush(self) -> None:
        """Send queued data as far as the flight accepts it now. Raises OSError where the flight has closed it."""
        while self._unsent:
            try:
                sent = self._link.send(self._unsent)
            except BlockingIOError:
                return
            del self._unsent[:sent]

    def close(self) -> None:
        """Close the connection. Closing twice does nothing."""
        self._link.close()

    def __enter__(self) -> "FlightFollower":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _asked(path: Path, line: bytes, wanted: Callable[[_Line], bool], patience_s: float) -> _Line:
    """Send a line and return the first wanted one; repeated where the queue is full or no place is free. Raises
    OSError, and TimeoutError without an answer.
    """
    until_s = time.monotonic() + patience_s
    last: OSError | None = None
    while True:
        try:
            return _asked_once(path, line, wanted, until_s)
        except (BlockingIOError, ConnectionResetError, BrokenPipeError) as error:
            if time.monotonic() + AGAIN_S >= until_s:
                raise
            last = error
        except (FileNotFoundError, ConnectionRefusedError) as error:
            raise last or error from None  # the flight ended in the meantime
        time.sleep(AGAIN_S)


def _asked_once(path: Path, line: bytes, wanted: Callable[[_Line], bool], until_s: float) -> _Line:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as link:
        _connect(link, path, max(until_s - time.monotonic(), AGAIN_S))
        link.settimeout(max(until_s - time.monotonic(), AGAIN_S))
        link.sendall(line)
        told = _Told()
        while (left_s := until_s - time.monotonic()) > 0:
            link.settimeout(left_s)
            chunk = link.recv(_CHUNK)
            if not chunk:
                raise ConnectionResetError("the flight closed the connection: it has ended, or it refused the document")
            for each in told.take(chunk):
                said = _told(each)
                if wanted(said):
                    return said
    raise TimeoutError("the flight did not answer")


def _connect(link: socket.socket, path: Path, patience_s: float) -> None:
    """Connect. Raises OSError, which names the path; BlockingIOError where the queue stays full for this long."""
    patience = divmod(max(1, int(patience_s * 1e6)), 1_000_000)
    # Python's own timeout would not wait for a place in the queue, and other clients would be faster
    link.settimeout(None)
    link.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, _TIME.pack(*patience))
    try:
        link.connect(str(path))
    except BlockingIOError:
        raise
    except OSError as error:
        if path.exists() and not path.is_socket():
            raise OSError(errno.ENXIO, "no flight has an agent socket there", str(path)) from None
        if error.errno is None:
            raise OSError(errno.ENAMETOOLONG, "the path is too long for a socket", str(path)) from None
        raise OSError(error.errno, error.strerror, str(path)) from None


def _told(line: bytes) -> _Line:
    """A line from the program that listens there. Raises OSError for a line that is not a flight's."""
    try:
        return _read_line(line)
    except (ValueError, msgspec.DecodeError, RecursionError):
        raise ConnectionError("the program that listens there is not a flight: its reply is malformed") from None
