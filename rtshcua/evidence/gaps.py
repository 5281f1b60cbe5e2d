"""The longest duration of an epoch, and the gaps of a log: times in which nothing was recorded (docs/log-format.md,
3).

A computer that stood still (suspended, swapping, stopped) seals late. This is not a forgery, because it still
holds the key of the epoch. It records the length of the gap in a record, `stalled`, which the epoch's key signs
like any other. The gap does not count as time of the epoch; all other time does, and a verifier reports records
that were left unsealed for longer.
"""

from typing import Final, NamedTuple

from rtshcua.evidence.epoch_key import LONGEST_US, MOST_RECORDS
from rtshcua.evidence.finding import Claim, Flaw
from rtshcua.evidence.records import DecisionRecord, Effect, Genesis, Recover, Signed
from rtshcua.model.quantity import Dimension, display

#: the effect with the length of the gap before it
STALLED: Final = "stalled"


class RecordGap(NamedTuple):
    """A gap of `us` before record number `record`. The signed record number `signed` signs for it, and the boundary
    does in record number `boundary`; None where that is missing.
    """

    record: int
    us: int
    signed: int | None = None
    boundary: int | None = None


def detail_of(silent_us: int) -> str:
    """The text of a gap's record: its length."""
    return f"{silent_us} us"


class EpochTerm:
    """Processes the records of one log in order, after the check of their clocks. Each must be in an epoch that is
    not over. `gaps` are the gaps so far for which a signed record signs.
    """

    __slots__ = ("_last_us", "_open", "_told", "_until_us", "gaps")

    def __init__(self) -> None:
        self.gaps: list[RecordGap] = []
        self._open: list[RecordGap] = []  # in this epoch
        self._told = False  # a gap was recorded in this epoch
        self._until_us = 0  # the latest time of an unsigned record
        self._last_us = 0

    def take(self, record: DecisionRecord | Effect, before: int) -> Flaw | None:
        """The flaw in the place of a record, `before` lines after the last signed one."""
        at_us = record.at_us
        if isinstance(record, Effect) and record.event == STALLED:
            flaw = self._stalled(record)
            if flaw is not None:
                return flaw
        if at_us > self._until_us or before > MOST_RECORDS:
            text = "an epoch was left unsealed: its seal is missing before this record"
            found = f"{before} records, {seconds(at_us - self._until_us + LONGEST_US)} after the last signed record"
            return Flaw("seal/missing", text, found, f"at most {MOST_RECORDS} records, {seconds(LONGEST_US)}")
        self._last_us = at_us
        return None

    def _stalled(self, record: Effect) -> Flaw | None:
        silent_us = record.at_us - self._last_us
        if self._told:
            return Flaw(
                "seal/gap", "a second gap is recorded in one epoch, which should have been sealed after the first"
            )
        if record.detail != detail_of(silent_us):
            text = (
                "the length of the recorded gap differs from the time since the previous record: a record "
                "was removed or moved"
            )
            return Flaw("seal/gap", text, record.detail, detail_of(silent_us))
        self._told = True
        self._until_us += silent_us
        self._open.append(RecordGap(record.seq, silent_us))
        return None

    def sign(self, record: Signed) -> None:
        """Process the next signed record: an epoch ends and the next begins."""
        at_us = record.at_us
        silent_us = at_us - self._last_us
        if silent_us > LONGEST_US and not isinstance(record, Genesis | Recover):  # monotonic time restarts there
            self._open.append(RecordGap(record.seq, silent_us))
        self.gaps += [gap._replace(signed=record.seq) for gap in self._open]
        self._open.clear()
        self._told = False
        self._last_us, self._until_us = at_us, at_us + LONGEST_US

    def all(self) -> tuple[RecordGap, ...]:
        """All gaps so far, including those for which nothing has signed yet."""
        return (*self.gaps, *self._open)


def told(gap: RecordGap) -> Claim:
    """What is not shown because nothing was recorded, and who vouches for the gap."""
    by = []
    if gap.signed is not None:
        by.append(f"the key that signed record {gap.signed}")
    if gap.boundary is not None:
        by.append(f"the boundary, which signed in record {gap.boundary} that it made no other entry before")
    who = f"vouched for by {' and by '.join(by)}" if by else "not signed for yet"
    text = f"what happened in a gap of {seconds(gap.us)} before record {gap.record}: nothing was recorded; {who}"
    return Claim("gap", text)


def seconds(us: int) -> str:
    """A duration as text for a person."""
    return display(us, Dimension.DURATION)
