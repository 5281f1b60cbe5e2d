"""The end of the editor's stream ends the process, whether it comes between two messages or within one."""

from collections.abc import Callable
from io import BytesIO

import pytest

from rtshcua.front.lsp import server
from rtshcua.front.lsp.server import GRACE, LARGEST, LONGEST, Watched


class Forced:
    """Replace the call that ends the process."""

    started: list[float]

    def __init__(self, seconds: float, end: Callable[[int], None], arguments: tuple[int]) -> None:
        self.seconds = seconds
        self.daemon = False

    def start(self) -> None:
        assert self.daemon, "it keeps nothing alive"
        self.started.append(self.seconds)


@pytest.fixture(autouse=True)
def started(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    monkeypatch.setattr(server, "Timer", Forced)
    Forced.started = []
    return Forced.started


def test_whole_lines_and_bodies_end_nothing(started: list[float]) -> None:
    stream = Watched(BytesIO(b"a line\nbody\n"))
    assert (stream.readline(), stream.read(5)) == (b"a line\n", b"body\n")
    assert started == []


@pytest.mark.parametrize("left", [b"", b"Content-Le"])
def test_stream_that_ends_before_or_within_a_line_ends_the_process(left: bytes, started: list[float]) -> None:
    assert Watched(BytesIO(left)).readline() == left
    assert started == [GRACE]


@pytest.mark.parametrize("left", [b"", b'{"jsonrpc'])
def test_stream_that_ends_before_or_within_a_body_ends_the_process(left: bytes, started: list[float]) -> None:
    """A truncated message cannot be answered after the stream's end, so nothing more is read."""
    assert Watched(BytesIO(left)).read(999) == left
    assert started == [GRACE]


@pytest.mark.parametrize("size", [LARGEST + 1, 10**30])
def test_a_message_of_more_bytes_than_any_has_ends_the_process(size: int, started: list[float]) -> None:
    """A huge `Content-Length` is refused without waiting or allocating."""
    stream = BytesIO(b"{}")
    assert Watched(stream).read(size) == b""
    assert stream.tell() == 0
    assert started == [GRACE]


def test_a_line_that_does_not_end_ends_the_process(started: list[float]) -> None:
    assert len(Watched(BytesIO(b"X" * 2 * LONGEST)).readline()) == LONGEST
    assert started == [GRACE]
