"""Checks a proof with its file and one pinned root key only (docs/proofs.md). Any octets give an answer.

The steps, as the comments number them:

1. the file and its contents, each in its canonical form
2. the checkpoint: signed in the chain from the log key that the trust root names (`trust`)
3. the record that carries the checkpoint: it is the one that the checkpoint names
4. the claim: the path from the record, or between two checkpoints, leads to the signed root
"""

from typing import NamedTuple

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.merkle import leaf_hash
from rtshcua.evidence.merkle_proofs import verify_consistency, verify_inclusion
from rtshcua.evidence.note import Checkpoint
from rtshcua.evidence.proofs.file import ProofFile, ProofKind, ProofMaterial, read_extra, read_proof
from rtshcua.evidence.proofs.trust import Believed, believe
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import AnyRecord, Close, DecisionRecord, Effect, Genesis, Recover, Signed


class Proven(NamedTuple):
    """The content of a valid proof. `checkpoint` is the signed head of the log, `signed` the record that carries it;
    `older` the earlier head (consistency), `record` the record that is included (inclusion, record).
    """

    kind: ProofKind
    number: int
    believed: Believed
    checkpoint: Checkpoint
    signed: Signed
    older: Checkpoint | None = None
    record: AnyRecord | None = None


def check_proof(data: bytes, pinned: bytes) -> Proven | Flaw:
    """What the file proves under the pinned root key (32 bytes) or its name (16), or the flaw."""
    # 1 the file
    file = read_proof(data)
    if isinstance(file, Flaw):
        return file
    extra = read_extra(file.extra)
    if isinstance(extra, Flaw):
        return extra
    if bool(extra.record) != (file.kind is ProofKind.INCLUSION):
        return Flaw("proof/extra", "the proof contains other parts than its kind requires")
    signed = _record(extra.signed)
    record = _record(extra.record) if extra.record else None
    if isinstance(signed, Flaw):
        return signed
    if isinstance(record, Flaw):
        return record
    # 2 the checkpoint
    now_us = signed.utc_us if record is None else record.utc_us
    believed = believe((*extra.chain, file.note), extra.root, pinned, now_us)
    if isinstance(believed, Flaw):
        return believed
    # 3 its record
    checkpoint = believed.checkpoints[-1]
    flaw = _check_signed(signed, extra.signed, believed)
    if flaw is not None:
        return flaw
    assert not isinstance(signed, DecisionRecord | Effect)
    proven = Proven(file.kind, file.number, believed, checkpoint, signed, record=record)
    # 4 the claim
    return _CHECKS[file.kind](proven, file, extra)


def _record(line: bytes) -> AnyRecord | Flaw:
    record = read(line) if line.endswith(b"\n") else Flaw("", "the record is not a line")
    return (
        Flaw("proof/record", f"the proof contains an invalid record: {record.text}")
        if isinstance(record, Flaw)
        else record
    )


def _check_signed(signed: AnyRecord, line: bytes, believed: Believed) -> Flaw | None:
    checkpoint = believed.checkpoints[-1]
    if isinstance(signed, DecisionRecord | Effect) or signed.checkpoint is not None:
        return Flaw("proof/signed", "the record that should carry the checkpoint is of a kind without one")
    if leaf_hash(line) != checkpoint.record:
        text = "the record that carries the checkpoint is not the signed one"
        return Flaw("proof/signed", text, leaf_hash(line).hex(), checkpoint.record.hex())
    key = None if isinstance(signed, Close) else bytes.fromhex(signed.next_key)
    certified = isinstance(signed, Genesis | Recover)
    if signed.seq != checkpoint.size or key != checkpoint.key or certified != believed.certified:
        return Flaw("proof/signed", "the checkpoint and the record that carries it contradict each other")
    return None


def _inclusion(proven: Proven, file: ProofFile, extra: ProofMaterial) -> Proven | Flaw:
    record, checkpoint = proven.record, proven.checkpoint
    assert record is not None
    if record.seq != file.number:
        text = "the record is not the one at the given place"
        return Flaw("proof/record", text, str(record.seq), str(file.number))
    if not verify_inclusion(leaf_hash(extra.record), file.number, checkpoint.size, file.path, checkpoint.root):
        return Flaw("proof/path", f"this is not record {file.number} of the signed log")
    return proven


def _consistency(proven: Proven, file: ProofFile, _: ProofMaterial) -> Proven | Flaw:
    older = next((head for head in proven.believed.checkpoints[:-1] if head.size == file.number), None)
    if older is None:
        return Flaw("proof/chain", f"the proof contains no earlier checkpoint of {file.number} records")
    newer = proven.checkpoint
    if not verify_consistency(older.size, older.root, newer.size, newer.root, file.path):
        text = f"the log of {newer.size} records does not begin with the {older.size} records signed before"
        return Flaw("proof/consistency", text)
    return proven._replace(older=older)


def _own(proven: Proven, file: ProofFile, _: ProofMaterial) -> Proven | Flaw:
    if file.path or file.number != proven.checkpoint.size:
        return Flaw("proof/record", "the record is not the one at the given place")
    return proven._replace(record=proven.signed)


_CHECKS = {
    ProofKind.INCLUSION: _inclusion,
    ProofKind.CONSISTENCY: _consistency,
    ProofKind.RECORD: _own,
}
