"""`rtshcua recover`: close the log of an interrupted flight."""

import json
from pathlib import Path
from typing import Annotated

import typer

from rtshcua.adapters.store.folders import data_folder, state_folder
from rtshcua.adapters.store.keystore import KeyStore
from rtshcua.adapters.store.recovery import InUse, LogEnder, Recovered
from rtshcua.app.documents import no_log
from rtshcua.app.fly.previous_log import signer_of
from rtshcua.app.logs import is_log, logs_meant
from rtshcua.app.recover import recover_log, recovery_code
from rtshcua.app.wording import many
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.recovery import RECOVERABLE, FoundLog, LogState
from rtshcua.front.cli.faults import fail, of_each, tell
from rtshcua.front.cli.stdout import out, out_json
from rtshcua.front.cli.unlock import unlock
from rtshcua.wire.keys import Duty

app = typer.Typer(add_completion=False)

_KEPT = "the log was not changed"
_HELPS = {
    LogState.TAMPERED: f"{_KEPT}; run `rtshcua verify-log` for details",
    LogState.FOREIGN: f"{_KEPT}; name the log key of the flight with `--log-key`",
    LogState.UNBEGUN: f"{_KEPT}; the flight was interrupted before it began",
}


@app.command("recover")
def recover_logs(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="logs, run folders, or parents of these")],
    log_key: Annotated[Path | None, typer.Option(help="key that signs logs (default: the key store's)")] = None,
    passphrase_file: Annotated[Path | None, typer.Option(help="file with the passphrase of that key")] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="only print what would be kept (no key needed)")]
    = False,
    state_dir: Annotated[Path | None, typer.Option(help="folder that records closed logs (default: the data folder)")]
    = None,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object for each log")] = False,
) -> ExitCode:  # fmt: skip
    """Close the log of an interrupted flight: keep the complete records, sign them, and close the log as `recovered`.

    Data after the last complete record is moved to `log.discarded`. A log is left unchanged if it was tampered with, if
    it was closed before and has lost its end, or if a witness saw more of it (`*.anchors` in the same folder). The
    command can be interrupted and repeated safely. With several logs, the exit code is the first that is not 0.
    """
    signer = None
    if not dry_run:
        key = unlock(KeyStore(data_folder()), Duty.LOG, path=log_key, passphrase_file=passphrase_file)
        signer = signer_of(key)
    state = state_dir or state_folder()
    return of_each(logs_meant(logs), lambda path, _: _recover(path, signer, state, as_json=as_json))


def _recover(path: Path, signer: LogEnder | None, state: Path, *, as_json: bool) -> ExitCode:
    if not is_log(path):
        return fail(ExitCode.INPUT, *no_log(path, path, _KEPT))
    try:
        done = recover_log(path, signer, state)
    except InUse as busy:
        return fail(ExitCode.INPUT, str(busy), "a running flight closes its log itself", slug="in-use")
    code = ExitCode.OK if done.done else recovery_code(done.found)
    if as_json:
        out_json(json.dumps(_object(path, done, code), ensure_ascii=False), flush=True)
    elif done.done or done.found.state in (*RECOVERABLE, LogState.CLOSED):
        out(*_told(path, done), flush=True)
    if done.found.state in _HELPS:
        return tell(code, f"`{path}`: {_why(done.found)}", _HELPS[done.found.state])
    return code


def _why(found: FoundLog) -> str:
    reason = found.reason
    where = "" if reason is None else f"record {reason.record}, octet {reason.offset}: {reason.text}"
    match found.state:
        case LogState.TAMPERED:
            return f"the damage was not caused by a crash, so the log is not signed: {where}"
        case LogState.FOREIGN:
            return "its flight used a different log key"
        case _:
            none = "it is not a log of this program" if recovery_code(found) is ExitCode.INPUT else ""
            return f"{none or 'the first record is missing'}: {where or 'the file is empty'}"


def _told(path: Path, done: Recovered) -> list[str]:
    found = done.found
    if found.state is LogState.CLOSED:
        return [f"{path}: closed, {many(found.records, 'record')}; nothing to recover"]
    loose = found.records - found.sealed
    said = [f"{path}: {'recovered' if done.done else 'can be recovered'}, {many(found.records, 'record')} kept"]
    if loose:
        said.append(f"  the last {loose} were not sealed: until now only the hash chain covered them")
    if found.reason is not None:
        where = "" if done.discarded is None else f" are in {done.discarded.name}"
        said.append(f"  {found.discarded} bytes after them{where}: {found.reason.text}")
    return said


def _object(path: Path, done: Recovered, code: ExitCode) -> dict[str, object]:
    found = done.found
    return {
        "log": str(path),
        "state": found.state.value,
        "recovered": done.done,
        "exit_code": int(code),
        "records": found.records,
        "unsealed": found.records - found.sealed,
        "kept_bytes": found.kept,
        "discarded_bytes": found.discarded,
        "discarded_sha256": found.discarded_digest.hex(),
        "discarded": None if done.discarded is None else str(done.discarded),
        "reason": None if found.reason is None else found.reason._asdict(),
        "last": done.last,
    }
