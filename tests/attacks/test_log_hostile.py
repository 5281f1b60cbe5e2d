"""Threat: a log made to break its reader: huge, deep, binary, hostile to the terminal."""

import tracemalloc
from collections.abc import Iterator

import pytest

from reference.forgery import ROOT_KEY, edit, expect, flight, rewritten
from rtshcua.cli.shown import plain
from rtshcua.evidence.chain import Chain
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import LARGEST, Effect, Genesis
from rtshcua.ground.auditor.audit import Auditor

LINES = flight()


@pytest.mark.parametrize(
    "line",
    [
        b"\x00" * 1000 + b"\n",
        b"[" * 200_000 + b"\n",
        b'{"a":' * 100_000 + b"\n",
        b'{"_prev":' + b"[" * 100_000 + b',"type":"effect"}\n',
        b'{"type":"effect","seq":' + b"9" * 100_000 + b"}\n",
        b'"' + b"\\u0000" * 10_000 + b'"\n',
    ],
)
def test_no_line_breaks_the_reader(line: bytes) -> None:
    assert expect([*LINES[:2], line]) == ("record/malformed", 2)
    assert expect([line])[0] in ("record/malformed", "genesis/missing")


@pytest.mark.parametrize("number", [LARGEST + 1, -LARGEST - 1, 10**400, -1])
def test_no_number_is_too_large_to_refuse(number: int) -> None:
    assert expect(rewritten([LINES[0], edit(LINES[1], at_us=number)])) == ("record/malformed", 1)


def test_memory_does_not_grow_with_the_log() -> None:
    """A hundred thousand effects take no more than a few thousand do."""

    def long(count: int) -> Iterator[bytes]:

        chain, genesis = Chain(), read(LINES[0])
        assert isinstance(genesis, Genesis)
        yield chain.add(genesis)
        for number in range(count):
            at_us, utc_us = genesis.at_us + number, genesis.utc_us + number
            yield chain.add(Effect(chain.prev, at_us, "", "note", -1, -1, chain.seq, -1, -1, "effect", 0, utc_us))

    def peak(count: int) -> int:
        auditor = Auditor(ROOT_KEY)
        source = long(count)
        auditor.take(next(source))
        tracemalloc.start()
        for line in source:
            assert auditor.take(line)
        used = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert auditor.audit().report.records == count + 1
        return used

    assert peak(20_000) < peak(1_000) + 20_000


def test_a_hostile_text_does_not_reach_the_terminal() -> None:
    shown = plain("\x1b[2J\x1b]0;owned\x07\rVERIFIED\u202eDEIFIREV\n")
    assert shown.isprintable()
    assert "\\x1b[2J" in shown
