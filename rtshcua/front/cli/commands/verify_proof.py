"""`rtshcua verify-proof`: verify a proof with only its file and a pinned root key."""

import json
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.app import proof_verification as service
from rtshcua.app.pin import Pin, trusted
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import of_each, refuse
from rtshcua.front.cli.render.proof_told import as_object, as_text
from rtshcua.front.cli.stdout import out_json

app = typer.Typer(add_completion=False)


@app.command()
def verify_proof(
    proofs: Annotated[list[Path], typer.Argument(metavar="PROOF...", help="proofs made by `rtshcua prove`")],
    root: Annotated[
        str | None, typer.Option(metavar="FILE|KEY", help="trust root or its public key [default: the key store's]")
    ] = None,
    checkpoint: Annotated[
        Path | None, typer.Option(help="a checkpoint of the log that you kept, which the proof must match")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object for each proof")] = False,
) -> ExitCode:
    """Verify proofs offline: the record, its Merkle path, and the signatures up to the pinned root key.

    With several proofs, the exit code is the first that is not 0.
    """
    pinned = trusted(root)
    if isinstance(pinned, Refusal):
        return refuse(pinned)
    kept = service.read_checkpoint(checkpoint)
    return of_each(proofs, lambda path, first: _verify(path, pinned, kept, as_json=as_json, first=first))


def _verify(path: Path, pinned: Pin, kept: str | None, *, as_json: bool, first: bool) -> ExitCode:
    result = service.verify_proof(path, pinned.key, kept)
    code = service.exit_code(result)
    if as_json:
        out_json(json.dumps(as_object(result, path, pinned, code), ensure_ascii=False))
    else:
        as_text(result, path, pinned, kept=kept is not None, first=first)
    return code
