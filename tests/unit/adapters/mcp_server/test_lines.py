"""Lines of a host over standard streams: however long one is, no more of it is kept than may be read."""

import io
import tracemalloc

import anyio
import pytest

pytest.importorskip("mcp", reason="the extra `mcp` is not installed: `make setup` installs it")

from rtshcua.adapters.mcp_server.server import MOST_LINE, Lines


class _Endless(io.RawIOBase):
    """A line of many octets, then `{}`."""

    def __init__(self, octets: int) -> None:
        self.left = octets

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        if self.left < 0:
            return 0
        count = min(len(buffer), self.left)
        buffer[:count] = b"[" * count
        self.left -= count
        if count < len(buffer):
            buffer[count : count + 4] = b"\n{}\n"
            self.left = -1
            return count + 4
        return count


def lines_of(octets: int) -> list[str]:
    async def read() -> list[str]:
        return [line async for line in Lines(io.BufferedReader(_Endless(octets)))]

    return anyio.run(read)


@pytest.mark.parametrize("octets", [MOST_LINE, 20 * MOST_LINE])
def test_a_long_line_is_told_as_no_message_and_not_kept(octets: int) -> None:
    tracemalloc.start()
    try:
        found = lines_of(octets)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert found == ["too long\n", "{}\n"]
    assert most < 4 * MOST_LINE


def test_a_line_of_too_many_values_is_told_as_no_message() -> None:
    async def read() -> list[str]:
        return [line async for line in Lines(io.BytesIO(b"[" + b"[]," * 100_000 + b"[]]\n{}\n"))]

    assert anyio.run(read) == ["too long\n", "{}\n"]
