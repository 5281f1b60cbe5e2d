"""Carry octets to and from a vehicle: UDP datagrams, a TCP connection, a serial line, an inherited pair of sockets.

A transport never raises once it is made: senders repeat what is lost, and a line or connection that is lost is reopened
until it is back. An inherited socket cannot be reopened: once its other end is gone, nothing is heard any more. UDP
keeps the boundaries of datagrams; from a stream, whole frames are returned.
"""

import errno
import fcntl
import os
import socket
import termios
from collections.abc import Callable, Hashable, Sequence
from contextlib import suppress
from typing import Final, Protocol

from rtshcua.adapters.vehicle.address import Address, LinkCarrier
from rtshcua.codec.stream import FrameStream, StreamCounts

#: the most octets that one read returns
_LARGEST: Final = 65_535
_CHUNK: Final = 4_096
_BUFFER: Final = 4 << 20  # requested size; the system's limit suffices for short delays
#: how many octets a blocked stream keeps; the rest is lost, as any datagram may be
_UNSENT: Final = 4_096
#: a lost connection or line is reopened this often
_AGAIN_US: Final = 500_000
#: a connection without any answer is given up after so many seconds
_DEAD_S: Final = 3
#: errors of a socket whose other end is gone for good
_ENDED: Final = (errno.ECONNREFUSED, errno.ECONNRESET, errno.EPIPE, errno.ENOTCONN)
_CLOSED: Final = "closed by the other end"
#: connections at once: the vehicle's, and others that are kept apart from it
_MOST: Final = 4


class Transport(Protocol):
    """A connection to a vehicle. `capacity`: octets a second each way, None if unknown. `begins`: our side sends first,
    because the other one would not. `trouble`: why nothing can be received now, in words. `counts`: what was received
    so far.
    """

    begins: bool
    capacity: int | None
    trouble: str | None

    @property
    def counts(self) -> StreamCounts:
        """What was received so far; for UDP only octets."""
        ...

    def readable(self) -> Sequence[int]:
        """The file descriptors to wait for."""
        ...

    def receive(self) -> tuple[bytes, Hashable] | None:
        """The next waiting octets and their sender; None if nothing waits. The octets may be empty."""
        ...

    def is_open(self, sender: Hashable) -> bool:
        """Whether frames can still be sent to this sender."""
        ...

    def send(self, frame: bytes, to: Hashable) -> None:
        """Send a frame to a sender that was heard; to None before that, where this transport begins."""
        ...

    def tend(self, now_us: int) -> list[str]:
        """Send what is queued and reopen what was lost; return notes for the operator."""
        ...

    def close(self) -> None:
        """Close it."""
        ...


def open_transport(address: Address, *, every: bool = False) -> Transport:
    """Open the transport of an address. With `every`, frames of MAVLink 1 and of messages that are not in the dialect
    are returned too. Raises OSError for a reason that waiting does not remove.
    """
    match address.way:
        case LinkCarrier.UDP_IN:
            return UdpTransport(address.host, address.port, begins=False)
        case LinkCarrier.UDP_OUT:
            return UdpTransport(address.host, address.port, begins=True)
        case LinkCarrier.TCP:
            return TcpTransport(address, every=every)
        case LinkCarrier.TCP_IN:
            return TcpListener(address, every=every)
        case LinkCarrier.SERIAL:
            return SerialTransport(address, every=every)
        case LinkCarrier.INHERITED:
            return InheritedTransport(address)


# ---------------------------------------------------------------- datagrams


