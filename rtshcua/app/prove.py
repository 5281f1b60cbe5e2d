"""The service `prove`: one record of a log, or two states of it, in a small file that verifies alone."""

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
_TRIED = 16  # checkpoints with notes of witnesses, of which the log may be read for each
#: how a proof that cannot be made ends, by its slug; else as evidence that fails
PROOF_CODES: Final = {
    "proof/number": ExitCode.INPUT,
    "proof/unsealed": ExitCode.INCOMPLETE,
    "proof/too-long": ExitCode.INPUT,
    "proof/no-log": ExitCode.INPUT,
    "genesis/format": ExitCode.UNTRUSTED,
}
_WRONG = "`rtshcua verify-log` says what is wrong with the log"
_HELPS = dict.fromkeys(("proof/log", "proof/path", "proof/consistency"), _WRONG)
_HELPS |= {"proof/unsealed": "`rtshcua recover` ends a log that a crash left open"}


class ProofRequest(NamedTuple):
    """What is proven of a log: a record, or that nothing changed `since` a signed record; `at` which signed record, and
    as a COSE receipt where `sign` gives the log key for one.
    """

    log: Path
    record: int | None
    since: int | None = None
    at: int | None = None
    sign: Callable[[], SigningKey] | None = None
    output: Path | None = None


class WrittenProof(NamedTuple):
    """A proof that was written: where, how long it is, and whether witnesses vouch for it."""

    path: Path
    octets: int
    anchored: bool


def prove(request: ProofRequest) -> WrittenProof | Refusal:
    """Make a proof and write it. Raises `Untrusted` and OSError."""
    log, record, since, at = request.log, request.record, request.since, request.at
    log.stat()  # so that what is missing is told as such

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
    """Whether nothing stands there, or a proof: least of all the log is to be written over."""
    try:
        data = read_regular(path, MAX_PROOF)
    except FileNotFoundError:
        return True
    except NotRegular:
        return False
    return data.startswith(_BEGINNINGS) or (data.startswith(TAG_18) and _IN_RECEIPT in data)


def _refused(path: Path, flaw: Flaw) -> Refusal:
    """Why there is nothing to be proven."""
    if flaw.slug == "proof/no-log" and begins_as_log(path):
        return Refusal("genesis/missing", f"`{path}`: {CUT_AT_FIRST}")
    help = _HELPS.get(flaw.slug) or (f"accepted: {flaw.expected}" if flaw.expected else "")
    return Refusal(flaw.slug, f"`{path}`: {flaw.text}", help)


def _receipt(read: Lines, record: int, at: int | None, key: SigningKey) -> bytes | Flaw:
    return receipt_of(read, record, at, kid=key.kid, signer=lambda text: key.sign(text, duty=Duty.LOG))


def _nearest(read: Lines, record: int | None, since: int | None, notes: tuple[str, ...]) -> bytes | None:
    """The proof under the nearest checkpoint that enough witnesses cosigned; for two states of a log under the last."""
    sizes = sorted(cosigned_sizes(notes), reverse=record is None)
    for size in [size for size in sizes if size > (record if record is not None else since or 0)][:_TRIED]:
        made = prove_consistency(read, since or 0, size) if record is None else prove_inclusion(read, record, size)
        if not isinstance(made, Flaw) and is_anchored(found := with_cosignatures(made, notes)):
            return found
    return None
