"""What of a log is kept after a crash: the longest beginning that verifies. What the crash left behind it is cut off.

A crash tears the end: the last line has no end, or (after a power cut) something in the lines that were not on the disk
yet is missing or zero. It neither writes whole records that do not follow the one before, nor does it damage what
stands before a signed record, for that was on the disk before the signed record was written. Whatever looks like that
was not a crash, and is not signed: `TAMPERED`.

What recovery cannot tell: whether the records after the last signed one are as they were written, for the key of their
epoch died with the process. They are kept as found, and the `recover` record says where they end.
"""

from collections.abc import Callable
from enum import Enum
from hashlib import sha256
from typing import NamedTuple

from rtshcua.evidence.clocks import Clocks
from rtshcua.evidence.finding import Finding, Flaw
from rtshcua.evidence.gaps import EpochTerm
from rtshcua.evidence.heads import Head
from rtshcua.evidence.log_writer import Recorder, origin_of
from rtshcua.evidence.reading import behind_close, read, shown, too_long
from rtshcua.evidence.records import AnyRecord, Close, DecisionRecord, Effect, Genesis, Recover, Seal, is_signed
from rtshcua.evidence.seal_verification import Seals
from rtshcua.model.flat.situation import Now

#: the ending that the close of a recovered log names
RECOVERED = "recovered"


class LogState(Enum):
    """What a log is to recovery: `closed`: nothing to do. `whole`: ends between two records, without a close. `torn`:
    there is something behind the last record, as a crash leaves it. `unbegun`: it has not even a first record.

    The rest is not recovered: `tampered` was changed, and `foreign` was begun under another log key.
    """

    CLOSED = "closed"
    WHOLE = "whole"
    TORN = "torn"
    UNBEGUN = "unbegun"
    TAMPERED = "tampered"
    FOREIGN = "foreign"


RECOVERABLE = (LogState.WHOLE, LogState.TORN)


class FoundLog(NamedTuple):
    """A log as it was found. Its first `records`, `kept` octets, verify; `head` stands behind them, to be gone on from
    once. `sealed` counts the records up to the last signed one, it included. `discarded` octets of that SHA-256 follow.

    `reason` is what is wrong where the kept part ends, None where nothing is. `latest_us` is the greatest UTC that the
    kept records leave no doubt of, in us: it is later now.
    """

    state: LogState
    genesis: Genesis | None
    head: Head
    records: int
    kept: int
    sealed: int
    discarded: int
    discarded_digest: bytes
    reason: Finding | None
    latest_us: int


class Examination:
    """Takes the lines of a log in order, also after the first that is not kept; memory does not grow with the log.

    `public` is the log key (Ed25519, 32 bytes) that would sign the recovery; without one no log is foreign.
    """

    def __init__(self, public: bytes | None) -> None:
        self.head = Head()
        self.kept = 0
        self.genesis: Genesis | None = None
        self.reason: Finding | None = None
        self._public = None if public is None else public.hex()
        self._clocks, self._seals, self._term = Clocks(), Seals(), EpochTerm()
        self._latest_us = 0
        self._sealed = 0
        self._closed = False
        self._whole = False  # the first line that is not kept is a record, only in the wrong place
        self._more = False  # behind what is kept stands what was written later than it was on the disk
        self._discarded = 0
        self._digest = sha256()

    def take(self, line: bytes) -> bool:
        """Whether the next line (newline included, if it has one) is kept."""
        if self.reason is None:
            record = behind_close(line) if self._closed else _read(line)
            flaw = record if isinstance(record, Flaw) else self._check(record, line)
            if flaw is None:
                self.kept += len(line)
                return True
            self.reason = flaw.at(self.head.seq, self.kept)
            self._whole = not isinstance(record, Flaw)
        self._discarded += len(line)
        self._digest.update(line)
        if not self._more:
            self._more = self._is_later(line)
        return False

    def _is_later(self, line: bytes) -> bool:
        """Whether this is a record that was written after all that is kept, and more, was on the disk."""
        if self.genesis is None:
            return not isinstance(_read(line), Flaw)
        return is_signed(line) and isinstance(_read(line), Genesis | Seal | Recover | Close)

    def _check(self, record: AnyRecord, line: bytes) -> Flaw | None:
        head = self.head
        if isinstance(record, Genesis) != (head.seq == 0):
            slug = "genesis/repeated" if head.seq else "genesis/missing"
            return Flaw(slug, "a log has one genesis, and begins with it", record.type)
        if record.seq != head.seq:
            text = f"record {record.seq} stands where record {head.seq} belongs"
            return Flaw("chain/sequence", text, str(record.seq), str(head.seq))
        if record.prev != head.prev:
            return Flaw("chain/broken", "it was not written after the record before it", head.prev, record.prev)
        flaw = self._clocks.check(record) or self._check_epoch(record, line)
        if flaw is None:
            self._latest_us = max(self._latest_us, record.utc_us - record.utc_error_us)
        return flaw

    def _check_epoch(self, record: AnyRecord, line: bytes) -> Flaw | None:
        head = self.head
        if isinstance(record, DecisionRecord | Effect):
            flaw = self._term.take(record, head.records)
            if flaw is None:
                head.take(line)
            return flaw
        flaw = self._seals.follow(record, line, head)
        if flaw is not None:
            return flaw
        self._sealed = head.seq
        self._term.sign(record)
        self._closed = isinstance(record, Close)
        if isinstance(record, Genesis):
            self.genesis = record
        return None

    def examined(self) -> FoundLog:
        """The whole, once the lines are over."""
        return FoundLog(
            state=self._state(),
            genesis=self.genesis,
            head=self.head,
            records=self.head.seq,
            kept=self.kept,
            sealed=self._sealed,
            discarded=self._discarded,
            discarded_digest=self._digest.digest(),
            reason=self.reason,
            latest_us=self._latest_us,
        )

    def _state(self) -> LogState:
        if self.reason is not None and (self._whole or self._more or self._closed):
            return LogState.TAMPERED
        if self.genesis is None:
            return LogState.UNBEGUN
        if self._closed:
            return LogState.CLOSED
        if self._public not in (None, self.genesis.log_key):
            return LogState.FOREIGN
        return LogState.WHOLE if self.reason is None else LogState.TORN


def ending(
    examined: FoundLog, now: Now, certify: Callable[[bytes], bytes], public: bytes, draw: Callable[[], bytes]
) -> bytes:
    """The two lines that end a log in state `WHOLE` or `TORN` after what is kept of it: `recover` and `close`.

    `certify` signs with the log key `public`, `draw` gives 32 secret random bytes for the key of the close. Where the
    clock says that it is earlier than the log does, the error of its UTC is stated as great as that makes it.
    """
    assert examined.genesis is not None
    assert examined.state in RECOVERABLE
    error_us = max(now.utc_error_us, examined.latest_us - now.utc_us)
    now = Now(now.monotonic_us, now.utc_us, error_us)
    origin = origin_of(examined.genesis.vehicle, examined.genesis.boot)
    recorder = Recorder.resumed(examined.head, origin, certify, public, draw)
    recover = recorder.recover(now, discarded_bytes=examined.discarded, discarded_digest=examined.discarded_digest)
    return recover + recorder.close(now, ending=RECOVERED, tlog=None)


def _read(line: bytes) -> AnyRecord | Flaw:
    flaw = too_long(line)
    if flaw is not None:
        return flaw
    if not line.endswith(b"\n"):
        return Flaw("tail/torn", f"the log ends inside this record, {len(line)} bytes into it", shown(line))
    return read(line)
