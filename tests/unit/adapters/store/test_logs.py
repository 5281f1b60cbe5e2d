"""Reading lines in bounded memory."""

import io

import pytest

from rtshcua.adapters.store import logs
from rtshcua.evidence import reading
from rtshcua.evidence import verify as verifier


def test_lines_come_with_their_ends() -> None:
    assert list(logs.lines(io.BytesIO(b"a\nb\n\nc"))) == [b"a\n", b"b\n", b"\n", b"c"]


def test_a_line_without_end_is_never_read_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (logs, reading):
        monkeypatch.setattr(module, "LONGEST", 10)
    pieces = list(logs.lines(io.BytesIO(b"x" * 25)))
    assert [len(piece) for piece in pieces] == [11, 11, 3]
    report = verifier.verify(pieces)
    assert report.failure is not None
    assert report.failure.slug == "record/too-long"
