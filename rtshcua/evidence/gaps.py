"""How long an epoch may go on, and the gaps of a log: times in which nothing was recorded (docs/log-format.md, 3).

A computer that stood still (suspended, swapping, stopped) seals late, which is no forgery: it holds the key of the
epoch when it goes on. What it missed it says in a record, `stalled`, which the epoch's key signs for like any other.
That time does not count for the epoch. All else does: who leaves records unsealed for longer is told.
"""

from typing import Final, NamedTuple

from rtshcua.evidence.epoch_key import LONGEST_US, MOST_RECORDS
from rtshcua.evidence.finding import Claim, Flaw
from rtshcua.evidence.records import DecisionRecord, Effect, Genesis, Recover, Signed
from rtshcua.model.quantity import Dimension, display

#: the effect that says how long nothing was recorded before it
STALLED: Final = "stalled"


class RecordGap(NamedTuple):
    """`us` in which nothing was recorded, before record number `record`. The signed record number `signed` signs for
    it; the boundary does in record number `boundary`. None where none does.
    """

    record: int
    us: int
    signed: int | None = None
    boundary: int | None = None


def detail_of(silent_us: int) -> str:
    """What the record of a gap says of its length."""
    return f"{silent_us} us"


class EpochTerm:
    """Takes the records of one log in their order, after their clocks were checked: each stands in an epoch that was
    not over. `gaps` are those that it found, and that a signed record signs for.
    """

    __slots__ = ("_last_us", "_open", "_told", "_until_us", "gaps")

    def __init__(self) -> None:
        self.gaps: list[RecordGap] = []
        self._open: list[RecordGap] = []  # in this epoch
        self._told = False  # one was recorded in this epoch
        self._until_us = 0  # a record that is not signed stands no later than this
        self._last_us = 0

    def take(self, record: DecisionRecord | Effect, before: int) -> Flaw | None:
        """What is wrong with the place of a record, `before` lines after the last signed one."""
        at_us = record.at_us
        if isinstance(record, Effect) and record.event == STALLED:
            flaw = self._stalled(record)
            if flaw is not None:
                return flaw
        if at_us > self._until_us or before > MOST_RECORDS:
            text = "an epoch was left unsealed: its seal should stand before this record"
            found = f"{before} records, {seconds(at_us - self._until_us + LONGEST_US)} after the last signed record"
            return Flaw("seal/missing", text, found, f"at most {MOST_RECORDS} records, {seconds(LONGEST_US)}")
        self._last_us = at_us
        return None

    def _stalled(self, record: Effect) -> Flaw | None:
        silent_us = record.at_us - self._last_us
        if self._told:
            return Flaw(
                "seal/gap", "a second gap is recorded in an epoch, which should have been sealed after the first"
            )
        if record.detail != detail_of(silent_us):
            text = "the gap that is recorded here is not the time since the record before: one was taken out or moved"
            return Flaw("seal/gap", text, record.detail, detail_of(silent_us))
        self._told = True
        self._until_us += silent_us
        self._open.append(RecordGap(record.seq, silent_us))
        return None

    def sign(self, record: Signed) -> None:
        """Take the next signed record: an epoch ends, and the next begins."""
        at_us = record.at_us
        silent_us = at_us - self._last_us
        if silent_us > LONGEST_US and not isinstance(record, Genesis | Recover):  # monotonic time begins there
            self._open.append(RecordGap(record.seq, silent_us))
        self.gaps += [gap._replace(signed=record.seq) for gap in self._open]
        self._open.clear()
        self._told = False
        self._last_us, self._until_us = at_us, at_us + LONGEST_US

    def all(self) -> tuple[RecordGap, ...]:
        """All gaps so far, those too for which nobody has signed yet."""
        return (*self.gaps, *self._open)


def told(gap: RecordGap) -> Claim:
    """What is not shown, for nothing was recorded; and who vouches for that."""
    by = []
    if gap.signed is not None:
        by.append(f"the key that signed record {gap.signed}")
    if gap.boundary is not None:
        by.append(f"the boundary, which signed in record {gap.boundary} that it made nothing else before")
    who = f"vouched for by {' and by '.join(by)}" if by else "nobody has signed for that yet"
    text = f"what happened in a gap of {seconds(gap.us)} before record {gap.record}: nothing was recorded; {who}"
    return Claim("gap", text)


def seconds(us: int) -> str:
    """A time, for a person."""
    return display(us, Dimension.DURATION)
