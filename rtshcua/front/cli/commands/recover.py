"""`rtshcua recover`: end the log of a flight that broke off."""

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

_KEPT = "nothing was changed: every byte of it is where it was"
_HELPS = {
    LogState.TAMPERED: f"{_KEPT}; `rtshcua verify-log` says more",
    LogState.FOREIGN: f"{_KEPT}; `--log-key` takes the key that the flight was made with",
    LogState.UNBEGUN: f"{_KEPT}; the flight broke off before it began",
}


@app.command("recover")
def recover_logs(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="logs, folders of runs, or folders of these")],
    log_key: Annotated[Path | None, typer.Option(help="the key that signs logs (the key store's)")] = None,
    passphrase_file: Annotated[Path | None, typer.Option(help="a file with that key's passphrase")] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="say what would be kept and discarded; no key needed")]
    = False,
    state_dir: Annotated[Path | None, typer.Option(help="where it is kept which logs were closed (the data folder)")]
    = None,
    as_json: Annotated[bool, typer.Option("--json", help="one JSON object a log on the standard output")] = False,
) -> ExitCode:  # fmt: skip
    """End the log of a flight that broke off: keep what is whole, sign it, and close it as `recovered`.

    What a crash left behind the last whole record is moved to `log.discarded`. A log that was tampered with, that was
    closed before and has lost its end since, or of which a witness saw more (`*.anchors` beside it), is left as it
    is. It is safe to interrupt, and to repeat. With several logs the exit code is the first that is not 0.
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
        return fail(ExitCode.INPUT, str(busy), "a flight ends its log itself", slug="in-use")
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
            return f"this was no crash, and it is not signed: {where}"
        case LogState.FOREIGN:
            return "its flight was made with another log key"
        case _:
            none = "it is not a log of this program" if recovery_code(found) is ExitCode.INPUT else ""
            return f"{none or 'there is no first record to go on from'}: {where or 'it is empty'}"


def _told(path: Path, done: Recovered) -> list[str]:
    found = done.found
    if found.state is LogState.CLOSED:
        return [f"{path}: closed, {many(found.records, 'record')}; nothing to recover"]
    loose = found.records - found.sealed
    said = [f"{path}: {'recovered' if done.done else 'can be recovered'}, {many(found.records, 'record')} kept"]
    if loose:
        said.append(f"  the last {loose} were not sealed yet: nothing but the chain speaks for them before this")
    if found.reason is not None:
        where = "" if done.discarded is None else f" are in {done.discarded.name}"
        said.append(f"  {found.discarded} octets behind them{where}: {found.reason.text}")
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
