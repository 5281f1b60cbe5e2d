"""Threat: a log made to break its reader: huge, deep, binary, or with terminal escapes."""

import tracemalloc
from base64 import b64decode
from collections.abc import Iterator

import pytest

from reference.forgery import LOG_KEY, ROOT_KEY, edit, expect, flight, read, rewritten
from reference.seeds import epoch_seeds
from rtshcua.diagnostics.excerpt import visible
from rtshcua.evidence.log_writer import Recorder
from rtshcua.evidence.records import LARGEST
from rtshcua.ground.audit.audit import Auditor
from rtshcua.model.flat.situation import Now
from rtshcua.wire.keys import Duty
from virtual.rows import rows

LINES = flight()


@rows(
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


@pytest.mark.parametrize(
    ("few", "many"), [(1_000, 3_000), pytest.param(2_000, 20_000, marks=pytest.mark.soak)], ids=["some", "many"]
)
def test_memory_does_not_grow_with_the_log(few: int, many: int) -> None:
    """Many effects take no more than few do."""

    def long(count: int) -> Iterator[bytes]:
        genesis = read(LINES[0])
        recorder = Recorder(lambda text: LOG_KEY.sign(text, duty=Duty.LOG), LOG_KEY.public, epoch_seeds())
        at = Now(genesis["at_us"], genesis["utc_us"], genesis["utc_error_us"])
        given = {name: b64decode(genesis[name]) for name in ("bundle", "root")}
        names = {name: genesis[name] for name in ("vehicle", "mission", "mode")}
        yield recorder.genesis(at, **given, boot=bytes(16), **names)
        for _ in range(count):
            if recorder.due(at):
                yield recorder.seal(at)
            yield recorder.effect(at, "note")

    def peak(count: int) -> int:
        auditor = Auditor(ROOT_KEY)
        source = long(count)
        auditor.take(next(source))
        tracemalloc.start()
        for line in source:
            assert auditor.take(line)
        used = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert auditor.audit().report.counts["effect"] == count
        return used

    assert peak(many) < peak(few) + 20_000


def test_a_hostile_text_does_not_reach_the_terminal() -> None:
    shown = visible("\x1b[2J\x1b]0;owned\x07\rVERIFIED\u202eDEIFIREV\n")
    assert shown.isprintable()
    assert "<U+001B>[2J" in shown
