"""The service `recover`: end the log of a flight that broke off, unless it was tampered with."""

from pathlib import Path

from rtshcua.adapters.store.recovery import LogEnder, Recovered, examine, recover
from rtshcua.adapters.store.vehicle_records import known_end
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.finding import Finding
from rtshcua.evidence.recovery import FoundLog, LogState

_CODES = {
    LogState.CLOSED: ExitCode.OK,
    LogState.WHOLE: ExitCode.INCOMPLETE,
    LogState.TORN: ExitCode.INCOMPLETE,
    LogState.UNBEGUN: ExitCode.EVIDENCE,
    LogState.TAMPERED: ExitCode.EVIDENCE,
    LogState.FOREIGN: ExitCode.UNTRUSTED,
}


def recover_log(path: Path, signer: LogEnder | None, state: Path) -> Recovered:
    """End a log; without a signer only examine it. The `state` folder has the ends of closed logs. Raises `InUse`,
    OSError.
    """
    cut = _cut(path, state)
    if cut is not None:
        return cut
    if signer is not None:
        return recover(path, signer)
    found = examine(path, None)
    return Recovered(found, False, None, found.head.prev)


def _cut(path: Path, state: Path) -> Recovered | None:
    """The result for a log that was closed with another last record, by this machine's state folder; else None."""
    end = known_end(state, path)
    if end is None:
        return None
    found = examine(path, None)
    if found.head.prev == end:
        return None
    text = "the log was closed before with another last record: its end was cut off or rewritten"
    reason = Finding("close/missing", found.records, text, found.head.prev, end, found.kept)
    return Recovered(found._replace(state=LogState.TAMPERED, reason=reason), False, None, found.head.prev)


def recovery_code(found: FoundLog) -> ExitCode:
    """The exit code for a log that was not ended."""
    slug = "" if found.reason is None else found.reason.slug
    if slug == "genesis/format":
        return ExitCode.UNTRUSTED
    if slug.startswith("anchor/"):
        return ExitCode.ANCHOR
    if found.state is LogState.UNBEGUN and slug.startswith("record/"):
        return ExitCode.INPUT  # a complete line, but not a record of this program
    return _CODES[found.state]
