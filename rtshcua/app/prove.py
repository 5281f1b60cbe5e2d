"""The service `prove`: write an inclusion or consistency proof of a log, which can be verified without the log."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final, NamedTuple

from rtshcua.adapters.store.logs import begins_as_log, lines, read_anchors
from rtshcua.adapters.store.reading import NotRegular, open_regular, read_regular
from rtshcua.adapters.store.writing import replace_inside
from rtshcua.app.logs import CUT_AT_FIRST
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.proofs.cose_receipt import TAG_18
from rtshcua.evidence.proofs.file import MAX_PROOF, ProofKind
from rtshcua.evidence.proofs.make import (
    Lines,
    anchored,
    cosigned_sizes,
    is_anchored,
    prove_consistency,
    prove_inclusion,
    receipt_of,
    with_cosignatures,
)
from rtshcua.wire.keys import Duty, SigningKey

_BEGINNINGS = tuple(f"{kind}\n".encode() for kind in ProofKind)
_IN_RECEIPT = b"rtshcua/record"
_TRIED = 16  # most cosigned checkpoints to try, since each may take a pass over the log
#: exit codes of refusals by slug; any other refusal exits as failed evidence
PROOF_CODES: Final = {
    "proof/number": ExitCode.INPUT,
    "proof/unsealed": ExitCode.INCOMPLETE,
    "proof/too-long": ExitCode.INPUT,
    "proof/no-log": ExitCode.INPUT,
    "genesis/format": ExitCode.UNTRUSTED,
}
_VERIFY = "run `rtshcua verify-log` to see what is wrong with the log"
_HELPS = dict.fromkeys(("proof/log", "proof/path", "proof/consistency"), _VERIFY)
_HELPS |= {"proof/unsealed": "run `rtshcua recover` to close a log that a crash left open"}


class ProofRequest(NamedTuple):
    """Which proof of a log to make: inclusion of `record`, or consistency `since` a signed record.

    The proof is for the checkpoint `at` a signed record (None: the newest). If `sign` returns the log key, the proof is
    a COSE receipt.
    """

    log: Path
    record: int | None
    since: int | None = None
    at: int | None = None
    sign: Callable[[], SigningKey] | None = None
    output: Path | None = None


class WrittenProof(NamedTuple):
    """A written proof: its path, its size, and whether enough witnesses cosigned its checkpoint."""

    path: Path
    octets: int
    anchored: bool


def prove(request: ProofRequest) -> WrittenProof | Refusal:
    """Make a proof and write it. Raises `Untrusted` and OSError."""
    log, record, since, at = request.log, request.record, request.since, request.at
    log.stat()  # raises FileNotFoundError for a missing log

    def read() -> Iterator[bytes]:
        with open_regular(log) as file:
            yield from lines(file)

    made: bytes | Flaw
    if record is None:
        assert since is not None
        made, name = prove_consistency(read, since, at), f"since-{since}.consistency-proof"
    elif request.sign is not None:
        made, name = _receipt(read, record, at, request.sign()), f"record-{record}.cose"
    else:
        made, name = prove_inclusion(read, record, at), f"record-{record}.tlog-proof"
    if isinstance(made, Flaw):
        return _refused(log, made)
    if request.sign is None:
        notes = (*read_anchors(log), *anchored(read()))
        made = with_cosignatures(made, notes)
        if at is None and not is_anchored(made):
            made = _nearest(read, record, since, notes) or made
    target = request.output or Path(name)
    replace_inside(target, made)
    return WrittenProof(target, len(made), request.sign is not None or is_anchored(made))


def replaceable(path: Path) -> bool:
    """Whether the path is free or holds a proof. Any other file, above all the log, must not be overwritten."""
    try:
        data = read_regular(path, MAX_PROOF)
    except FileNotFoundError:
        return True
    except NotRegular:
        return False
    return data.startswith(_BEGINNINGS) or (data.startswith(TAG_18) and _IN_RECEIPT in data)


def _refused(path: Path, flaw: Flaw) -> Refusal:
    """The refusal for a proof that cannot be made."""
    if flaw.slug == "proof/no-log" and begins_as_log(path):
        return Refusal("genesis/missing", f"`{path}`: {CUT_AT_FIRST}")
    help = _HELPS.get(flaw.slug) or (f"accepted: {flaw.expected}" if flaw.expected else "")
    return Refusal(flaw.slug, f"`{path}`: {flaw.text}", help)


def _receipt(read: Lines, record: int, at: int | None, key: SigningKey) -> bytes | Flaw:
    return receipt_of(read, record, at, kid=key.kid, signer=lambda text: key.sign(text, duty=Duty.LOG))


def _nearest(read: Lines, record: int | None, since: int | None, notes: tuple[str, ...]) -> bytes | None:
    """Return the proof for the nearest later checkpoint that enough witnesses cosigned, or None.

    A consistency proof takes the last such checkpoint.
    """
    sizes = sorted(cosigned_sizes(notes), reverse=record is None)
    for size in [size for size in sizes if size > (record if record is not None else since or 0)][:_TRIED]:
        made = prove_consistency(read, since or 0, size) if record is None else prove_inclusion(read, record, size)
        if not isinstance(made, Flaw) and is_anchored(found := with_cosignatures(made, notes)):
            return found
    return None
