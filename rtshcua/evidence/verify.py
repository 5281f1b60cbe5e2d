"""Verifies a log line by line in constant memory. The steps in order, as the comments number them:

1. the line: ended by a newline, not too long, nothing after the close
2. the record: known type, every field present and of its type, written in canonical form
3. the genesis: first, and only there; a known format and version
4. the chain: numbered without a gap, and each record names the hash of the previous line
5. the clocks: monotonic time never goes back, nor does UTC by more than its stated error, and both advance alike
6. the epochs: each sealed in time (`gaps`), by the key that the previous signed record names (`seals`)
7. the end: a close, or else the reason why it is missing

These are the steps of section 5 of docs/log-format.md except its steps 2 and 3. The caller must establish trust in
the genesis' log key, bundle and trust root, and derive the decisions again (`rtshcua.ground.audit`).
"""

from collections.abc import Iterable

from rtshcua.evidence.clocks import Clocks
from rtshcua.evidence.finding import Finding, Flaw
from rtshcua.evidence.gaps import EpochTerm, told
from rtshcua.evidence.heads import START, Head
from rtshcua.evidence.merkle import leaf_hash
from rtshcua.evidence.reading import SHOWN, behind_close, may_be_torn, read, shown, too_long
from rtshcua.evidence.records import AnyRecord, Close, DecisionRecord, Effect, Genesis
from rtshcua.evidence.report import LogReport, claims, unsealed
from rtshcua.evidence.seal_verification import Seals

_LINK = slice(10, 74)  # the offset of the value of `_prev`


