"""The quick verification of a closed log: what was signed, held against the octets, and nothing that was not signed.

It finds the segments from the end, and hashes each apart from the others; so it can be done by many at a time. It reads
the signed records, and no other. It says yes or nothing: whenever anything is out of place, `rtshcua.evidence.verify`
reads the log line by line, and names what it is.
"""

from array import array
from collections.abc import Iterable
from typing import NamedTuple

from rtshcua.evidence.clocks import Clocks
from rtshcua.evidence.epochs import LONGEST_US
from rtshcua.evidence.finding import Claim, Flaw
from rtshcua.evidence.heads import START
from rtshcua.evidence.merkle import EMPTY, leaf_hash
from rtshcua.evidence.reading import LONGEST, read
from rtshcua.evidence.records import Close, Genesis, Recover, Seal, Signed
from rtshcua.evidence.report import Report, claims, unsealed, with_anchors
from rtshcua.evidence.seals import Seals, Segment
from rtshcua.evidence.segments import Octets, Part, Peaks, find, signed_line
from rtshcua.evidence.witnessing.anchors import Anchors

_FORM = (
    "the form and number of each record that is not signed itself, its clocks, that it stands where it may and its "
    "epoch was sealed in time, and that decisions follow from what they record: `--audit`"
)
_TREE = "that records are linked line by line and make up the signed tree: without `--fast`"


class Outline(NamedTuple):
    """Where the signed records of a log begin, the genesis first and the close last; and the genesis."""

    octets: Octets
    size: int
    offsets: "array[int]"
    genesis: Genesis


def outline(octets: Octets, size: int) -> Outline | None:
    """The outline of a log of so many octets; None where it has none that is worth believing."""
    line = signed_line(octets, 0, LONGEST)
    genesis = None if line is None else read(line)
    offsets = find(octets, size) if isinstance(genesis, Genesis) else None
    return None if offsets is None or not isinstance(genesis, Genesis) else Outline(octets, size, offsets, genesis)


def quick(log: Outline, parts: Iterable[Part | None], anchors: Anchors) -> Report | None:
    """The report on a log that is whole and closed, or None where the careful verification must find out.

    `parts` are those of its segments in their order. Where nobody looked at their leaves, the report says so.
    """
    walk = _Walk(log.genesis, anchors)
    if not walk.begin():
        return None
    for (start, offset), part in zip(zip(log.offsets, log.offsets[1:], strict=False), parts, strict=True):
        line = signed_line(log.octets, offset)
        record = None if line is None else read(line)
        if part is None or line is None or not isinstance(record, Seal | Recover | Close):
            return None
        if not walk.segment(part, offset - start, record):
            return None
        if isinstance(record, Close):
            return walk.close(record, line) if offset + len(line) == log.size else None
    return None


class _Walk:
    """From one signed record to the next. Each step says whether all is well."""

    def __init__(self, genesis: Genesis, anchors: Anchors) -> None:
        self._genesis = genesis
        self._anchors = anchors
        self._seals = Seals()
        self._clocks = Clocks()
        self._peaks = Peaks()
        self._seq = self._signed_us = self._recovers = 0
        self._link = START.encode()
        self._fast = False

    def begin(self) -> bool:
        genesis = self._genesis
        return (genesis.seq, genesis.prev) == (0, START) and self._signed(genesis, Segment(0, 0, "", EMPTY))

    def segment(self, part: Part, octets: int, record: Seal | Recover | Close) -> bool:
        """Take a segment, and the record that closes it."""
        leaves = part.leaves
        if leaves is None:
            self._fast = True
            segment = Segment(record.seq - self._seq, octets, part.digest, None)
            return segment.records > 0 and self._signed(record, segment)
        if leaves.number != self._peaks.size:
            return False
        linked = leaves.first == self._link and leaves.last == record.prev.encode()
        in_time = leaves.records == 1 or leaves.last_us - self._signed_us <= LONGEST_US
        in_order = leaves.last_us <= record.at_us or isinstance(record, Recover)
        for height, node in leaves.nodes:
            self._peaks.push(height, node)
        self._link = leaves.last
        segment = Segment(leaves.records, octets, part.digest, self._peaks.root())
        return (
            linked
            and in_time
            and in_order
            and record.seq == self._peaks.size
            and self._signed(record, segment)
            and not any(self._anchors.anchor(note) for note in leaves.anchors)
        )

    def _signed(self, record: Signed, segment: Segment) -> bool:
        if self._clocks.check(record) or self._seals.check(record, segment):
            return False
        self._seq, self._signed_us = record.seq, record.at_us
        self._recovers += isinstance(record, Recover)
        assert record.checkpoint is not None
        return self._anchors.checkpoint(record.checkpoint) is None

    def close(self, close: Close, line: bytes) -> Report | None:
        """The report, after the close."""
        records, epochs = close.seq + 1, self._seals.epochs
        anchored = self._anchors.finish(records)
        if isinstance(anchored, Flaw):
            return None
        proven, unproven = claims(records, records, epochs, self._genesis, close, None, self._seals.recoveries)
        form: tuple[Claim, ...] = (Claim("form", _FORM),)
        root = b""
        if self._fast:
            text = f"the octets of records 0 to {records - 2} are those that were signed, segment by segment"
            proven = (Claim("octets", text), *(claim for claim in proven if claim.slug != "chain"))
            form = (Claim("tree", _TREE), *form)
        else:
            text = f"lines 1 to {records} follow one another, each names the one before it, and their tree is as signed"
            proven = tuple(Claim("chain", text) if claim.slug == "chain" else claim for claim in proven)
            self._peaks.push(0, leaf_hash(line))
            root = self._peaks.root()
        counts = {"genesis": 1, "seal": epochs - self._recovers - 1, "recover": self._recovers, "close": 1}
        report = Report(
            records=records,
            counts={kind: count for kind, count in counts.items() if count},
            failure=None,
            shortfall=None,
            genesis=self._genesis,
            close=close,
            last_us=close.at_us,
            root=root,
            proven=proven,
            unproven=(*unproven, *unsealed(self._seals.recoveries), *form),
            sealed=records,
            epochs=epochs,
        )
        return with_anchors(report, anchored)