class UdpTransport:
    """One UDP socket: bound to an address that others send to or, with `begins`, sending to one."""

    capacity: int | None = None

    def __init__(self, host: str, port: int, *, begins: bool) -> None:
        self.begins = begins
        self.trouble: str | None = None
        self._octets = 0
        self._buffer = memoryview(bytearray(_LARGEST))
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            (self._socket.connect if begins else self._socket.bind)((host, port))
        except OSError:
            self._socket.close()
            raise
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
        self._socket.setblocking(False)

    @property
    def port(self) -> int:
        """The local port (chosen by the system for 0)."""
        return int(self._socket.getsockname()[1])

    @property
    def counts(self) -> StreamCounts:
        return StreamCounts(octets=self._octets)

    def readable(self) -> Sequence[int]:
        return (self._socket.fileno(),)

    def receive(self) -> tuple[bytes, Hashable] | None:
        try:
            octets, sender = self._socket.recvfrom_into(self._buffer)
        except BlockingIOError:
            return None
        except OSError as error:  # an ICMP answer to an earlier datagram: the peer is not there yet
            self.trouble = _reason(error)
            return b"", None
        self.trouble = None
        self._octets += octets
        return bytes(self._buffer[:octets]), sender

    def is_open(self, sender: Hashable) -> bool:
        return True

    def send(self, frame: bytes, to: Hashable) -> None:
        try:
            if self.begins:
                self._socket.send(frame)
            else:
                self._socket.sendto(frame, to)  # type: ignore[call-overload]
        except OSError:
            return  # lost, as any datagram may be: important frames are repeated, and only effects count

    def tend(self, now_us: int) -> list[str]:
        return []

    def close(self) -> None:
        self._socket.close()


class InheritedTransport:
    """One end of a pair of datagram sockets, inherited from the program that has the other end and the link to the
    vehicle. Each datagram has one or more whole frames. Raises OSError where the descriptor is not such a socket.
    """

    begins = True  # what the other end forwards may have to be greeted first
    capacity: int | None = None

    def __init__(self, address: Address) -> None:
        self.trouble: str | None = None
        self._address = address
        self._octets = 0
        self._buffer = memoryview(bytearray(_LARGEST))
        self._notes: list[str] = []
        self._gone = False
        self._socket = socket.socket(fileno=address.port)
        datagrams = self._socket.type in (socket.SOCK_DGRAM, socket.SOCK_SEQPACKET)
        if self._socket.family != socket.AF_UNIX or not datagrams:
            self._socket.detach()  # it is another part's
            raise OSError(errno.EPROTOTYPE, "not one end of a pair of datagram sockets")
        self._socket.set_inheritable(False)  # the other end must notice the end of this process
        self._socket.setblocking(False)

    @property
    def counts(self) -> StreamCounts:
        return StreamCounts(octets=self._octets)

    def readable(self) -> Sequence[int]:
        return () if self._gone else (self._socket.fileno(),)

    def receive(self) -> tuple[bytes, Hashable] | None:
        if self._gone:
            return None
        try:
            octets = self._socket.recv_into(self._buffer)
        except BlockingIOError:
            return None
        except OSError as error:
            self._lost(_reason(error))
            return None
        if octets == 0 and self._socket.type == socket.SOCK_SEQPACKET:  # the end, or an empty message: nobody sends one
            self._lost(_CLOSED)
            return None
        self._octets += octets
        return bytes(self._buffer[:octets]), self._address.port

    def is_open(self, sender: Hashable) -> bool:
        return not self._gone

    def send(self, frame: bytes, to: Hashable) -> None:
        if self._gone:
            return
        try:
            self._socket.send(frame)
        except OSError as error:
            if error.errno in _ENDED:
                self._lost(_CLOSED)
            # else it is lost, as any datagram may be: the other end may be slow

    def tend(self, now_us: int) -> list[str]:
        notes, self._notes = self._notes, []
        return notes

    def close(self) -> None:
        self._gone = True
        self._socket.close()

    def _lost(self, why: str) -> None:
        self._gone, self.trouble = True, why
        self._notes.append(f"`{self._address}` was lost ({why}): it cannot be opened again")


# ---------------------------------------------------------------- streams


class _Line:
    """One open stream: its frames and its unsent octets. `write` and `read` raise OSError once it is lost."""

    def __init__(
        self, number: int, frames: FrameStream, read: Callable[[], bytes], write: Callable[[bytes], int]
    ) -> None:
        self.number, self.frames = number, frames
        self.gone: str | None = None
        self._read, self._write = read, write
        self._unsent = b""

    def receive(self) -> bytes | None:
        """The whole frames among the waiting octets; None if nothing waits."""
        try:
            octets = self._read()
        except (BlockingIOError, InterruptedError):
            return None
        except OSError as error:
            self.gone = _reason(error)
            return None
        if not octets:
            self.gone = _CLOSED
            return None
        return b"".join(self.frames.feed(octets))

    def send(self, frame: bytes) -> None:
        """Send a frame, or queue it; a frame that does not fit is dropped as a whole."""
        self.flush()
        if self.gone is None and len(self._unsent) + len(frame) <= _UNSENT:
            self._unsent += frame
            self.flush()

    def flush(self) -> None:
        """Send queued octets."""
        while self._unsent and self.gone is None:
            try:
                self._unsent = self._unsent[self._write(self._unsent) :]
            except (BlockingIOError, InterruptedError):
                return
            except OSError as error:
                self.gone = _reason(error)


