"""Makes proofs from a log, in bounded memory: one pass for the signed records, and one for the hashes.

The result is verified like a reader's, except for the pin, so that no proof is made of an invalid log.
Cosignatures of witnesses can be appended below the checkpoint of a proof.
"""

from base64 import b64decode
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from typing import NamedTuple

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.merkle import leaf_hash
from rtshcua.evidence.merkle_proofs import Range, consistency_ranges, inclusion_ranges, proof_of
from rtshcua.evidence.note import parse, split
from rtshcua.evidence.proofs.check import Proven, check_proof
from rtshcua.evidence.proofs.cose_receipt import check_receipt, make_receipt
from rtshcua.evidence.proofs.file import ProofFile, ProofKind, ProofMaterial, read_extra, read_proof
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import (
    Close,
    DecisionRecord,
    Effect,
    Genesis,
    Recover,
    Signed,
    encode,
    is_signed,
    unsigned,
)
from rtshcua.evidence.witnessing.anchors import ANCHORED
from rtshcua.wire import cose
from rtshcua.wire.cbor import CborError
from rtshcua.wire.untrusted import Untrusted

#: returns the lines of the log from its beginning, on each call
Lines = Callable[[], Iterable[bytes]]

_EVENT = b',"event":"%s"' % ANCHORED.encode()
_MOST = 64  # lines that are tried as cosignatures


class ProofParts(NamedTuple):
    """The parts of a proof: the trust root, the notes signed by the log key and then by epoch keys, up to the note of
    `signed`, and the requested line if it is before that record.
    """

    root: bytes
    chain: tuple[str, ...]
    signed: Signed
    line: bytes


def find(
    lines: Iterable[bytes], number: int | None, at: int | None, *, since: int | None = None, closed: bool = False
) -> ProofParts | Flaw:
    """The parts of a proof of record `number`, or of growth since the signed record `since`.

    The signed record is `at`; by default the first one after `number`, or the last one (`closed`, `since`).
    """
    if at is not None and number is not None and at < number:
        return Flaw("proof/number", f"record {at} was signed before record {number} was written", str(at), f"{number}")
    finder = _Finder(number, at, since, to_end=closed or (since is not None and at is None))
    count = 0
    for count, line in enumerate(_whole(lines), 1):
        flaw = finder.take(count - 1, line)
        if flaw is not None:
            return flaw
        if finder.done:
            break
    return finder.found(count)


class _Finder:
    def __init__(self, number: int | None, at: int | None, since: int | None, *, to_end: bool) -> None:
        self.done = False
        self._number, self._at, self._since, self._to_end = number, at, since, to_end
        self._root = b""
        self._notes: list[str] = []
        self._sizes: set[int] = set()
        self._signed: Signed | None = None
        self._line = b""

    def take(self, seq: int, line: bytes) -> Flaw | None:
        if seq == self._number:
            self._line = line
        if not is_signed(line) and seq:
            return None
        record = read(line)
        if isinstance(record, Flaw):
            if record.slug == "genesis/format":
                return record
            text = f"record {seq} of the log is invalid: {record.text}"
            return Flaw("proof/log" if seq else "proof/no-log", text, record.found, record.expected)
        if (
            isinstance(record, DecisionRecord | Effect)
            or isinstance(record, Genesis) != (seq == 0)
            or record.seq != seq
        ):
            return Flaw("proof/log", f"record {seq} of the log is in the wrong place", record.type)
        if isinstance(record, Genesis):
            try:
                self._root = b64decode(record.root, validate=True)
            except ValueError:
                return Flaw("proof/log", "the trust root in the genesis is not base64")
        if isinstance(record, Genesis | Recover) and (self._since is None or self._since >= seq):
            self._notes.clear()  # signed by the log key itself: no earlier notes are needed
        self._notes.append(record.checkpoint or "")
        self._sizes.add(seq)
        self._signed = record
        self.done = isinstance(record, Close) or (not self._to_end and self._serves(seq))
        return None

    def _serves(self, seq: int) -> bool:
        if self._at is not None:
            return seq >= self._at
        return self._number is None or seq > self._number

    def found(self, count: int) -> ProofParts | Flaw:
        number, signed = self._number, self._signed
        if signed is None:
            return Flaw("proof/no-log", "the log contains no complete record")
        if number is not None and not self._line:
            text = f"the log has no record {number}"
            return Flaw("proof/number", text, str(number), f"0 to {count - 1}")
        for asked in (self._at, self._since):
            if asked is not None and asked not in self._sizes:
                return Flaw(
                    "proof/number", f"record {asked} is not a signed record: expected a genesis, a seal or a close"
                )
        least = number if number is not None else self._since
        assert least is not None
        if signed.seq < least:
            return Flaw("proof/unsealed", f"no signed record follows record {least} yet, so nothing vouches for it")
        return ProofParts(self._root, tuple(self._notes), signed, self._line)


def _whole(lines: Iterable[bytes]) -> Iterator[bytes]:
    """The lines without the incomplete last one that a crash may have left."""
    for line in lines:
        if not line.endswith(b"\n"):
            return
        yield line


