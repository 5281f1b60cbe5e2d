"""The standard streams as the SDK takes its messages: one line a message, each read and answered here alone.

The SDK's own streams end with the first text that UTF-8 cannot say, answer no line that is no message, and wait for a
host that does not read for as long as it lives.
"""

import os
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, suppress
from typing import Any, Final

import anyio
import mcp_types as types
from anyio.abc import ObjectReceiveStream, ObjectSendStream
from mcp.shared.message import SessionMessage
from pydantic import TypeAdapter

from rtshcua.front.mcp.greeting import Greeted
from rtshcua.front.mcp.messages import ENDS, MOST_OCTETS, NO_REQUEST, Wrong, line_of, read_message, unknown_method

#: octets that are read at once, and written: a pipe that can be written to has room for these (pipe(7), PIPE_BUF)
_READ: Final = 1 << 16
_WRITTEN: Final = 4_096
#: requests that wait for their answers at a time
MOST_OPEN: Final = 256
#: how long a host that has closed its end is still answered, and may take what was answered, in seconds
_LAST_S: Final = 10.0
_MESSAGE: Final[TypeAdapter[types.JSONRPCMessage]] = TypeAdapter(types.JSONRPCMessage)


class Lines:
    """Lines out of octets as they come. Of one that is too long beginning and end are kept, and no more."""

    def __init__(self) -> None:
        self._line = bytearray()
        self._whole = True

    def take(self, data: bytes) -> Iterator[tuple[bytes, bool]]:
        """The lines that end in `data`, and whether each is whole; blank ones are none."""
        *ends, rest = data.split(b"\n")
        for end in ends:
            self._add(end)
            yield from self.end()
        self._add(rest)

    def end(self) -> Iterator[tuple[bytes, bool]]:
        """The line as it stands: it is at its end."""
        line, whole = bytes(self._line), self._whole
        self._line, self._whole = bytearray(), True
        if not whole or line.strip():
            yield line, whole

    def _add(self, data: bytes) -> None:
        self._line += data
        self._whole = self._whole and len(self._line) <= MOST_OCTETS
        if not self._whole:
            del self._line[ENDS:-ENDS]


class _Gone(Exception):
    """Nobody reads what is written any more."""


class _Host:
    """The host behind two descriptors."""

    def __init__(
        self, incoming: int, outgoing: int, messages: ObjectSendStream[SessionMessage | Exception], begun: Greeted
    ) -> None:
        self._incoming, self._outgoing = incoming, outgoing
        self._begun = begun
        self._messages = messages
        self._writing = anyio.Lock()
        self._open: set[int | str] = set()  # requests that wait for their answers
        self._answered = anyio.Event()  # of these, the latest that was answered, replaced by each
        self.leaving = anyio.Event()  # it says nothing more
        self.wrong: OSError | None = None  # why nothing can be read or written, where the host did not end

    async def read(self) -> None:
        """Its lines to the server until it ends and what it asked is answered; what is no message is answered here."""
        lines = Lines()
        try:
            async with self._messages:
                while data := await self._some():
                    for line, whole in lines.take(data):
                        await self._take(line, whole=whole)
                for line, whole in lines.end():
                    await self._take(line, whole=whole)
                self.leaving.set()
                while self._open:  # the server ends with its input, and leaves open what it has not answered
                    await self._answered.wait()
        except (_Gone, anyio.BrokenResourceError, anyio.ClosedResourceError):
            pass  # the server ended, or nobody reads
        finally:
            self.leaving.set()

    async def write(self, answers: ObjectReceiveStream[SessionMessage]) -> None:
        """What the server says, until it ends, or until nobody is there to read it."""
        with suppress(_Gone):
            async for answer in answers:
                message = answer.message
                known = message.id if isinstance(message, types.JSONRPCResponse | types.JSONRPCError) else None
                if known is not None and known == self._begun.answered:
                    self._begun = Greeted()  # it has that answer already
                else:
                    await self._put(line_of(message.model_dump(by_alias=True, mode="json", exclude_none=True)))
                self._close(known)

    async def _some(self) -> bytes:
        if self._begun.octets:
            octets, self._begun = self._begun.octets, self._begun._replace(octets=b"")
            return octets
        try:
            await _until(anyio.wait_readable, self._incoming)
            return os.read(self._incoming, _READ)
        except OSError as error:
            self.wrong = error
            return b""

    async def _take(self, line: bytes, *, whole: bool) -> None:
        read = read_message(line, whole=whole)
        if not isinstance(read, Wrong) and "method" not in read:
            return  # nothing was asked of it
        if not isinstance(read, Wrong) and "id" in read:
            read = unknown_method(read) or self._opened(read)
        if isinstance(read, Wrong):
            await self._put(read.answer())
            return
        try:
            message = _MESSAGE.validate_python(read)
        except ValueError:
            self._close(read.get("id", ""))
            await self._put(Wrong(NO_REQUEST, "the message is not a message of MCP", read.get("id")).answer())
            return
        await self._messages.send(SessionMessage(message))
        if read["method"] == "notifications/cancelled":  # which is never answered
            self._close(read.get("params", {}).get("requestId"))

    def _close(self, known: Any) -> None:
        if isinstance(known, int | str):
            self._open.discard(known)
        self._answered.set()
        self._answered = anyio.Event()

    def _opened(self, request: dict[str, Any]) -> dict[str, Any] | Wrong:
        known = request["id"]
        if known in self._open:
            return Wrong(NO_REQUEST, "`id` is in use by another request that has no answer yet")
        if len(self._open) >= MOST_OPEN:
            return Wrong(NO_REQUEST, f"{MOST_OPEN} requests wait for their answers, which is the limit", known)
        self._open.add(known)
        return request

    async def _put(self, line: bytes) -> None:
        """Write a line. Raises `_Gone`."""
        async with self._writing:
            try:
                for start in range(0, len(line), _WRITTEN):
                    part = line[start : start + _WRITTEN]
                    while part:
                        await _until(anyio.wait_writable, self._outgoing)
                        part = part[os.write(self._outgoing, part) :]
            except ConnectionError:
                raise _Gone from None
            except OSError as error:
                self.wrong = error
                raise _Gone from None


@asynccontextmanager
async def streams(incoming: int, outgoing: int, begun: Greeted) -> AsyncIterator[tuple[Any, Any, anyio.Event]]:
    """What the host says and what it is answered, over two descriptors that stay open; and what is set when it says
    nothing more.

    Ends where the host does, whether it still reads or not. Raises OSError where its messages cannot be read, or
    nothing can be written, for another reason.
    """
    to_server, messages = anyio.create_memory_object_stream[SessionMessage | Exception](0)
    answers, to_host = anyio.create_memory_object_stream[SessionMessage](0)
    host = _Host(incoming, outgoing, to_server, begun)
    # closed when all is over: what the server says to a stream that was closed under it is an error
    with to_server, messages, answers, to_host:
        async with anyio.create_task_group() as tasks:

            async def end() -> None:
                await host.leaving.wait()
                tasks.cancel_scope.deadline = anyio.current_time() + _LAST_S

            async def write() -> None:
                await host.write(to_host)
                tasks.cancel_scope.cancel()

            tasks.start_soon(host.read)
            tasks.start_soon(write)
            tasks.start_soon(end)
            yield messages, answers, host.leaving
            answers.close()
    if host.wrong is not None:
        raise host.wrong


async def _until(ready: Any, descriptor: int) -> None:
    """Wait until a descriptor is ready; a file always is, and cannot be waited for."""
    try:
        await ready(descriptor)
    except PermissionError:
        await anyio.lowlevel.checkpoint()
