"""A runtime that stalls between any two steps: whatever it records then, and whatever happened to its boundary
meanwhile, its log verifies, at its end and at each place where it may break off.
"""

import json
from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as some

from reference.seeds import epoch_seeds
from rtshcua.evidence.epoch_key import LONGEST_US
from rtshcua.evidence.log_writer import Recorder
from rtshcua.evidence.recovery import Examination, LogState
from rtshcua.evidence.report import LogVerdict
from rtshcua.evidence.verify import verify
from rtshcua.model.durability import SYNCED_FIRST, WRITTEN
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import Append, Command
from rtshcua.onboard.runtime.journal import Journal
from rtshcua.wire.keys import Duty, SigningKey

S = 1_000_000
KEY = SigningKey.from_seed(bytes(32), duty=Duty.LOG, development=True)
COMMAND = Command(7, "hover", 0, (), (), 0, 0, needs_record=True)
#: us since the previous step, the records, whether a command is sent, and whether the boundary is lost
STEPS = some.lists(
    some.tuples(
        some.one_of(some.integers(0, 300_000), some.integers(0, 70 * S)), some.integers(0, 4), some.booleans(),
        some.integers(0, 19).map(lambda drawn: drawn == 0),
    ),
    min_size=1, max_size=40,
)  # fmt: skip


def at(us: int) -> Now:
    return Now(us, 1_750_000_000_000_000 + us, 0)


class Signs:
    """A boundary that signs something, until it is lost."""

    def __init__(self, *, signs: bool) -> None:
        self.gone: str | None = None
        self._signs = signs

    def attest(self, now: Now, *, final: bool = False) -> bytes | None:
        return b"statement" if self._signs and self.gone is None else None

    def lost(self) -> str | None:
        return self.gone


def lines_of(steps: list[tuple[int, int, bool, bool]], end_us: int, *, signs: bool) -> Iterator[tuple[bytes, int]]:
    """The lines of a run, each with its durability."""
    recorder, boundary = (
        Recorder(lambda text: KEY.sign(text, duty=Duty.LOG), KEY.public, epoch_seeds()),
        Signs(signs=signs),
    )
    yield (
        recorder.genesis(at(0), bundle=b"", root=b"", boot=bytes(16), vehicle="quad-07", mission="m", mode="software"),
        SYNCED_FIRST,
    )
    recorder.attest, recorder.lost = boundary.attest, boundary.lost
    journal, us = Journal(recorder), 0
    for after_us, records, sends, loses in steps:
        us += after_us
        for number in range(records):
            decision = partial(recorder.effect, at(us), "approval")
            journal.tell(partial(journal.record, decision, at(us), WRITTEN, awaited=True))
            if loses and number == records // 2:
                boundary.gone = "it is gone"
            journal.effect(at(us), "succeeded")
        if sends:
            journal.add(COMMAND)
        for action in journal.take(at(us), ended=False):
            if isinstance(action, Append):
                yield action.line, action.durability
    for line in recorder.closing(at(us + end_us), ending="completed", tlog=None):
        yield line, SYNCED_FIRST


@settings(max_examples=settings().max_examples * 4)
@given(steps=STEPS, end_us=some.integers(0, 70 * S), signs=some.booleans())
def test_log_verifies_after_any_late_seal(steps: list[tuple[int, int, bool, bool]], end_us: int, signs: bool) -> None:
    given_to_disk = list(lines_of(steps, end_us, signs=signs))
    lines = [line for line, _ in given_to_disk]
    report = verify(lines)
    assert (report.verdict, report.failure) == (LogVerdict.VERIFIED, None)
    records: list[dict[str, Any]] = [json.loads(line) for line in lines]
    long = {(n, b["at_us"] - a["at_us"]) for n, (a, b) in enumerate(pairwise(records), 1)}
    assert {(gap.record, gap.us) for gap in report.gaps if gap.us > LONGEST_US} == {
        (number, us) for number, us in long if us > LONGEST_US
    }
    classes = {durability for (_, durability), record in zip(given_to_disk, records, strict=True) if "epoch" in record}
    assert classes == {SYNCED_FIRST}


@given(steps=STEPS, signs=some.booleans())
def test_interrupted_log_is_recovered_at_any_point(steps: list[tuple[int, int, bool, bool]], signs: bool) -> None:
    lines = [line for line, _ in lines_of(steps, 0, signs=signs)][:-1]
    examination = Examination(KEY.public)
    for line in lines:
        assert examination.take(line), examination.reason
        assert examination.examined().state is LogState.WHOLE