class LogVerifier:
    """Processes the lines of a log in order and stops after the first flaw."""

    def __init__(self) -> None:
        self.genesis: Genesis | None = None
        self.close: Close | None = None
        self.failure: Finding | None = None
        self.offset = 0  # offset of the next line
        self.seals = Seals()
        self._counts: dict[str, int] = {}
        self._head = Head()
        self._clocks = Clocks()
        self._before = 0  # offset of the last line
        self._torn: bytes | None = None
        self._doubt: tuple[bytes, Finding] | None = None  # hash of the line after a broken link, and the flaw
        self._term = EpochTerm()

    @property
    def records(self) -> int:
        """The number of correct records."""
        return self._head.seq

    def take(self, line: bytes) -> AnyRecord | None:
        """The record of the next line (newline included), or None if the log ends or fails there."""
        if self.failure is not None:
            return None
        if self._doubt is not None:
            self.failure = self._settled(line)
            return None
        record = self._read(line)
        if record is None:
            return None
        if isinstance(record, Flaw):
            self.failure = record.at(self.records, self.offset)
            return None
        flaw = self._check_place(record)
        if flaw is None and record.prev != self._head.prev:
            self._doubt = leaf_hash(line), self._broken_link(record)
            return None
        flaw = flaw or self._clocks.check(record) or self._check_epoch(record, line)
        if flaw is not None:
            self.failure = flaw.at(self.records, self.offset)
            return None
        self._before, self.offset = self.offset, self.offset + len(line)
        counts = self._counts
        counts[record.type] = counts.get(record.type, 0) + 1
        if isinstance(record, DecisionRecord):
            counts[record.outcome] = counts.get(record.outcome, 0) + 1
        return record

    def fail(self, finding: Finding) -> None:
        """End the verification with a flaw found by the caller."""
        self.failure = finding

    def _read(self, line: bytes) -> AnyRecord | Flaw | None:
        # 1 the line
        if self.close is not None:
            return behind_close(line)
        flaw = too_long(line)
        if flaw is not None:
            return flaw
        if self._torn is not None:
            return Flaw("record/malformed", "a line without its newline precedes others", shown(self._torn))
        if not line.endswith(b"\n"):
            self._torn = line
            return None
        # 2 the record
        record = read(line)
        return record._replace(found=shown(line)) if isinstance(record, Flaw) and not record.found else record

    def _check_place(self, record: AnyRecord) -> Flaw | None:
        number = self._head.seq
        # 3 the genesis
        if isinstance(record, Genesis):
            if number:
                return Flaw("genesis/repeated", "the log contains the beginning of a second log")
        elif self.genesis is None:
            text = "the log does not begin with its genesis: its beginning was removed"
            return Flaw("genesis/missing", text, record.type, "genesis")
        # 4 the chain
        if record.seq != number:
            text = f"found record {record.seq} where record {number} is expected: records were removed, added or moved"
            return Flaw("chain/sequence", text, str(record.seq), str(number))
        if not number and record.prev != START:
            return Flaw("chain/broken", "the genesis names a previous record", record.prev, START)
        return None

    def _broken_link(self, record: AnyRecord) -> Finding:
        before, after = self.records - 1, self.records
        text = f"record {after} does not follow record {before}: one of the two was changed"
        return Finding("chain/broken", before, text, self._head.prev, record.prev, self._before)

    def _settled(self, line: bytes) -> Finding:
        """Decide which of the two records at a broken link was changed, because the line after them follows the
        second.
        """
        assert self._doubt is not None
        (leaf, finding), self._doubt = self._doubt, None
        if line[_LINK] == leaf.hex().encode():
            return finding
        return finding._replace(record=self.records, offset=self.offset)

    def _check_epoch(self, record: AnyRecord, line: bytes) -> Flaw | None:
        # 6 the epochs
        head = self._head
        if isinstance(record, DecisionRecord | Effect):
            flaw = self._term.take(record, head.seq - head.first)
            if flaw is None:
                head.take(line)
            return flaw
        flaw = self.seals.follow(record, line, head)
        if flaw is not None:
            return flaw
        self._term.sign(record)
        if isinstance(record, Genesis):
            self.genesis = record
        elif isinstance(record, Close):
            self.close = record
        return None

    def report(self) -> LogReport:
        """The report, after the last line."""
        if self._doubt is not None:
            self.failure, self._doubt = self._doubt[1], None
        # 7 the end
        shortfall = None
        if self.failure is None and self.close is None:
            self.failure, shortfall = self._end()
        sealed = self._head.first + 1 if self.genesis is not None else 0
        proven, unproven = claims(
            self.records, sealed, self.seals.epochs, self.genesis, self.close, self.failure, self.seals.recoveries
        )
        gaps = () if self.failure is not None else self._term.all()
        if self.failure is None:
            unproven = (*unproven, *unsealed(self.seals.recoveries), *map(told, gaps))
        return LogReport(
            records=self.records,
            counts=self._counts,
            failure=self.failure,
            shortfall=shortfall,
            genesis=self.genesis,
            close=self.close,
            last_us=self._clocks.at_us,
            root=self._head.tree.root(),
            proven=proven,
            unproven=unproven,
            sealed=sealed,
            epochs=self.seals.epochs,
            gaps=gaps,
        )

    def _end(self) -> tuple[Finding | None, Finding | None]:
        """Failure and shortfall of a log that ends without a close."""
        number, torn, offset = self.records, self._torn, self.offset
        if torn is None and number:
            text = f"the log ends after {number} records, without its signed close"
            return None, Finding("close/missing", number, text, offset=offset)
        if not torn:
            text = "the log is empty: nothing was written, or everything was removed"
            return Finding("log/empty", number, text, offset=offset), None
        if not may_be_torn(torn, self._head.prev):
            start = '{"_prev":"' + self._head.prev
            text = "the data after the last complete record is not the beginning of another record"
            return Finding("record/malformed", number, text, shown(torn), start[:SHOWN], offset), None
        if not number:
            text = "the log ends inside its first record"
            return Finding("genesis/missing", number, text, shown(torn), offset=offset), None
        text = f"the log ends inside record {number}, after {len(torn)} of its bytes"
        return None, Finding("tail/torn", number, text, offset=offset)


def verify(lines: Iterable[bytes]) -> LogReport:
    """Verify the lines of a log, each with its newline, as iteration over a file opened in binary mode yields them."""
    verifier = LogVerifier()
    for line in lines:
        verifier.take(line)
        if verifier.failure is not None:
            break
    return verifier.report()
