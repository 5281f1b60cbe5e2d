"""`rtshcua verify-log`: prove what a log proves, and name the first record that fails."""

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.adapters.store.verification import Progress
from rtshcua.app import verify_log as service
from rtshcua.app.documents import no_log
from rtshcua.app.logs import NO_LOG_HELP, is_log, log_of, logs_and_others, report_code
from rtshcua.app.pin import Pin, trusted
from rtshcua.app.verify_log import VerifyRequest
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli.faults import fail, of_each, refuse, say
from rtshcua.front.cli.render.verdict import as_object, as_text
from rtshcua.front.cli.stdout import out_json

app = typer.Typer(add_completion=False)

_LONG = 32 << 20  # bytes of a log that is worth a progress bar


Logs = Annotated[list[Path], typer.Argument(metavar="LOG...", help="logs, folders of runs, or folders of these")]
Root = Annotated[
    str | None, typer.Option(metavar="FILE|KEY", help="the trust root or its key [default: your key store's]")
]
Audited = Annotated[bool, typer.Option("--audit", help="read every record, and derive every decision again")]
NotDerived = Annotated[bool, typer.Option("--no-derive", help="with --audit: read every record, but derive none")]
Fast = Annotated[bool, typer.Option("--fast", help="hold the octets against the signatures, and nothing more")]
Jobs = Annotated[
    int,
    typer.Option(
        min=0,
        metavar="N",
        show_default=False,
        help="processes that verify; 0, the default: one a core where the log is long. --audit has one always",
    ),
]
Anchors = Annotated[
    list[Path] | None, typer.Option("--anchors", metavar="FILE", help="what witnesses cosigned, besides `*.anchors`")
]
Revocations = Annotated[
    list[Path] | None,
    typer.Option("--revocations", metavar="FILE", help="a newer trust root: what it revokes counts (repeatable)"),
]
RequireAnchor = Annotated[
    bool, typer.Option("--require-anchor", help="a log that witnesses did not see to its end is incomplete")
]
Explained = Annotated[int | None, typer.Option(min=0, metavar="N", help="audit the log, and tell of record N in words")]
AsJson = Annotated[bool, typer.Option("--json", help="one JSON object a log on the standard output")]


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
    """Verify logs offline, from the log and one pinned key.

    As it is: what was signed by whom, the chain of all records, and their tree. With --audit also the form of each
    record, its clocks, and every decision once more; that is the slow way, and what an investigation wants. With
    several logs the exit code is the first that is not 0.

    Of a folder every log is verified that lies in it or below, also one that is not called log.jsonl. A .jsonl file
    there that is no log is named.
    """
    if (audit or explain is not None) and fast:
        return fail(ExitCode.USAGE, "`--fast` does not go with `--audit` or `--explain`", "--fast reads no record")
    if no_derive and not (audit or explain is not None):
        return fail(ExitCode.USAGE, "`--no-derive` goes with `--audit`", "without `--audit` nothing is derived")
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
        say(visible(f"note: `{other}` was not looked at: it is no log of this program"))
    return of_each(meant, lambda path, first: _verify(path, pinned, request, as_json=as_json, first=first))


def _verify(given: Path, pinned: Pin, request: VerifyRequest, *, as_json: bool, first: bool) -> ExitCode:
    path = log_of(given)
    if not is_log(path):
        return fail(ExitCode.INPUT, *no_log(path, given, NO_LOG_HELP))
    with _progress(path.stat().st_size) as told:
        found = service.verify_log(path, request, told)
    code = report_code(found.report)
    if as_json:
        out_json(json.dumps(as_object(found, path, pinned, code), ensure_ascii=False))
    else:
        as_text(found, path, pinned, first=first)
    return code


@contextmanager
def _progress(size: int) -> Iterator[Progress]:
    """What takes how far a log of so many octets is read: a bar on the terminal if it is long."""
    if size < _LONG or not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.console import Console
    from rich.progress import Progress as Bar

    with Bar(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("verifying", total=size)
        yield lambda done: bar.update(task, completed=done)
