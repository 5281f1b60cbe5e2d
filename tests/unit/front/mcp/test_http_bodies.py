"""HTTP requests that are malformed, too large, too slow or repeated do not reach the SDK."""

import asyncio
import json
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

import pytest

from rtshcua.front.mcp import http_bodies
from rtshcua.front.mcp.http_bodies import LARGE, Bodies
from rtshcua.front.mcp.messages import MOST_OCTETS

PING = b'{"jsonrpc":"2.0","id":%s,"method":"ping"}'
BIG = PING[:-1] % b"9" + b',"params":{"a":"' + b"x" * LARGE + b'"}}'


class Host:
    """A host that sends requests; those that reach the SDK are recorded, and answered once `let` is set."""

    def __init__(self) -> None:
        self.served: list[bytes] = []
        self.let = asyncio.Event()
        self.bodies = Bodies(self._serve)

    async def _serve(self, scope: MutableMapping[str, Any], receive: Any, send: Any) -> None:
        if scope["method"] == "POST":
            came = await receive()
            assert not came["more_body"]
            self.served.append(came["body"])
            assert (await receive())["type"] == "http.disconnect", "what comes behind it is not held back"
        await self.let.wait()
        await send({"type": "http.response.start", "status": 200})
        await send({"type": "http.response.body", "body": b""})

    async def ask(self, *parts: bytes, method: str = "POST", ends: bool = True, **headers: str) -> tuple[int, bytes]:
        """The status and the body of the answer; 0 where there was none. `ends`: False where more is said to come."""
        coming: list[MutableMapping[str, Any]] = [
            {"type": "http.request", "body": part, "more_body": True} for part in parts
        ]
        coming[-1]["more_body"] = not ends
        said: list[MutableMapping[str, Any]] = []

        async def receive() -> MutableMapping[str, Any]:
            return coming.pop(0) if coming else {"type": "http.disconnect"}

        async def send(message: MutableMapping[str, Any]) -> None:
            said.append(message)

        named = [(name.replace("_", "-").encode(), value.encode()) for name, value in headers.items()]
        await self.bodies.answer({"method": method, "headers": named}, receive, send)
        return (said[0]["status"], said[1]["body"]) if said else (0, b"")


def played(what: Callable[[Host], Awaitable[None]]) -> None:
    async def play() -> None:
        await what(Host())

    asyncio.run(play())


def test_message_is_served_and_other_bodies_are_refused() -> None:
    async def play(host: Host) -> None:
        host.let.set()
        whole = PING % b"1"
        assert await host.ask(whole[:9], whole[9:]) == (200, b"")
        assert await host.ask(b"", method="DELETE") == (200, b"")
        for wrong in (PING % b"1.5", PING % b"null", PING % b'"\\ud800"', PING % (b"9" * 5_000), b"[" * 100_000, b""):
            status, said = await host.ask(wrong)
            assert status == 400
            assert json.loads(said)["error"]["code"] in (-32700, -32600)
        assert host.served == [whole]

    played(play)


def test_a_body_of_millions_of_values_is_refused_before_any_is_built() -> None:
    async def play(host: Host) -> None:
        status, said = await host.ask(b"[" + b"[]," * 1_300_000 + b"[]]")
        assert (status, json.loads(said)["error"]["code"]) == (400, -32600)

    played(play)


def test_large_body_is_refused_by_declared_or_actual_size() -> None:
    async def play(host: Host) -> None:
        assert await host.ask(b"", content_length=str(MOST_OCTETS + 1)) == (413, b"")
        assert await host.ask(*[b" " * LARGE] * (MOST_OCTETS // LARGE), b" ", ends=False) == (413, b"")
        assert await host.ask(b"{", ends=False) == (0, b""), "the client closed the connection"
        assert not host.served

    played(play)


def test_there_is_one_large_body_at_a_time_and_small_ones_go_past_it(monkeypatch: pytest.MonkeyPatch) -> None:
    async def play(host: Host) -> None:
        first = asyncio.create_task(host.ask(BIG))
        while not host.served:
            await asyncio.sleep(0)
        small = asyncio.create_task(host.ask(PING % b"1"))
        while len(host.served) < 2:
            await asyncio.sleep(0)
        monkeypatch.setattr(http_bodies, "PATIENCE_S", 0)
        assert (await host.ask(BIG))[0] == 503
        monkeypatch.undo()
        second = asyncio.create_task(host.ask(BIG))
        host.let.set()
        assert [each[0] for each in await asyncio.gather(first, small, second)] == [200, 200, 200]

    played(play)


def test_a_body_that_does_not_come_is_waited_for_a_while(monkeypatch: pytest.MonkeyPatch) -> None:
    async def play(host: Host) -> None:
        said: list[MutableMapping[str, Any]] = []

        async def receive() -> MutableMapping[str, Any]:
            await asyncio.Event().wait()
            raise AssertionError

        async def send(message: MutableMapping[str, Any]) -> None:
            said.append(message)

        await host.bodies.answer({"method": "POST", "headers": []}, receive, send)
        assert said[0]["status"] == 408
        assert (b"connection", b"close") in said[0]["headers"]

    monkeypatch.setattr(http_bodies, "PATIENCE_S", 0)
    played(play)


def test_open_request_id_is_not_reused() -> None:
    """The SDK would answer the second alone; it takes 1 and "1" for one."""

    async def play(host: Host) -> None:
        first = asyncio.create_task(host.ask(PING % b"1", mcp_session_id="a"))
        while not host.served:
            await asyncio.sleep(0)
        status, said = await host.ask(PING % b'"1"', mcp_session_id="a")
        assert (status, json.loads(said)["id"]) == (400, None)
        other = asyncio.create_task(host.ask(PING % b"1", mcp_session_id="b"))
        host.let.set()
        assert [each[0] for each in await asyncio.gather(first, other)] == [200, 200]
        assert (await host.ask(PING % b"1", mcp_session_id="a"))[0] == 200

    played(play)
