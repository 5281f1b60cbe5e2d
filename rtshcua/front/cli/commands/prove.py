"""`rtshcua prove`: write a small, self-contained proof of one record of a log, or of its consistency."""

import json
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.adapters.store.runs import LOG
from rtshcua.app import prove as service
from rtshcua.app.prove import PROOF_CODES, ProofRequest, replaceable
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import distrust, fail, refuse
from rtshcua.front.cli.stdout import out, out_json
from rtshcua.front.cli.unlock import unlock
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.untrusted import Untrusted

app = typer.Typer(add_completion=False)

_UNANCHORED = "  not anchored: too few witnesses cosigned the checkpoint that covers it; choose another with `--at`"


@app.command()
def prove(
    log: Annotated[Path, typer.Argument(help="a log, or a run folder")],
    record: Annotated[int | None, typer.Argument(min=0, help="number of the record, from 0")] = None,
    since: Annotated[int | None, typer.Option(metavar="SIGNED", min=0, help="prove instead that the log up to this"
        " signed record has not changed")] = None,
    at: Annotated[int | None, typer.Option(metavar="SIGNED", min=0, help="the signed record that covers it"
        " [default: the first after RECORD; with --since, the last]")] = None,
    cose: Annotated[bool, typer.Option("--cose", help="a COSE receipt (RFC 9942), signed with the log key")] = False,
    log_key: Annotated[Path | None, typer.Option(help="log key for --cose [default: the key store's]")] = None,
    passphrase_file: Annotated[Path | None, typer.Option(help="file with the passphrase of the key")] = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="file to write [default: record-N.tlog-proof]")]
    = None,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object on standard output")] = False,
) -> ExitCode:  # fmt: skip
    """Write a proof of one record of a log, for someone who has only this file and your root key.

    The file contains the record, its path to the root of the log's Merkle tree, and the signatures from there to the
    trust root. `rtshcua verify-proof` verifies it. It discloses no other record.
    """
    if (record is None) == (since is None):
        two = f"record {record} and `--since {since}` require separate proofs"
        text = "nothing to prove" if record is None else two
        return fail(ExitCode.USAGE, text, "name either a record or `--since`")
    if cose and record is None:
        return fail(ExitCode.USAGE, "`--cose` and `--since` cannot be combined", "`--cose` proves a record")
    if output is not None and not replaceable(output):
        return fail(ExitCode.USAGE, f"`{output}` exists and is not a proof", "choose another file with `-o`")
    path = log / LOG if log.is_dir() else log

    def sign() -> SigningKey:
        return unlock(KeyStore(data_folder()), Duty.LOG, path=log_key, passphrase_file=passphrase_file)

    try:
        made = service.prove(ProofRequest(path, record, since, at, sign if cose else None, output))
    except Untrusted as error:
        return distrust(error)
    if isinstance(made, Refusal):
        return refuse(made, PROOF_CODES.get(made.slug, ExitCode.EVIDENCE))
    if as_json:
        out_json(json.dumps({"proof": str(made.path), "log": str(path), "octets": made.octets, "exit_code": 0}))
        return ExitCode.OK
    what = f"record {record}" if record is not None else f"the records before record {since} have not changed"
    out(f"wrote `{made.path}`: {what}; {made.octets} bytes")
    if not made.anchored:
        out(_UNANCHORED)
    return ExitCode.OK
