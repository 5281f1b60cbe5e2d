"""`rtshcua prove`: one record of a log, or two states of it, in a small file that verifies alone."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.adapters.store.folders import data_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.adapters.store.logs import begins_as_log, lines, read_anchors
from rtshcua.adapters.store.reading import NotRegular, open_regular, read_regular
from rtshcua.adapters.store.runs import LOG
from rtshcua.adapters.store.writing import replace_inside
from rtshcua.diagnostics.exits import ExitCode
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
from rtshcua.front.cli.faults import distrust, fail
from rtshcua.front.cli.outcome import CUT_AT_FIRST
from rtshcua.front.cli.stdout import out, out_json
from rtshcua.front.cli.unlock import unlock
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.untrusted import Untrusted

app = typer.Typer(add_completion=False)

_BEGINNINGS = tuple(f"{kind}\n".encode() for kind in ProofKind)
_IN_RECEIPT = b"rtshcua/record"
_TRIED = 16  # checkpoints with notes of witnesses, of which the log may be read for each
_UNANCHORED = "  not anchored: too few witnesses cosigned the checkpoint that vouches for it; `--at` takes another"
_CODES = {
    "proof/number": ExitCode.INPUT,
    "proof/unsealed": ExitCode.INCOMPLETE,
    "proof/too-long": ExitCode.INPUT,
    "proof/no-log": ExitCode.INPUT,
    "genesis/format": ExitCode.UNTRUSTED,
}
_HELPS = {
    "proof/log": "`rtshcua verify-log` says what is wrong with the log",
    "proof/path": "`rtshcua verify-log` says what is wrong with the log",
    "proof/consistency": "`rtshcua verify-log` says what is wrong with the log",
    "proof/unsealed": "`rtshcua recover` ends a log that a crash left open",
}


@app.command()
def prove(
    log: Annotated[Path, typer.Argument(help="a log, or the folder of a run")],
    record: Annotated[int | None, typer.Argument(min=0, help="the number of the record, from 0")] = None,
    since: Annotated[int | None, typer.Option(metavar="SIGNED", min=0, help="prove instead that nothing changed since"
        " this signed record")] = None,
    at: Annotated[int | None, typer.Option(metavar="SIGNED", min=0, help="the signed record that vouches for it"
        " [default: the first after RECORD; with --since, the last]")] = None,
    cose: Annotated[bool, typer.Option("--cose", help="a COSE receipt (RFC 9942), signed by the log key now")] = False,
    log_key: Annotated[Path | None, typer.Option(help="the log key, for --cose [default: the key store's]")] = None,
    passphrase_file: Annotated[Path | None, typer.Option(help="a file with the key's passphrase")] = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="the file [default: record-N.tlog-proof]")]
    = None,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object on the standard output")] = False,
) -> ExitCode:  # fmt: skip
    """Prove one record of a log to someone who has nothing but the file and your root key.

    The file holds the record, its path to the root of the log's Merkle tree, and the signatures from that root up to
    the trust root. `rtshcua verify-proof` verifies it. Whatever else the log holds stays where it is.
    """
    if (record is None) == (since is None):
        two = f"record {record} and `--since {since}` are two things to prove, in two files"
        text = "say what is to be proven" if record is None else two
        return fail(ExitCode.USAGE, text, "the number of a record, or `--since`")
    if cose and record is None:
        return fail(ExitCode.USAGE, "these options do not go together", "`--cose` proves a record")
    if output is not None and not _replaceable(output):
        return fail(ExitCode.USAGE, f"`{output}` is no proof, and is not replaced by one", "another name, for `-o`")
    path = log / LOG if log.is_dir() else log
    path.stat()  # so that what is missing is told as such

    def read() -> Iterator[bytes]:
        with open_regular(path) as file:
            yield from lines(file)

    try:
        if record is None:
            assert since is not None
            made, name = prove_consistency(read, since, at), f"since-{since}.consistency-proof"
        elif cose:
            key = unlock(KeyStore(data_folder()), Duty.LOG, path=log_key, passphrase_file=passphrase_file)
            made, name = _receipt(read, record, at, key), f"record-{record}.cose"
        else:
            made, name = prove_inclusion(read, record, at), f"record-{record}.tlog-proof"
    except Untrusted as error:
        return distrust(error)
    if isinstance(made, Flaw):
        return _refused(path, made)
    if not cose:
        notes = (*read_anchors(path), *anchored(read()))
        made = with_cosignatures(made, notes)
        if at is None and not is_anchored(made):
            made = _nearest(read, record, since, notes) or made
    target = output or Path(name)
    replace_inside(target, made)
    if as_json:
        out_json(json.dumps({"proof": str(target), "log": str(path), "octets": len(made), "exit_code": 0}))
    else:
        what = f"record {record}" if record is not None else f"that nothing before record {since} was changed since"
        out(f"wrote `{target}`: {what}, proven in {len(made)} bytes")
        if not cose and not is_anchored(made):
            out(_UNANCHORED)
    return ExitCode.OK


def _refused(path: Path, flaw: Flaw) -> ExitCode:
    """How it ends where there is nothing to be proven."""
    if flaw.slug == "proof/no-log" and begins_as_log(path):
        return fail(ExitCode.EVIDENCE, f"`{path}`: {CUT_AT_FIRST}", slug="genesis/missing")
    help = _HELPS.get(flaw.slug) or (f"accepted: {flaw.expected}" if flaw.expected else None)
    return fail(_CODES.get(flaw.slug, ExitCode.EVIDENCE), f"`{path}`: {flaw.text}", help, slug=flaw.slug)


def _replaceable(path: Path) -> bool:
    """Whether nothing stands there, or a proof: least of all the log is to be written over."""
    try:
        data = read_regular(path, MAX_PROOF)
    except FileNotFoundError:
        return True
    except NotRegular:
        return False
    return data.startswith(_BEGINNINGS) or (data.startswith(TAG_18) and _IN_RECEIPT in data)


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