class _Streams:
    """The common part of all streams: lines that open and close."""

    begins = True
    capacity: int | None = None

    def __init__(self, address: Address, *, every: bool = False) -> None:
        self.address, self._every = address, every
        self.trouble: str | None = None
        self.lines: dict[int, tuple[_Line, Callable[[], None], int]] = {}  # with its close function and descriptor
        self._past = StreamCounts()  # counts of closed lines
        self._made = 0
        self._had = False  # there was a line before
        self._notes: list[str] = []

    @property
    def counts(self) -> StreamCounts:
        every = [self._past, *[line.frames.counts for line, _, _ in self.lines.values()]]
        return StreamCounts(*map(sum, zip(*every, strict=True)))

    def readable(self) -> Sequence[int]:
        return [descriptor for _, _, descriptor in self.lines.values()]

    def receive(self) -> tuple[bytes, Hashable] | None:
        for line, _, _ in list(self.lines.values()):
            octets = line.receive()
            if line.gone is not None:
                self._drop(line)
            elif octets is not None:
                self.lines[line.number] = self.lines.pop(line.number)  # round robin
                return octets, line.number
        return None

    def is_open(self, sender: Hashable) -> bool:
        return sender in self.lines

    def send(self, frame: bytes, to: Hashable) -> None:
        for line, _, _ in list(self.lines.values()):
            if to in (None, line.number):
                line.send(frame)
                if line.gone is not None:
                    self._drop(line)

    def close(self) -> None:
        for line, _, _ in list(self.lines.values()):
            self._drop(line)

    def add(
        self, descriptor: int, read: Callable[[], bytes], write: Callable[[bytes], int], close: Callable[[], None]
    ) -> None:
        """Add an open line."""
        self._made += 1
        frames = FrameStream(every=self._every)
        self.lines[self._made] = _Line(self._made, frames, read, write), close, descriptor
        self.trouble = None
        if self._had:
            self._notes.append(f"`{self.address}` is open again")
        self._had = True

    def _drop(self, line: _Line) -> None:
        _, close, _ = self.lines.pop(line.number)
        close()
        self._past = StreamCounts(*map(sum, zip(self._past, line.frames.counts, strict=True)))
        self.trouble = line.gone
        self._notes.append(f"`{self.address}` was lost ({line.gone}): it is opened again as soon as it is back")

    def _told(self) -> list[str]:
        for line, _, _ in list(self.lines.values()):
            line.flush()
            if line.gone is not None:
                self._drop(line)
        notes, self._notes = self._notes, []
        return notes


class TcpTransport(_Streams):
    """Connects to an address, and reconnects whenever the connection is lost."""

    def __init__(self, address: Address, *, every: bool = False) -> None:
        super().__init__(address, every=every)
        found = socket.getaddrinfo(address.host, address.port, socket.AF_INET, socket.SOCK_STREAM)
        self._peer = found[0][4]
        self._pending: socket.socket | None = None
        self._tried_us: int | None = None

    def tend(self, now_us: int) -> list[str]:
        if not self.lines:
            if self._pending is None and (self._tried_us is None or now_us - self._tried_us >= _AGAIN_US):
                self._tried_us = now_us
                self._pending = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
                self._pending.setblocking(False)
                self._settle(self._pending, self._pending.connect_ex(self._peer))
            elif self._pending is not None:
                # a second connect reports whether the socket is connected by now
                self._settle(self._pending, self._pending.connect_ex(self._peer))
        return self._told()

    def _settle(self, made: socket.socket, result: int) -> None:
        if result in (0, errno.EISCONN):
            self._pending = None
            _add_connection(self, made)
        elif result not in (errno.EINPROGRESS, errno.EALREADY):
            made.close()
            self._pending = None
            self.trouble = os.strerror(result).lower()

    def close(self) -> None:
        super().close()
        if self._pending is not None:
            self._pending.close()


