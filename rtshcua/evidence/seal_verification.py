"""Checks the signed records of a log, one after another: their signers and what they cover (docs/log-format.md,
section 2).
"""

from typing import NamedTuple

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.heads import Head
from rtshcua.evidence.log_writer import origin_of
from rtshcua.evidence.merkle import leaf_hash
from rtshcua.evidence.note import Checkpoint, open_note, renamed
from rtshcua.evidence.records import Genesis, Recover, Sealing, Signed, encode, next_key_of, unsigned
from rtshcua.wire.keys import Duty, key_id


class Segment(NamedTuple):
    """The segment that a signed record closes, as counted: lines and octets from the previous signed record, their
    digest (SHA-256, hexadecimal), and the root of the tree over all lines before it; None if it was not computed.
    """

    records: int
    octets: int
    digest: str
    root: bytes | None


class Recoveries(NamedTuple):
    """How often a log was recovered, how many lines were unsigned at that time, and how many octets were discarded."""

    crashes: int = 0
    unsigned: int = 0
    discarded: int = 0


class Seals:
    """Processes the signed records of one log in order; the caller has checked each record and its place."""

    __slots__ = ("_log_key", "_next_key", "checkpoint", "epochs", "origin", "recoveries")

    def __init__(self) -> None:
        self.epochs = 0  # the number of sealed epochs
        self.origin = ""
        self.checkpoint: Checkpoint | None = None  # of the last signed record
        self.recoveries = Recoveries()
        self._log_key = self._next_key = b""

    def check(self, record: Signed, segment: Segment) -> Flaw | None:
        """The flaw of the next signed record, whose `seq` was checked, or None."""
        flaw = self._begin(record) if isinstance(record, Genesis) else self._check_segment(record, segment)
        opened = flaw or self._open(record, segment.root)
        if isinstance(opened, Flaw):
            return opened
        self.checkpoint = opened
        self._next_key = opened.key or b""
        if isinstance(record, Genesis):
            return None
        self.epochs += 1
        if isinstance(record, Recover):
            crashes, loose, discarded = self.recoveries
            self.recoveries = Recoveries(crashes + 1, loose + record.records - 1, discarded + record.discarded_bytes)
        return None

    def follow(self, record: Signed, line: bytes, head: Head) -> Flaw | None:
        """As `check`, for a record that follows the lines of the head; advances the head."""
        flaw = self.check(record, Segment(head.records, head.octets, head.digest(), head.tree.root()))
        if flaw is None:
            assert self.checkpoint is not None, "checked before"
            head.begin(line, self.checkpoint.digest())
        return flaw

    def _begin(self, genesis: Genesis) -> Flaw | None:
        self.origin = origin_of(genesis.vehicle, genesis.boot)
        self._log_key = bytes.fromhex(genesis.log_key)
        key = key_id(Duty.LOG, self._log_key).hex()
        if genesis.log_kid == key:
            return None
        return Flaw("genesis/log-key", "the log key is not the named one", genesis.log_kid, key)

    def _check_segment(self, record: Sealing, segment: Segment) -> Flaw | None:
        if record.epoch != self.epochs:
            text = "the record ends another epoch than the present one: an epoch was removed, added or moved"
            return Flaw("seal/epoch", text, str(record.epoch), str(self.epochs))
        if record.records != segment.records:
            text = "wrong number of records in the epoch"
            return Flaw("seal/records", text, str(record.records), str(segment.records))
        if record.bytes != segment.octets:
            text = "wrong number of octets in the epoch"
            return Flaw("seal/bytes", text, str(record.bytes), str(segment.octets))
        if record.digest != segment.digest:
            text = "the digest of the epoch does not match: at least one record was changed"
            return Flaw("seal/digest", text, segment.digest, record.digest)
        return None

    def _open(self, record: Signed, root: bytes | None) -> Checkpoint | Flaw:
        public = self._log_key if isinstance(record, Genesis | Recover) else self._next_key
        opened = open_note(record.checkpoint or "", self.origin, public)
        if isinstance(opened, Flaw):
            return renamed(opened, "seal")
        if opened.origin != self.origin:
            return Flaw("seal/note", "the signature is for another log", opened.origin, self.origin)
        if opened.size != record.seq:
            text = "the signature is for another number of records"
            return Flaw("seal/size", text, str(record.seq), str(opened.size))
        if root is not None and opened.root != root:
            text = "the signature does not match these records: at least one was changed, and the chain was rewritten"
            return Flaw("seal/root", text, root.hex(), opened.root.hex())
        own = leaf_hash(encode(unsigned(record)))
        if opened.record != own:
            text = "the record is not the signed one: a field was changed"
            return Flaw("seal/self", text, own.hex(), opened.record.hex())
        key = next_key_of(record)
        if opened.key != key:
            text = "the signature names another key for the next epoch than the record does"
            return Flaw("seal/next-key", text, _hex(key), _hex(opened.key))
        after = None if self.checkpoint is None else self.checkpoint.digest()
        if opened.after != after:
            text = "the signature does not follow that of the previous signed record"
            return Flaw("seal/after", text, _hex(after), _hex(opened.after))
        return opened


def _hex(key: bytes | None) -> str:
    return "none" if key is None else key.hex()
