"""`rtshcua verify-log`: verify logs, and name the first record that fails."""

import json
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.app import verify_log as service
from rtshcua.app.documents import no_log
from rtshcua.app.logs import NO_LOG_HELP, is_log, log_of, logs_and_others, report_code
from rtshcua.app.pin import Pin, trusted
from rtshcua.app.verify_log import VerifyRequest
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import fail, of_each, refuse, say
from rtshcua.front.cli.render.progress import octets_of
from rtshcua.front.cli.render.verdict import as_object, as_text
from rtshcua.front.cli.stdout import out_json

app = typer.Typer(add_completion=False)

Logs = Annotated[list[Path], typer.Argument(metavar="LOG...", help="logs, run folders, or parents of these")]
Root = Annotated[
    str | None, typer.Option(metavar="FILE|KEY", help="trust root or its public key [default: the key store's]")
]
Audited = Annotated[bool, typer.Option("--audit", help="also check every record and recompute every decision")]
NotDerived = Annotated[
    bool, typer.Option("--no-derive", help="with --audit: check every record, recompute no decision")
]
Fast = Annotated[bool, typer.Option("--fast", help="check only the bytes against the signatures")]
Jobs = Annotated[
    int,
    typer.Option(
        min=0,
        metavar="N",
        show_default=False,
        help="number of processes; 0 (default): one for each core if the log is long; --audit uses one",
    ),
]
Anchors = Annotated[
    list[Path] | None,
    typer.Option("--anchors", metavar="FILE", help="anchors of witnesses, in addition to `*.anchors`"),
]
Revocations = Annotated[
    list[Path] | None,
    typer.Option("--revocations", metavar="FILE", help="newer trust root whose revocations apply (repeatable)"),
]
RequireAnchor = Annotated[
    bool, typer.Option("--require-anchor", help="treat a log as incomplete unless witnesses cosigned its end")
]
Explained = Annotated[int | None, typer.Option(min=0, metavar="N", help="audit the log and describe record N")]
AsJson = Annotated[bool, typer.Option("--json", help="print one JSON object for each log")]


@app.command()
def verify_log(
    logs: Logs,
    root: Root = None,
    audit: Audited = False,
    no_derive: NotDerived = False,
    fast: Fast = False,
    jobs: Jobs = 0,
    anchors: Anchors = None,
    revocations: Revocations = None,
    require_anchor: RequireAnchor = False,
    explain: Explained = None,
    as_json: AsJson = False,
) -> ExitCode:
    """Verify logs offline, with only the log and one pinned key.

    By default: the signatures, the hash chain of all records, and their Merkle tree. With --audit also the form of each
    record, its clocks, and every decision, recomputed; this is slower and meant for investigations. With several logs,
    the exit code is the first that is not 0.

    In a folder, all logs in it and below are verified, whatever their names. Other .jsonl files there are listed.
    """
    if (audit or explain is not None) and fast:
        return fail(
            ExitCode.USAGE, "`--fast` cannot be combined with `--audit` or `--explain`", "`--fast` reads no records"
        )
    if no_derive and not (audit or explain is not None):
        return fail(ExitCode.USAGE, "`--no-derive` requires `--audit`", "without `--audit` no decision is recomputed")
    pinned = trusted(root, revocations or ())
    if isinstance(pinned, Refusal):
        return refuse(pinned)
    named = tuple(anchors or ())
    deep = audit or explain is not None
    request = VerifyRequest(pinned.key, pinned.roots, named, deep, not no_derive, fast, jobs, require_anchor)
    if explain is not None:
        from rtshcua.front.cli.render.explaining import explained

        return explained(logs, explain, request, as_json=as_json)
    meant, others = logs_and_others(logs)
    for other in others:
        say(visible(f"note: skipped `{other}`: not a log of this program"))
    return of_each(meant, lambda path, first: _verify(path, pinned, request, as_json=as_json, first=first))


def _verify(given: Path, pinned: Pin, request: VerifyRequest, *, as_json: bool, first: bool) -> ExitCode:
    path = log_of(given)
    if not is_log(path):
        return fail(ExitCode.INPUT, *no_log(path, given, NO_LOG_HELP))
    with octets_of("verifying", path.stat().st_size) as told:
        found = service.verify_log(path, request, told)
    code = report_code(found.report)
    if as_json:
        out_json(json.dumps(as_object(found, path, pinned, code), ensure_ascii=False))
    else:
        as_text(found, path, pinned, first=first)
    return code
