"""Witnesses by file: a log, or a folder where logs are put, is looked at and cosigned; anchors go beside each log."""

from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

from rtshcua.adapters.files.anchors import add_anchors, beside, read_notes
from rtshcua.adapters.files.logs import lines
from rtshcua.adapters.files.witness import FileWitness
from rtshcua.adapters.store.reading import open_regular
from rtshcua.evidence.finding import Finding, Flaw
from rtshcua.evidence.note import split
from rtshcua.evidence.witnessing.cosign import cosignatures
from rtshcua.evidence.witnessing.submission import anchor
from rtshcua.evidence.witnessing.survey import request_of, survey
from rtshcua.evidence.witnessing.witness import CONFLICT, INCONSISTENT, Declined

_LOGS: Final = "*.jsonl"


class Cosigned(NamedTuple):
    """A log of so many records, of which this witness has cosigned `anchored`; `fresh`: more than before."""

    log: Path
    records: int
    anchored: int
    fresh: bool


class NotCosigned(NamedTuple):
    """A log that is not cosigned, and why. `contradiction`: it contradicts what was cosigned before; `proof`: where the
    note is kept that shows it, if it is one that the log's own key signed.
    """

    log: Path
    slug: str
    text: str
    contradiction: bool
    proof: Path | None = None


def logs_in(path: Path) -> list[Path]:
    """The logs in a folder and those below it, whatever can be read of them; a file is one itself."""
    return sorted(log for log in path.rglob(_LOGS) if not log.is_dir()) if path.is_dir() else [path]


def drop(log: Path, witness: FileWitness, root: Path | None = None) -> Cosigned | NotCosigned:
    """Cosign the end of a log, and put the anchor beside it; below `root`, the folder that logs are put into, no link
    is followed. Raises WitnessError and OSError.
    """
    found = survey(_lines(log, root))
    if isinstance(found, Finding):
        return NotCosigned(log, found.slug, f"record {found.record}: {found.text}", contradiction=False)
    known = witness.known(found.origin)
    request = request_of(found, known, lambda: _lines(log, root))
    if isinstance(request, Flaw):
        return NotCosigned(log, request.slug, request.text, contradiction=True)
    answer = witness.consider(request)
    if isinstance(answer, Declined):
        proof = witness.store.contradicted(request.note) if answer.contradiction else None
        # all of the log is here, and the proof was made here of its lines: it is the log that does not go on from there
        unlike = answer.status in (CONFLICT, INCONSISTENT) and known is not None
        contradiction = answer.contradiction or unlike
        return NotCosigned(log, f"witness/{answer.status}", answer.text, contradiction, proof)
    note = anchor(request.note, answer.body, (witness.public,))
    assert note is not None, "a witness knows its own cosignature"
    fresh = known is None or known < found.size
    if fresh or not _beside(log, split(note)[0], witness.public):
        add_anchors(beside(log), [note], root)
    return Cosigned(log, found.records, found.size + 1, fresh)


def _beside(log: Path, text: str, public: bytes) -> bool:
    """Whether the anchor of this text by this witness is beside the log."""
    mine = (cosignatures(each, (public,)) for each in read_notes(beside(log)) if each.startswith(text))
    return any(not isinstance(found, Flaw) and found[1] for found in mine)


def _lines(log: Path, root: Path | None) -> Iterator[bytes]:
    with open_regular(log, root) as file:
        yield from lines(file)
