"""Cosignatures of witnesses, put below the checkpoint of a proof that was made."""

from collections.abc import Iterable, Iterator
from itertools import islice

from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.note import parse, split
from rtshcua.evidence.proofs.check import Proven, check_proof
from rtshcua.evidence.proofs.extra import Extra, read_extra
from rtshcua.evidence.proofs.file import ProofFile, read_proof
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import Effect
from rtshcua.evidence.witnessing.anchors import ANCHORED
from rtshcua.wire import cose

_EVENT = b',"event":"%s"' % ANCHORED.encode()
_MOST = 64  # lines that are tried


def with_cosignatures(data: bytes, anchors: Iterable[str]) -> bytes:
    """A proof that was made here, with the lines by which witnesses cosigned its checkpoint; others are left out."""
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
    """Whether enough witnesses cosigned the checkpoint of a proof that was made here."""
    file = read_proof(data)
    assert isinstance(file, ProofFile)
    found = check_proof(data, _own_pin(file))
    return isinstance(found, Proven) and found.believed.anchored


def cosigned_sizes(anchors: Iterable[str]) -> set[int]:
    """The sizes of the checkpoints that the anchors are of, whoever made them."""
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
    assert isinstance(extra, Extra)
    return cose.unverified(extra.root).kid