class TcpListener(_Streams):
    """Waits for connections. The vehicle's is the first one over which it is heard; others are kept apart."""

    begins = False

    def __init__(self, address: Address, *, every: bool = False) -> None:
        super().__init__(address, every=every)
        self.trouble = "nobody has connected"
        self._listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._listener.bind((address.host, address.port))
            self._listener.listen(_MOST)
        except OSError:
            self._listener.close()
            raise
        self._listener.setblocking(False)

    @property
    def port(self) -> int:
        """The local port (chosen by the system for 0)."""
        return int(self._listener.getsockname()[1])

    def readable(self) -> Sequence[int]:
        return [self._listener.fileno(), *super().readable()]

    def receive(self) -> tuple[bytes, Hashable] | None:
        self._accept()
        return super().receive()

    def tend(self, now_us: int) -> list[str]:
        self._accept()
        return self._told()

    def close(self) -> None:
        super().close()
        self._listener.close()

    def _accept(self) -> None:
        with suppress(OSError):
            made, _ = self._listener.accept()
            if len(self.lines) >= _MOST:
                made.close()
                return
            made.setblocking(False)
            _add_connection(self, made)


def _add_connection(streams: _Streams, made: socket.socket) -> None:
    prepare_connection(made)
    streams.add(made.fileno(), lambda: made.recv(_CHUNK), made.send, made.close)


def prepare_connection(made: socket.socket) -> None:
    """Make a connection send at once, and notice a lost peer."""
    made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    # an unplugged cable does not end a connection; options that a system lacks are left out
    for name, value in (
        ("TCP_KEEPIDLE", 1), ("TCP_KEEPINTVL", 1), ("TCP_KEEPCNT", _DEAD_S), ("TCP_USER_TIMEOUT", 1_000 * _DEAD_S),
    ):  # fmt: skip
        if hasattr(socket, name):
            made.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)


class SerialTransport(_Streams):
    """A serial device, opened exclusively, and reopened after its cable was unplugged. Raises OSError where it is busy,
    is not a serial device, cannot be opened, or does not support the baud rate.
    """

    def __init__(self, address: Address, *, every: bool = False) -> None:
        super().__init__(address, every=every)
        self.capacity = address.capacity
        self._tried_us: int | None = None
        self._open()

    def tend(self, now_us: int) -> list[str]:
        if not self.lines and (self._tried_us is None or now_us - self._tried_us >= _AGAIN_US):
            self._tried_us = now_us
            try:
                self._open()
            except OSError as error:
                self.trouble = _reason(error)
        return self._told()

    def _open(self) -> None:
        device = os.open(self.address.host, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            if not os.isatty(device):
                raise OSError(errno.ENOTTY, "not a serial device")
            try:
                fcntl.flock(device, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise OSError(errno.EBUSY, "another program has it open") from None
            fcntl.ioctl(device, termios.TIOCEXCL)
            _make_raw(device, self.address.port)
        except BaseException:
            os.close(device)
            raise
        self.add(
            device, lambda: os.read(device, _CHUNK), lambda octets: os.write(device, octets), lambda: os.close(device)
        )


def _make_raw(device: int, baud: int) -> None:
    """Eight bits, no parity, one stop bit, no flow control, nothing translated. Raises OSError."""
    speed = getattr(termios, f"B{baud}")
    try:
        mode = termios.tcgetattr(device)
        mode[0] = mode[1] = mode[3] = 0
        mode[2] = termios.CS8 | termios.CREAD | termios.CLOCAL
        mode[4] = mode[5] = speed
        mode[6][termios.VMIN], mode[6][termios.VTIME] = 1, 0  # so that an empty read differs from the end
        termios.tcsetattr(device, termios.TCSANOW, mode)
        termios.tcflush(device, termios.TCIOFLUSH)
        taken = termios.tcgetattr(device)[4]
    except termios.error as error:
        raise OSError(*error.args) from None
    if taken != speed:
        raise OSError(errno.EINVAL, f"it does not support {baud} baud")


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()
