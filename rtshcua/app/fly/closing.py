"""The stage that closes: the log signed and read back, the frames finished, and what the disk did not take named."""

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

#: the effect that says in the signed log how many frames its telemetry lacks; the close then has no digest of it
FRAMES_LOST = "frames-lost"


def close_log(
    recorder: Recorder, sink: EvidenceWriter, frames: TelemetryFile, now: Callable[[], Now], ending: Ending | None,
    note: Callable[[str], None], heard: Callable[[bytes], None],
) -> tuple[str, ...]:  # fmt: skip
    """Sign and close the log, and give what of the evidence is missing: nothing, if it is whole.

    Without an ending (a fault) the log stays unsigned. `note` tells a person, `heard` gets the lines of its end.
    """
    missing: list[str] = []
    tlog, lack = _finish(frames)
    if lack is not None:
        note(f"the frame log is not whole: {lack}")
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
                heard(line)
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
    """The digest of the frame log, if it holds every frame, else what it lacks and why."""
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
    """Write the summary; what comes back says so if that failed."""
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
    """Why the log is refused, in words, None where it verifies; and for how long it has nothing, in us."""

    refused: str | None
    gaps_us: int = 0


def read_back(log: Path) -> ReadBack:
    """What a verifier makes of a closed log: chain, order, seals and signatures. That the trust root names the key that
    signed it was found before the flight; what the boundary stated, and each decision, `verify-log --audit` holds
    against it.
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
