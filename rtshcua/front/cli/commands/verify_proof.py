"""`rtshcua verify-proof`: what a file of `rtshcua prove` proves, from the file and a pinned root key alone."""

import json
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.adapters.store.reading import read_regular
from rtshcua.app.pin import Pin, pin
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.kinds import PROOF, recognised
from rtshcua.evidence.finding import Flaw
from rtshcua.evidence.note import parse, split
from rtshcua.evidence.proofs.check import Proven, check_proof
from rtshcua.evidence.proofs.cose_receipt import TAG_18, check_receipt
from rtshcua.evidence.proofs.file import MAX_PROOF
from rtshcua.front.cli.faults import distrust, of_each
from rtshcua.front.cli.render.proof_told import Told, as_object, as_text
from rtshcua.front.cli.stdout import out_json
from rtshcua.wire.untrusted import Untrusted

app = typer.Typer(add_completion=False)

_PROOFS = "`rtshcua prove` makes one"
_MAX_NOTE = 1 << 16  # bytes of a file with a checkpoint
_INPUT = {"proof/malformed", "proof/extra", "proof/too-long"}


@app.command()
def verify_proof(
    proofs: Annotated[list[Path], typer.Argument(metavar="PROOF...", help="files of `rtshcua prove`")],
    root: Annotated[
        str | None, typer.Option(metavar="FILE|KEY", help="the trust root or its key [default: your key store's]")
    ] = None,
    checkpoint: Annotated[
        Path | None, typer.Option(help="a checkpoint of the log that you kept: it must be the one in the proof")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object a proof on the standard output")] = False,
) -> ExitCode:
    """Verify proofs offline: the record, its path, the signatures up to the root key that you trust.

    With several proofs the exit code is the first that is not 0.
    """
    try:
        pinned = pin(root)
    except Untrusted as error:
        help = "`--root` takes the trust root of whoever flew, or its public key" if error.slug == "no-keys" else ""
        return distrust(error, help, where="no root to trust: ")
    kept = None
    if checkpoint is not None:
        kept = read_regular(checkpoint, _MAX_NOTE).decode("utf-8", "replace")
    return of_each(proofs, lambda path, first: _verify(path, pinned, kept, as_json=as_json, first=first))


def _verify(path: Path, pinned: Pin, kept: str | None, *, as_json: bool, first: bool) -> ExitCode:
    data = read_regular(path, MAX_PROOF)
    result: Told = check_receipt(data, pinned.key) if data[:1] == TAG_18 else check_proof(data, pinned.key)
    if kept is not None and not isinstance(result, Flaw):
        result = _same(result, kept) or result
    kind = recognised(data, path.name)
    if isinstance(result, Flaw) and result.slug == "proof/malformed" and kind is not None and kind is not PROOF:
        result = result._replace(text=f"it is {kind.name}, and no proof: {kind.help or _PROOFS}")
    code = exit_code(result)
    if as_json:
        out_json(json.dumps(as_object(result, path, pinned, code), ensure_ascii=False))
    else:
        as_text(result, path, pinned, kept=kept is not None, first=first)
    return code


def exit_code(result: Told) -> ExitCode:
    """The exit code for what came of a verification."""
    if not isinstance(result, Flaw):
        return ExitCode.OK
    if result.slug in _INPUT:
        return ExitCode.INPUT
    if result.slug.startswith("trust/"):
        return ExitCode.UNTRUSTED
    return ExitCode.ANCHOR if result.slug.startswith("anchor/") else ExitCode.EVIDENCE


def _same(result: Told, kept: str) -> Flaw | None:
    """What is wrong when the checkpoint that somebody kept should be one of the proof's."""
    text, _ = split(kept)
    head = parse(text)
    if isinstance(head, Flaw):
        return Flaw("proof/malformed", f"the checkpoint that was kept is none: {head.text}")
    heads = (result.checkpoint, result.older) if isinstance(result, Proven) else ()
    if head in heads:
        return None
    for mine in heads:
        if mine is not None and (mine.origin, mine.size) == (head.origin, head.size):
            words = f"at {head.size} records the log that you kept the checkpoint of was another one"
            return Flaw("anchor/root", words, mine.root.hex(), head.root.hex())
    words = "the proof says nothing about the checkpoint that you kept"
    return Flaw("proof/checkpoint", words, expected=f"{head.origin} at {head.size} records")
