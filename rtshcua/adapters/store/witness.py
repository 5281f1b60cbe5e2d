"""A witness: its state, the requests that it considers, and the log files that it cosigns.

It stores the last checkpoint that it cosigned of each log. One process at a time. A checkpoint is on the disk before
its cosignature leaves, so after a crash the witness may have forgotten that it answered, but never what it cosigned.
Deleting the folder deletes this memory: a witness is not on board, so that nobody else can do that.
"""

import os
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path
from typing import Final, NamedTuple

import msgspec

from rtshcua.adapters.store.logs import add_anchors, anchors_path, lines, read_notes
from rtshcua.adapters.store.reading import open_regular, read_if_there, walk
from rtshcua.adapters.store.writing import PRIVATE_FILE, PRIVATE_FOLDER, lock, make_folder, replace, write_new
from rtshcua.evidence.finding import Finding, Flaw
from rtshcua.evidence.note import parse, split
from rtshcua.evidence.witnessing.cosign import cosign, cosignatures
from rtshcua.evidence.witnessing.submission import anchor, request_of, survey
from rtshcua.evidence.witnessing.witness import (  # fmt: skip
    CONFLICT,
    INCONSISTENT,
    OK,
    CosignRequest,
    Declined,
    LastCosigned,
    LogKeys,
    WitnessResponse,
    judge,
)
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.untrusted import Untrusted

#: how many contradicting notes are kept as proof
MOST_CONTRADICTIONS: Final = 100
_FOLDER: Final = "contradictions"
_LARGEST: Final = 1 << 20  # octets of a checkpoint that is kept


class WitnessError(Untrusted):
    """The state of a witness cannot be used: `in-use`, `damaged`. It does not cosign then."""


class _Kept(msgspec.Struct, forbid_unknown_fields=True):
    """One file: the cosigned text, its signer, and the time of the cosignature (seconds since the Unix epoch)."""

    text: str
    signer: str
    time_s: int


class WitnessStore:
    """The state of one witness key. One process holds it at a time, until it is closed or dies."""

    def __init__(self, state: Path, key: SigningKey) -> None:
        """Raises WitnessError (`in-use`), and OSError."""
        self.folder = state / "witness" / key.kid.hex()
        make_folder(self.folder, mode=PRIVATE_FOLDER)
        try:
            self._lock = lock(self.folder / "lock")
        except BlockingIOError:
            raise WitnessError("in-use", f"another process cosigns with key {key.kid.hex()}") from None

    def seen(self, origin: str) -> tuple[LastCosigned, int] | None:
        """The last cosigned checkpoint of a log, and its time. Raises WitnessError (`damaged`), and OSError."""
        path = self._path(origin)
        data = read_if_there(path, _LARGEST)
        if data is None:
            return None
        try:
            kept = msgspec.json.decode(data, type=_Kept)
            signer = bytes.fromhex(kept.signer)
        except (msgspec.DecodeError, ValueError):
            kept, signer = _Kept("", "", 0), b""
        checkpoint = parse(kept.text)
        if isinstance(checkpoint, Flaw) or checkpoint.origin != origin or len(signer) != 32:
            raise WitnessError("damaged", f"`{path}` is damaged: what was cosigned of `{origin}` is unknown")
        return LastCosigned(kept.text, signer), kept.time_s

    def keep(self, origin: str, seen: LastCosigned, time_s: int) -> None:
        """Store a checkpoint. Raises OSError; then the earlier one is still stored, or this one."""
        kept = _Kept(seen.text, seen.signer.hex(), time_s)
        replace(self._path(origin), msgspec.json.encode(kept) + b"\n", mode=PRIVATE_FILE)

    def contradicted(self, note: str) -> Path | None:
        """Store a note that contradicts a cosigned checkpoint; return its file. Raises OSError."""
        folder = self.folder / _FOLDER
        make_folder(folder, mode=PRIVATE_FOLDER)
        path = folder / f"{sha256(note.encode()).hexdigest()[:32]}.note"
        if not path.exists():
            if sum(1 for _ in folder.iterdir()) >= MOST_CONTRADICTIONS:
                return None
            write_new(path, note.encode(), mode=PRIVATE_FILE)
        return path

    def close(self) -> None:
        """Release the state for another process."""
        os.close(self._lock)

    def _path(self, origin: str) -> Path:
        return self.folder / f"{sha256(origin.encode()).hexdigest()}.seen"


