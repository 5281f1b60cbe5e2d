"""The verification of a log, line by line in constant memory. The steps, in their order, as the comments number them:

1. the line: ended by a newline, not too long, nothing after the close
2. the record: known type, every field there and of its kind, written in the one canonical form
3. the genesis: first, and only there; a known format and version; a log key that is the one it names
4. the chain: numbered without gap, and each record names the hash of the line before it
5. the clock: monotonic time never goes back, nor does UTC by more than its stated error allows
6. the close: count, signature by the log key of the genesis, size and Merkle root recomputed from the lines
7. the end: a signed close, or else what is missing

What the caller must do: trust the genesis' log key, bundle and trust root, and derive the decisions again
(`rtshcua.ground.auditor`).
"""

from collections.abc import Iterable

from rtshcua.evidence.chain import START
from rtshcua.evidence.closing import check_close
from rtshcua.evidence.finding import Finding, Flaw
from rtshcua.evidence.merkle import Tree, leaf_hash
from rtshcua.evidence.reading import LONGEST, read
from rtshcua.evidence.records import AnyRecord, Close, Decision, Genesis
from rtshcua.evidence.report import Report, claims
from rtshcua.wire.keys import Duty, key_id

_LINK = slice(10, 74)  # where the value of `_prev` stands
_SHOWN = 80  # bytes of a line that a finding quotes