def prove_inclusion(lines: Lines, number: int, at: int | None = None) -> bytes | Flaw:
    """The proof that record `number` is in the log, under the signed record `at`, by default the first one after it.

    The close has no signed record after it and is proven by its own signature, as is any signed record whose
    number is `at`.
    """
    found = find(lines(), number, at)
    if isinstance(found, Flaw):
        return found
    signed = found.signed
    if signed.seq == number:
        return _made(ProofKind.RECORD, found, number, [])
    path = _path(inclusion_ranges(number, signed.seq), leaves(lines))
    return path if isinstance(path, Flaw) else _made(ProofKind.INCLUSION, found, number, path, record=found.line)


def receipt_of(
    lines: Lines, number: int, at: int | None, *, kid: bytes, signer: Callable[[bytes], bytes]
) -> bytes | Flaw:
    """The COSE receipt (`cose_receipt`) of record `number`, under the same signed record as its inclusion proof,
    which is verified first. `signer` signs by the log key, whose name in the trust root is `kid`.
    """
    found = find(lines(), number, at)
    if isinstance(found, Flaw):
        return found
    size = found.signed.seq
    if size < 2 or size == number:
        text = f"a tree of {size} records has no receipt for record {number}"
        return Flaw("proof/number", text, str(number), "use an earlier record, or a later signed one with `--at`")
    path = _path(inclusion_ranges(number, size), leaves(lines))
    if isinstance(path, Flaw):
        return path
    checked = _made(ProofKind.INCLUSION, found, number, path, record=found.line)
    if isinstance(checked, Flaw):
        return checked
    origin = found.chain[-1].partition("\n")[0]
    data = make_receipt(found.line, number, size, path, origin=origin, root=found.root, kid=kid, signer=signer)
    received = check_receipt(data, cose.unverified(found.root).kid)
    return received if isinstance(received, Flaw) else data


def prove_consistency(lines: Lines, old: int, at: int | None = None) -> bytes | Flaw:
    """The proof that the log at the signed record `at`, by default the last one, begins with the log at the signed
    record `old`.
    """
    found = find(lines(), None, at, since=old)
    if isinstance(found, Flaw):
        return found
    size = found.signed.seq
    if size <= old:
        return Flaw("proof/number", f"the log has no signed record after record {old}", str(size))
    path = _path(consistency_ranges(old, size), leaves(lines))
    return path if isinstance(path, Flaw) else _made(ProofKind.CONSISTENCY, found, old, path)


def _made(kind: ProofKind, found: ProofParts, number: int, path: list[bytes], record: bytes = b"") -> bytes | Flaw:
    signed = encode(unsigned(found.signed))
    *chain, note = found.chain
    try:
        extra = ProofMaterial(tuple(chain), found.root, signed, record).encode()
        pinned = cose.unverified(found.root).kid
    except (CborError, Untrusted) as error:
        return Flaw("proof/log", f"no proof can be made of this log: {error}")
    data = ProofFile(kind, extra, number, tuple(path), note).encode()
    checked = check_proof(data, pinned)
    return checked if isinstance(checked, Flaw) else data


def _path(ranges: Sequence[Range], hashes: Iterable[bytes]) -> list[bytes] | Flaw:
    try:
        return proof_of(ranges, hashes)
    except (ValueError, RecursionError):
        return Flaw("proof/log", "the log contains an invalid line, or was truncated while it was read")


def leaves(lines: Lines) -> Iterator[bytes]:
    """The leaf hashes of a log."""
    return map(leaf_hash, lines())


def with_cosignatures(data: bytes, anchors: Iterable[str]) -> bytes:
    """A proof made by this module, with the lines in which witnesses cosigned its checkpoint; other lines are
    dropped.
    """
    file = read_proof(data)
    assert isinstance(file, ProofFile)
    text, own = split(file.note)
    found = (line for anchor in anchors if anchor.startswith(text) for line in split(anchor)[1] if line not in own)
    for line in islice(found, _MOST):
        more = file._replace(note=file.note + line)
        if isinstance(check_proof(more.encode(), _own_pin(more)), Proven):
            file = more
    return file.encode()


def is_anchored(data: bytes) -> bool:
    """Whether enough witnesses cosigned the checkpoint of a proof made by this module."""
    file = read_proof(data)
    assert isinstance(file, ProofFile)
    found = check_proof(data, _own_pin(file))
    return isinstance(found, Proven) and found.believed.anchored


def cosigned_sizes(anchors: Iterable[str]) -> set[int]:
    """The sizes of the checkpoints in these anchors, unverified."""
    found = (parse(split(anchor)[0]) for anchor in anchors)
    return {checkpoint.size for checkpoint in found if not isinstance(checkpoint, Flaw)}


def anchored(lines: Iterable[bytes]) -> Iterator[str]:
    """The anchors in the records of a log."""
    for line in lines:
        if _EVENT in line:
            record = read(line)
            if isinstance(record, Effect) and record.event == ANCHORED:
                yield record.detail


def _own_pin(file: ProofFile) -> bytes:
    extra = read_extra(file.extra)
    assert isinstance(extra, ProofMaterial)
    return cose.unverified(extra.root).kid
