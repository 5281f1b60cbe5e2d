"""`rtshcua verify-log`: prove what a log proves, and name the first record that fails."""

import gc
import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import file_digest
from pathlib import Path
from typing import Annotated, BinaryIO

import typer

from rtshcua.adapters.files.logs import lines
from rtshcua.adapters.files.runs import BUNDLE, LOG, SUMMARY, TELEMETRY
from rtshcua.cli.faults import distrust, fail
from rtshcua.cli.pin import Pin, pin
from rtshcua.cli.verdict import as_object, as_text
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.finding import Claim, Finding
from rtshcua.evidence.report import Report, Verdict
from rtshcua.ground.auditor.audit import Audit, Auditor
from rtshcua.wire.bundle import MAX_BUNDLE
from rtshcua.wire.untrusted import Untrusted

app = typer.Typer(add_completion=False)

_MARK = b'"format":"rtshcua/log"'
_HEAD = 1 << 26
_LONG = 32 << 20  # bytes of a log that is worth a progress bar


@app.command()
def verify_log(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="a log, or the folder of a run")],
    root: Annotated[
        str | None, typer.Option(metavar="FILE|KEY", help="the trust root or its key [default: your key store's]")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object a log on the standard output")] = False,
) -> ExitCode:
    """Verify logs offline: chain, signature, trust, and every decision once more.

    With several logs the exit code is the first that is not 0.
    """
    try:
        pinned = pin(root)
    except Untrusted as error:
        help = "`--root` takes the trust root of whoever flew, or its public key" if error.slug == "no-keys" else None
        return distrust(error, help, where="no root to trust: ")
    codes = [_verify(path, pinned, as_json=as_json, first=number == 0) for number, path in enumerate(logs)]
    return next((code for code in codes if code is not ExitCode.OK), ExitCode.OK)


def _verify(given: Path, pinned: Pin, *, as_json: bool, first: bool) -> ExitCode:
    path = given / LOG if given.is_dir() else given
    folder = path.parent if path.name == LOG else None
    with path.open("rb") as file:
        size = path.stat().st_size
        if size and _MARK not in file.readline(_HEAD):
            return fail(ExitCode.INPUT, f"`{given}` is not a log of this program", "`rtshcua show` says what it is")
        file.seek(0)
        audit = _audit(file, size, pinned, _beside(folder))
    if folder is not None:
        audit = audit._replace(
            report=_with_summary(_with_telemetry(audit.report, folder / TELEMETRY), folder / SUMMARY)
        )
    code = exit_code(audit.report)
    if as_json:
        print(json.dumps(as_object(audit, path, pinned, code), ensure_ascii=False))
    else:
        as_text(audit, path, pinned, first=first)
    return code


def exit_code(report: Report) -> ExitCode:
    """The exit code for a report."""
    if report.failure is None:
        return ExitCode.OK if report.verdict is Verdict.VERIFIED else ExitCode.INCOMPLETE
    trust = report.failure.slug.startswith("trust/") or report.failure.slug == "genesis/format"
    return ExitCode.UNTRUSTED if trust else ExitCode.EVIDENCE


def _beside(folder: Path | None) -> bytes | None:
    """The bundle in a run's folder: the log should be of it."""
    if folder is None or not (folder / BUNDLE).exists():
        return None
    with (folder / BUNDLE).open("rb") as file:
        return file.read(MAX_BUNDLE + 1)


def _audit(file: BinaryIO, size: int, pinned: Pin, bundle: bytes | None) -> Audit:
    auditor = Auditor(pinned.key, bundle=bundle)
    gc.disable()  # nothing here makes cycles, and looking for them costs a tenth
    try:
        with _progress(file, size) as source:
            for line in source:
                if not auditor.take(line):
                    break
    finally:
        gc.enable()
    return auditor.audit()


@contextmanager
def _progress(file: BinaryIO, size: int) -> Iterator[Iterator[bytes]]:
    """The lines of a file, with a bar on the terminal while a long one is read."""
    if size < _LONG or not sys.stderr.isatty():
        yield lines(file)
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("verifying", total=size)

        def counted() -> Iterator[bytes]:
            for number, line in enumerate(lines(file)):
                if not number & 0xFFF:
                    bar.update(task, completed=file.tell())
                yield line

        yield counted()


def _with_summary(report: Report, path: Path) -> Report:
    """The report, with what it says of the summary beside the log."""
    if report.failure is not None or not path.exists():
        return report
    claim = Claim("summary", f"`{path.name}`: nothing signs it, and it was not read; what counts stands in the log")
    return report._replace(unproven=(*report.unproven, claim))


def _with_telemetry(report: Report, path: Path) -> Report:
    """The report, with what it says of the raw frames whose digest the close signs."""
    close = report.close
    if close is None or report.failure is not None:
        return report
    if close.tlog is None:
        if not path.exists():
            return report
        claim = Claim("telemetry", f"the raw frames: the log does not vouch for `{path.name}`, which is not whole")
        return report._replace(unproven=(*report.unproven, claim))
    if not path.exists():
        claim = Claim("telemetry", f"the raw frames: `{path.name}` does not lie beside the log")
        return report._replace(unproven=(*report.unproven, claim))
    with path.open("rb") as file:
        found = file_digest(file, "sha256").hexdigest()
    if found == close.tlog:
        return report._replace(proven=(*report.proven, Claim("telemetry", f"`{path.name}` is the one that was signed")))
    text = f"`{path.name}` was changed: it is not the telemetry whose digest the close signs"
    return report._replace(failure=Finding("telemetry/changed", close.seq, text, found, close.tlog))
