"""The stage that closes: sign and read back the log, close the frame log, and list missing evidence."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import msgspec

from rtshcua.adapters.loop import append_all
from rtshcua.adapters.store.evidence_file import EvidenceWriter
from rtshcua.adapters.store.logs import lines
from rtshcua.adapters.store.reading import open_regular
from rtshcua.adapters.store.runs import LOG, SUMMARY, TELEMETRY, RunFolder
from rtshcua.adapters.store.telemetry import TelemetryFile
from rtshcua.app.fly.story import Summary
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.evidence.log_writer import Recorder
from rtshcua.evidence.verify import verify
from rtshcua.model.durability import SYNCED_FIRST, WRITTEN
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.ports import Ending

#: the event of the effect for missing telemetry frames; the close record then has no digest of the telemetry
FRAMES_LOST = "frames-lost"


def close_log(
    recorder: Recorder, sink: EvidenceWriter, frames: TelemetryFile, now: Callable[[], Now], ending: Ending | None,
    note: Callable[[str], None], publish: Callable[[bytes], None],
) -> tuple[str, ...]:  # fmt: skip
    """Sign and close the log; return descriptions of missing evidence.

    Without an ending (a fault) the log stays unsigned. `note` shows a text, `publish` receives the last lines.
    """
    missing: list[str] = []
    tlog, lack = _finish(frames)
    if lack is not None:
        note(f"the frame log is incomplete: {lack}")
        missing.append(f"{lack} ({TELEMETRY})")
        at = now()
        with suppress(OSError):
            append_all(sink, recorder.caught_up(at), SYNCED_FIRST)
        with suppress(OSError):
            sink.append(recorder.effect(at, FRAMES_LOST, detail=lack), WRITTEN)
    if ending is not None:
        lines = recorder.closing(now(), ending=ending, tlog=tlog)
        with suppress(OSError):
            append_all(sink, lines, SYNCED_FIRST)
            for line in lines:
                publish(line)
    trouble: OSError | None = None
    try:
        sink.close()
    except OSError as error:
        trouble = error
    if sink.waiting:
        hangs = f": {_reason(trouble)}" if isinstance(trouble, TimeoutError) else ""
        missing.append(f"{sink.waiting} of {recorder.count} records{hangs} ({LOG})")
    elif trouble is not None:
        missing.append(f"whatever the disk did not sync: {_reason(trouble)} ({LOG})")
    return tuple(missing)


def _finish(frames: TelemetryFile) -> tuple[bytes | None, str | None]:
    """The digest of the frame log if it is complete, else None and a description of what is missing."""
    try:
        digest = frames.finish()
    except OSError as error:
        return None, f"it cannot be read any more: {_reason(error)}"
    if frames.error is None and not frames.lost:
        return digest, None
    why = "the disk did not keep up" if frames.error is None else _reason(frames.error)
    if not frames.lost:
        return None, f"not all of it is on the disk: {why}"
    return None, f"{frames.lost} frame{'' if frames.lost == 1 else 's'} missing: {why}"


def keep_summary(run: RunFolder, summary: Summary) -> Summary:
    """Write the summary; return it, changed if the write failed."""
    try:
        run.write_summary(msgspec.structs.asdict(summary))
    except OSError as error:
        code = ExitCode.FULL if summary.exit_code == ExitCode.OK else summary.exit_code
        missing = (*summary.missing, f"the summary: {_reason(error)} ({SUMMARY})")
        return msgspec.structs.replace(summary, whole=False, missing=missing, exit_code=code)
    return summary


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()


class ReadBack(NamedTuple):
    """The reason why the log does not verify, or None; and the total time without records, in us."""

    refused: str | None
    gaps_us: int = 0


def read_back(log: Path) -> ReadBack:
    """Verify chain, order, seals and signatures of a closed log. The signing key was checked before the flight; the
    boundary's statements and the decisions are checked by `verify-log --audit`.
    """
    try:
        with open_regular(log) as file:
            report = verify(lines(file))
    except OSError as error:
        return ReadBack(f"it cannot be read back: {(error.strerror or str(error)).lower()} ({LOG})")
    found = report.failure or report.shortfall
    if found is not None:
        return ReadBack(f"`verify-log` refuses it: {found.slug} at record {found.record} ({LOG})")
    return ReadBack(None, sum(gap.us for gap in report.gaps))
