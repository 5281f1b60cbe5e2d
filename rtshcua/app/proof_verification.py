"""The service `verify-proof`: verify a proof with a pinned root key and a kept checkpoint."""

from pathlib import Path
from typing import TypeAlias

from rtshcua.adapters.store.reading import read_regular
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.kinds import PROOF, recognised
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.note import parse, split
from rtshcua.evidence.proofs.check import Proven, check_proof
from rtshcua.evidence.proofs.cose_receipt import TAG_18, ReceiptClaim, check_receipt
from rtshcua.evidence.proofs.file import MAX_PROOF

#: the contents of a verified proof, or why it is refused
ProofResult: TypeAlias = Proven | ReceiptClaim | Flaw

_PROOFS = "make one with `rtshcua prove`"
_MAX_NOTE = 1 << 16  # limit of a checkpoint file, bytes
_INPUT = {"proof/malformed", "proof/extra", "proof/too-long"}


def read_checkpoint(path: Path | None) -> str | None:
    """Return the text of the kept checkpoint; None if there is none. Raises OSError."""
    return None if path is None else read_regular(path, _MAX_NOTE).decode("utf-8", "replace")


def verify_proof(path: Path, key: bytes, kept: str | None) -> ProofResult:
    """Verify a proof with a pinned key; it must match the `kept` checkpoint, if any. Raises OSError."""
    data = read_regular(path, MAX_PROOF)
    result: ProofResult = check_receipt(data, key) if data[:1] == TAG_18 else check_proof(data, key)
    if kept is not None and not isinstance(result, Flaw):
        result = _same(result, kept) or result
    kind = recognised(data, path.name)
    if isinstance(result, Flaw) and result.slug == "proof/malformed" and kind is not None and kind is not PROOF:
        result = result._replace(text=f"the file is {kind.name}, not a proof: {kind.help or _PROOFS}")
    return result


def exit_code(result: ProofResult) -> ExitCode:
    """Return the exit code of a verification result."""
    if not isinstance(result, Flaw):
        return ExitCode.OK
    if result.slug in _INPUT:
        return ExitCode.INPUT
    if result.slug.startswith("trust/"):
        return ExitCode.UNTRUSTED
    return ExitCode.ANCHOR if result.slug.startswith("anchor/") else ExitCode.EVIDENCE


def _same(result: ProofResult, kept: str) -> Flaw | None:
    """Return the flaw if the kept checkpoint does not match a checkpoint of the proof; None if it matches."""
    text, _ = split(kept)
    head = parse(text)
    if isinstance(head, Flaw):
        return Flaw("proof/malformed", f"the kept checkpoint is malformed: {head.text}")
    heads = (result.checkpoint, result.older) if isinstance(result, Proven) else ()
    if head in heads:
        return None
    for mine in heads:
        if mine is not None and (mine.origin, mine.size) == (head.origin, head.size):
            words = f"the kept checkpoint has a different tree root at {head.size} records"
            return Flaw("anchor/root", words, mine.root.hex(), head.root.hex())
    words = "the proof does not contain the kept checkpoint"
    return Flaw("proof/checkpoint", words, expected=f"{head.origin} at {head.size} records")