class Verifier:
    """Takes the lines of a log in order; after the first that fails it takes no more."""

    def __init__(self) -> None:
        self.records = 0
        self.genesis: Genesis | None = None
        self.close: Close | None = None
        self.failure: Finding | None = None
        self._counts: dict[str, int] = {}
        self._tree = Tree()
        self._prev = START
        self._at_us = self._utc_low = 0
        self._torn: bytes | None = None
        self._doubt: tuple[bytes, Finding] | None = None  # hash of the line after a broken link, and what it then is

    def take(self, line: bytes) -> AnyRecord | None:
        """The record of the next line (newline included), or None when the log ends or fails there."""
        if self.failure is not None:
            return None
        if self._doubt is not None:
            self.failure = self._settled(line)
            return None
        record = self._read(line)
        if record is None:
            return None
        if isinstance(record, Flaw):
            self.failure = record.at(self.records)
            return None
        leaf = leaf_hash(line)
        flaw = self._check_place(record)
        if flaw is None and record.prev != self._prev:
            self._doubt = leaf, self._broken_link(record)
            return None
        flaw = flaw or self._check_clock(record) or self._check_end_of(record, leaf)
        if flaw is not None:
            self.failure = flaw.at(self.records)
            return None
        self._prev = leaf.hex()
        self.records += 1
        self._count(record)
        return record

    def fail(self, finding: Finding) -> None:
        """Ends the verification for a reason of the caller's own."""
        self.failure = finding

    def _count(self, record: AnyRecord) -> None:
        counts = self._counts
        counts[record.type] = counts.get(record.type, 0) + 1
        if isinstance(record, Decision):
            counts[record.outcome] = counts.get(record.outcome, 0) + 1

    def _read(self, line: bytes) -> AnyRecord | Flaw | None:
        # 1 the line
        if self.close is not None:
            return Flaw("close/junk-after", "there is something after the signed close", _shown(line))
        if len(line) > LONGEST:
            return Flaw(
                "record/too-long", "the line is too long for a record", f"{len(line)} bytes", f"{LONGEST} bytes"
            )
        if self._torn is not None:
            return Flaw("record/malformed", "a line without its end stands before others", _shown(self._torn))
        if not line.endswith(b"\n"):
            self._torn = line
            return None
        # 2 the record
        record = read(line)
        return record._replace(found=_shown(line)) if isinstance(record, Flaw) and not record.found else record

    def _check_place(self, record: AnyRecord) -> Flaw | None:
        number = self.records
        # 3 the genesis
        if isinstance(record, Genesis):
            if number:
                return Flaw("genesis/repeated", "a second log begins inside this one")
            key = key_id(Duty.LOG, bytes.fromhex(record.log_key)).hex()
            if record.log_kid != key:
                return Flaw("genesis/log-key", "the log key is not the one that is named", record.log_kid, key)
            self.genesis = record
        elif self.genesis is None:
            text = "the log does not begin with its genesis: its head was cut off"
            return Flaw("genesis/missing", text, record.type, "genesis")
        # 4 the chain
        if record.seq != number:
            text = f"record {record.seq} stands where record {number} belongs: records were taken out, added or moved"
            return Flaw("chain/sequence", text, str(record.seq), str(number))
        if not number and record.prev != START:
            return Flaw("chain/broken", "the genesis names a record before it", record.prev, START)
        return None

    def _broken_link(self, record: AnyRecord) -> Finding:
        before, after = self.records - 1, self.records
        text = f"record {after} was not written after record {before} as it stands here: one of the two was changed"
        return Finding("chain/broken", before, text, self._prev, record.prev)

    def _settled(self, line: bytes) -> Finding:
        """Which of the two records at a broken link was changed: the line after them was written after the second."""
        assert self._doubt is not None
        (leaf, finding), self._doubt = self._doubt, None
        return finding if line[_LINK] == leaf.hex().encode() else finding._replace(record=self.records)

    def _check_clock(self, record: AnyRecord) -> Flaw | None:
        # 5 the clock
        at_us, latest, earliest = record.at_us, record.utc_us + record.utc_error_us, record.utc_us - record.utc_error_us
        if at_us < self._at_us:
            text = "its monotonic time lies before that of the record before it"
            return Flaw("clock/backwards", text, f"{at_us} us", f"{self._at_us} us or later")
        if latest < self._utc_low:
            text = "its time of day lies before that of an earlier record, by more than the errors stated for both"
            return Flaw("clock/utc-backwards", text, f"{latest} us at most", f"{self._utc_low} us at least")
        self._at_us, self._utc_low = at_us, max(self._utc_low, earliest)
        return None

    def _check_end_of(self, record: AnyRecord, leaf: bytes) -> Flaw | None:
        if not isinstance(record, Close):
            self._tree.push(leaf)
            return None
        # 6 the close
        assert self.genesis is not None
        flaw = check_close(record, self.genesis, self._tree)
        self.close = record if flaw is None else None
        return flaw

    def report(self) -> Report:
        """The whole, once the lines are over."""
        if self._doubt is not None:
            self.failure, self._doubt = self._doubt[1], None
        # 7 the end
        shortfall = None
        if self.failure is None and self.close is None:
            self.failure, shortfall = self._end()
        proven, unproven = claims(self.records, self.genesis, self.close, self.failure)
        return Report(
            records=self.records,
            counts=self._counts,
            failure=self.failure,
            shortfall=shortfall,
            genesis=self.genesis,
            close=self.close,
            last_us=self._at_us,
            root=self._tree.root(),
            proven=proven,
            unproven=unproven,
        )

    def _end(self) -> tuple[Finding | None, Finding | None]:
        """Failure and shortfall of a log that ends without a close."""
        number, torn = self.records, self._torn
        if torn is None and number:
            return None, Finding(
                "close/missing", number, f"the log ends after {number} records, without its signed close"
            )
        if not torn:
            text = "the log is empty: nothing was ever written, or all of it was cut off"
            return Finding("log/empty", number, text), None
        start = b'{"_prev":"' + self._prev.encode() + b'","at_us":'
        if not (torn.startswith(start) or start.startswith(torn)):
            text = "what stands after the last whole record is not the beginning of another"
            return Finding("record/malformed", number, text, _shown(torn), _shown(start)), None
        if not number:
            return Finding("genesis/missing", number, "the log ends inside its first record", _shown(torn)), None
        text = f"the log ends inside record {number}, {len(torn)} bytes into it"
        return None, Finding("tail/torn", number, text)


def verify(lines: Iterable[bytes]) -> Report:
    """Verifies the lines of a log, each with its newline, as a file opened in binary mode yields them."""
    verifier = Verifier()
    for line in lines:
        verifier.take(line)
        if verifier.failure is not None:
            break
    return verifier.report()


def _shown(line: bytes) -> str:
    return line[:_SHOWN].decode("utf-8", "backslashreplace")
