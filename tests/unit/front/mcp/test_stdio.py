"""The streams of a host: lines of any length, answers to malformed ones, and the end."""

import json
import os
import tracemalloc
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import pytest

pytest.importorskip("mcp", reason="the extra `mcp` is not installed: `make setup` installs it")
import anyio
import mcp_types as types
from mcp.shared.message import SessionMessage

from rtshcua.front.mcp.greeting import Greeted
from rtshcua.front.mcp.messages import ENDS, MOST_OCTETS
from rtshcua.front.mcp.stdio import MOST_OPEN, Lines, streams


def test_lines_are_found_however_they_come_and_blank_ones_are_none() -> None:
    data = b"{}\n\r\n  \n\n[1]\r\nend"
    for size in (1, 2, 5, 100):
        lines = Lines()
        found = [line for at in range(0, len(data), size) for line in lines.take(data[at : at + size])]
        assert [*found, *lines.end()] == [(b"{}", True), (b"[1]\r", True), (b"end", True)]
        assert [*lines.end()] == []


@pytest.mark.parametrize("times", [1, 5])
def test_of_a_line_that_is_too_long_beginning_and_end_are_kept(times: int) -> None:
    lines, part = Lines(), b"[" * (MOST_OCTETS // 4)
    tracemalloc.start()
    try:
        found = [line for _ in range(4 * times) for line in lines.take(part)]
        found += lines.take(b"[end\n{}\n")
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert [(line[:2], whole) for line, whole in found] == [(b"[[", False), (b"{}", True)]
    assert found[0][0].endswith(b"[end")
    assert len(found[0][0]) == 2 * ENDS
    assert most < 3 * MOST_OCTETS


@contextmanager
def pipes() -> Iterator[tuple[int, int, int, int]]:
    """The host's ends, then ours."""
    ours_in, says = os.pipe()
    hears, ours_out = os.pipe()
    ends = [says, hears, ours_in, ours_out]
    try:
        yield says, hears, ours_in, ours_out
    finally:
        for end in ends:
            with suppress(OSError):
                os.close(end)


def served(said: bytes, *, answers: bool = True, reads: bool = True, more: Any = None) -> list[dict[str, Any]]:
    """The answers to a host that sends these lines and ends; requests get an empty answer, or none."""

    async def serve(ours_in: int, ours_out: int) -> None:
        async with streams(ours_in, ours_out, Greeted()) as (incoming, outgoing, _):
            async for message in incoming:
                root = message.message
                if answers and isinstance(root, types.JSONRPCRequest):
                    answer = types.JSONRPCResponse(jsonrpc="2.0", id=root.id, result=more or {})
                    await outgoing.send(SessionMessage(answer))

    with pipes() as (says, hears, ours_in, ours_out):
        os.write(says, said)
        os.close(says)
        if not reads:
            os.close(hears)
        anyio.run(serve, ours_in, ours_out)
        os.close(ours_out)
        heard = b"".join(iter(lambda: os.read(hears, 1 << 16), b"")) if reads else b""
    return [json.loads(line) for line in heard.splitlines()]


def request(number: int) -> bytes:
    return b'{"jsonrpc":"2.0","id":%d,"method":"ping"}\n' % number


def test_invalid_line_is_answered_in_order() -> None:
    told = served(
        request(1) + b'{"jsonrpc":"2.0","id":"\\ud800","method":"ping"}\n\n[]\n{"jsonrpc":"2.0","id":9,"result":{}}\n'
        b'{"jsonrpc":"2.0","method":"notifications/initialized"}\n' + request(2).rstrip()
    )
    answers = sorted(json.dumps([each["id"], "error" in each]) for each in told)
    assert answers == ["[1, false]", "[2, false]", "[null, true]", "[null, true]"]


def test_invalid_utf_8_does_not_end_the_session() -> None:
    told = served(request(1) + request(2), more={"a": "\ud800"})
    assert [(each["id"], each["result"]) for each in told] == [(1, {"a": "\ufffd"}), (2, {"a": "\ufffd"})]


def test_duplicate_ids_and_excess_requests_are_refused() -> None:
    told = served(request(0) + b"".join(map(request, range(MOST_OPEN + 1))), answers=False)
    assert [each["id"] for each in told] == [None, MOST_OPEN]
    assert f"{MOST_OPEN} requests wait" in told[1]["error"]["message"]


def test_a_host_that_is_gone_ends_it() -> None:
    assert served(request(1) + request(2), reads=False) == []
    assert served(b"[]\n" * 3, reads=False) == []


def test_a_host_that_ends_without_reading_ends_it() -> None:
    async def serve(ours_in: int, ours_out: int) -> None:
        async with streams(ours_in, ours_out, Greeted()) as (incoming, outgoing, _):
            async for message in incoming:
                answer = types.JSONRPCResponse(jsonrpc="2.0", id=message.message.id, result={"a": "x" * 200_000})
                await outgoing.send(SessionMessage(answer))

    with pipes() as (says, _, ours_in, ours_out):
        os.write(says, request(1) + request(2))
        os.close(says)
        anyio.run(serve, ours_in, ours_out)


def test_a_stream_that_cannot_be_read_or_written_is_an_error_of_its_own() -> None:
    async def serve(ours_in: int, ours_out: int) -> None:
        async with streams(ours_in, ours_out, Greeted()) as (incoming, _, _):
            async for _ in incoming:
                pass

    folder, full = os.open("/tmp", os.O_RDONLY), os.open("/dev/full", os.O_WRONLY)
    with pipes() as (says, _, ours_in, ours_out):
        with pytest.raises(IsADirectoryError):
            anyio.run(serve, folder, ours_out)
        os.write(says, b"[]\n")
        with pytest.raises(OSError, match="No space"):
            anyio.run(serve, ours_in, full)
    os.close(folder)
    os.close(full)
