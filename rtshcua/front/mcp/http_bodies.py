"""Requests over HTTP before the SDK sees them: what is no message is refused here, as over the standard streams.

The SDK builds whatever JSON a body has, millions of values, takes a number that JSON-RPC knows no answer to for a
notification, and never answers the first of two requests with one id. Sources: MCP 2025-11-25, 2026-07-28, transports
(an answer of HTTP 400 with a JSON-RPC error; of 404 to an unknown method of the latter); ASGI 3.0, HTTP.
"""

import asyncio
from collections.abc import Awaitable, Callable, MutableMapping
from contextlib import AsyncExitStack
from typing import Any, Final

from rtshcua.front.mcp.greeting import HANDSHAKE_VERSIONS
from rtshcua.front.mcp.messages import MOST_OCTETS, NO_REQUEST, Wrong, read_message, unknown_method

#: how long a body may take to come, and to wait for another large one, in seconds
PATIENCE_S: Final = 10.0
#: a body of more octets is large: there is one of these at a time, until it is answered
LARGE: Final = 1 << 16
_SESSION: Final = b"mcp-session-id"
_VERSION: Final = b"mcp-protocol-version"
_WITH_SESSIONS: Final = frozenset(version.encode() for version in HANDSHAKE_VERSIONS)

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
Serve = Callable[[Scope, Receive, Send], Awaitable[None]]


class Bodies:
    """What stands before `serve`, the SDK's part."""

    def __init__(self, serve: Serve) -> None:
        self._serve = serve
        self._large = asyncio.Lock()
        self._open: set[tuple[bytes, str]] = set()  # requests that wait for their answers, by session

    async def answer(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Have a request served, or refuse it."""
        if scope["method"] != "POST":
            await self._serve(scope, receive, send)
            return
        async with AsyncExitStack() as held:
            body = await self._body(scope, receive, held)
            if isinstance(body, int):
                await _say(send, body)
            elif body is not None:
                await self._read(body, scope, receive, send)

    async def _read(self, body: bytes, scope: Scope, receive: Receive, send: Send) -> None:
        read = read_message(body)
        unknown = None if isinstance(read, Wrong) else unknown_method(read)
        if unknown is not None:
            stateless = any(name == _VERSION and value not in _WITH_SESSIONS for name, value in scope["headers"])
            await _say(send, 404 if stateless else 200, unknown.answer())
            return
        asked = None if isinstance(read, Wrong) else self._asked(read, scope)
        if asked in self._open:
            read = Wrong(NO_REQUEST, "`id` is in use by another request that has no answer yet")
        if isinstance(read, Wrong):
            await _say(send, 400, read.answer())
            return
        if asked is not None:
            self._open.add(asked)
        try:
            await self._serve(scope, _again(body, receive), send)
        finally:
            if asked is not None:
                self._open.discard(asked)

    def _asked(self, message: dict[str, Any], scope: Scope) -> tuple[bytes, str] | None:
        """Which request of which session it is, as the SDK tells them apart; None for what is no request of one."""
        session = next((value for name, value in scope["headers"] if name == _SESSION), None)
        return None if session is None or not {"id", "method"} <= message.keys() else (session, str(message["id"]))

    async def _body(self, scope: Scope, receive: Receive, held: AsyncExitStack) -> bytes | int | None:
        """All of it; the status with which it is refused; None where whoever sent the client closed the connection."""
        said = next((value for name, value in scope["headers"] if name == b"content-length"), b"0")
        if int(said) > MOST_OCTETS:
            return 413
        parts, size, late = list[bytes](), 0, 408
        try:
            async with asyncio.timeout(PATIENCE_S):
                while (came := await receive())["type"] == "http.request":
                    part = came.get("body", b"")
                    if size <= LARGE < size + len(part):
                        late = 503
                        await self._large.acquire()
                        held.callback(self._large.release)
                        late = 408
                    size += len(part)
                    if size > MOST_OCTETS:
                        return 413
                    parts.append(part)
                    if not came.get("more_body"):
                        return b"".join(parts)
        except TimeoutError:
            return late
        return None


def _again(body: bytes, receive: Receive) -> Receive:
    """What gives a body that was read, and then whatever comes after it."""
    parts: list[MutableMapping[str, Any]] = [{"type": "http.request", "body": body, "more_body": False}]

    async def give() -> MutableMapping[str, Any]:
        return parts.pop() if parts else await receive()

    return give


async def _say(send: Send, status: int, body: bytes = b"") -> None:
    headers = [
        (b"content-length", str(len(body)).encode()),
        *([(b"content-type", b"application/json")] if body else []),
    ]
    if status != 400:
        headers.append((b"connection", b"close"))  # the rest of the body may never come
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": body})