class FileWitness:
    """A witness: considers requests, stores checkpoints, cosigns. `now_s` is UTC in seconds; for `log_keys` see
    `evidence.witnessing.witness`.
    """

    def __init__(self, store: WitnessStore, key: SigningKey, log_keys: LogKeys, now_s: Callable[[], int]) -> None:
        self.store = store
        self._key = key
        self._log_keys = log_keys
        self._now_s = now_s

    @property
    def public(self) -> bytes:
        """The witness's public key."""
        return self._key.public

    def known(self, origin: str) -> int | None:
        """The size of the last cosigned tree of a log; None for an unknown log. Raises as `seen`."""
        before = self.store.seen(origin)
        return None if before is None else int(before[0].text.split("\n", 2)[1])

    def consider(self, request: CosignRequest) -> WitnessResponse | Declined:
        """The cosignature, once its checkpoint is stored; or why there is none. Raises WitnessError and OSError."""
        origin = request.note.partition("\n")[0]
        before = self.store.seen(origin)
        found = judge(request, None if before is None else before[0], self._log_keys)
        if isinstance(found, Declined):
            return found
        time_s = max(self._now_s(), 0 if before is None else before[1])
        self.store.keep(origin, found, time_s)
        return WitnessResponse(OK, cosign(found.text, time_s, self._key.public, self._sign))

    def _sign(self, message: bytes) -> bytes:
        return self._key.sign(message, duty=Duty.WITNESS)


# ------------------------------------------------------------------------------------ log files


class Cosigned(NamedTuple):
    """A log with so many records, `anchored` of them cosigned by this witness; `fresh`: more than before."""

    log: Path
    records: int
    anchored: int
    fresh: bool


class NotCosigned(NamedTuple):
    """A log that is not cosigned, and why. `contradiction`: it contradicts an earlier cosignature; `proof`: the file of
    the note that shows it, if the log's own key signed it.
    """

    log: Path
    slug: str
    text: str
    contradiction: bool
    proof: Path | None = None


def logs_in(path: Path) -> list[Path]:
    """The logs in a folder and below it, as far as it can be read; a file stands for itself."""
    if not path.is_dir():
        return [path]
    return sorted(Path(place, name) for place, _, files in walk(path) for name in files if name.endswith(".jsonl"))


def drop(log: Path, witness: FileWitness, root: Path | None = None) -> Cosigned | NotCosigned:
    """Cosign the end of a log file, and put the anchor beside it. Below `root`, the folder for logs, no link is
    followed. Raises WitnessError and OSError.
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
        # the whole log is here, and the proof was made here from its lines: so the log does not continue the cosigned
        # one
        unlike = answer.status in (CONFLICT, INCONSISTENT) and known is not None
        contradiction = answer.contradiction or unlike
        return NotCosigned(log, f"witness/{answer.status}", answer.text, contradiction, proof)
    note = anchor(request.note, answer.body, (witness.public,))
    assert note is not None, "a witness checks its own cosignature"
    fresh = known is None or known < found.size
    if fresh or not _beside(log, split(note)[0], witness.public):
        add_anchors(anchors_path(log), [note], root)
    return Cosigned(log, found.records, found.size + 1, fresh)


def _beside(log: Path, text: str, public: bytes) -> bool:
    """Whether this witness's anchor of this text is beside the log."""
    mine = (cosignatures(each, (public,)) for each in read_notes(anchors_path(log)) if each.startswith(text))
    return any(not isinstance(found, Flaw) and found[1] for found in mine)


def _lines(log: Path, root: Path | None) -> Iterator[bytes]:
    with open_regular(log, root) as file:
        yield from lines(file)
