"""Recovery of a log after a crash: the longest beginning that verifies is kept, and the rest is discarded.

A crash damages the end: the last line is incomplete, or (after a power cut) part of the lines that were not on the
disk yet is missing or zero. It neither writes complete records that do not follow the previous one, nor damages
data before a signed record, which was on the disk before the signed record was written. Such damage is not the
result of a crash: `TAMPERED`.

Recovery cannot tell whether the records after the last signed one are unchanged, because the key of their epoch
was lost with the process. They are kept as found, and the `recover` record says where they end.
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

#: the `ending` in the close of a recovered log
RECOVERED = "recovered"


class LogState(Enum):
    """The state of a log for recovery. `closed`: nothing to do. `whole`: ends after a complete record, without a
    close. `torn`: ends in the remains of a crash. `unbegun`: has no complete record.

    The others are not recovered: `tampered` was changed, and `foreign` was begun under another log key.
    """

    CLOSED = "closed"
    WHOLE = "whole"
    TORN = "torn"
    UNBEGUN = "unbegun"
    TAMPERED = "tampered"
    FOREIGN = "foreign"


RECOVERABLE = (LogState.WHOLE, LogState.TORN)


class FoundLog(NamedTuple):
    """A log as found. Its first `records`, `kept` octets, verify; `head` follows them and can be continued once.
    `sealed` counts the records up to and including the last signed one. `discarded` octets with that SHA-256
    follow.

    `reason` is the flaw at the end of the kept part, None if there is none. `latest_us` is a lower bound of the
    present UTC according to the kept records, in us.
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
    """Processes the lines of a log in order, including those after the kept part; memory does not grow with the log.

    `public` is the log key (Ed25519, 32 bytes) that would sign the recovery; without it no log is foreign.
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
        self._whole = False  # the first line that is not kept is a record in the wrong place
        self._more = False  # a later line follows that was written after the end of the kept part was on the disk
        self._discarded = 0
        self._digest = sha256()

    def take(self, line: bytes) -> bool:
        """Whether the next line (with its newline, if it has one) is kept."""
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
        """Whether this is a record that was written after the kept part, and more, was on the disk."""
        if self.genesis is None:
            return not isinstance(_read(line), Flaw)
        return is_signed(line) and isinstance(_read(line), Genesis | Seal | Recover | Close)

    def _check(self, record: AnyRecord, line: bytes) -> Flaw | None:
        head = self.head
        if isinstance(record, Genesis) != (head.seq == 0):
            slug = "genesis/repeated" if head.seq else "genesis/missing"
            return Flaw(slug, "a genesis is only allowed at the beginning of a log", record.type)
        if record.seq != head.seq:
            text = f"found record {record.seq} where record {head.seq} is expected"
            return Flaw("chain/sequence", text, str(record.seq), str(head.seq))
        if record.prev != head.prev:
            return Flaw("chain/broken", "the record does not follow the record before it", head.prev, record.prev)
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
        """The result, after the last line."""
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
    """The two lines that end a log in state `WHOLE` or `TORN` after its kept part: `recover` and `close`.

    `certify` signs with the log key `public`, `draw` returns 32 secret random bytes for the key of the close. If
    the clock is earlier than the log, the stated error of UTC is increased by the difference.
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
        return Flaw("tail/torn", f"the log ends inside this record, after {len(line)} of its bytes", shown(line))
    return read(line)
