"""A log read back at the end of its flight: what `verify-log` will say of it, so that nothing else is called whole."""

from pathlib import Path
from typing import NamedTuple

from rtshcua.adapters.files.runs import LOG
from rtshcua.wire import cose
from rtshcua.wire.trust import MAX_ROOT


class ReadBack(NamedTuple):
    """Why the log is refused, in words, None where it verifies; and for how long it has nothing, in us."""

    refused: str | None
    gaps_us: int = 0


def read_back(log: Path, root: bytes) -> ReadBack:
    """What a verifier makes of a closed log that was written under this signed trust root."""
    # not before the flight: no part of this is needed for flying, and it takes its time to load
    from rtshcua.adapters.files.verification import Asked, verify_quickly

    try:
        report = verify_quickly(log, Asked(cose.unverified(root, limit=MAX_ROOT).kid), jobs=1).report
    except OSError as error:
        return ReadBack(f"it cannot be read back: {(error.strerror or str(error)).lower()} ({LOG})")
    found = report.failure or report.shortfall
    if found is not None:
        return ReadBack(f"`verify-log` refuses it: {found.slug} at record {found.record} ({LOG})")
    return ReadBack(None, sum(gap.us for gap in report.gaps))
