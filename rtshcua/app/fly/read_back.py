"""A log read back at the end of its flight, so that none is called whole in which `verify-log` finds a part that is
missing, changed or not signed. What the boundary stated, and each decision, `verify-log --audit` holds against it.
"""

from pathlib import Path
from typing import NamedTuple

from rtshcua.adapters.store.logs import lines
from rtshcua.adapters.store.reading import open_regular
from rtshcua.adapters.store.runs import LOG
from rtshcua.evidence.verify import verify


class ReadBack(NamedTuple):
    """Why the log is refused, in words, None where it verifies; and for how long it has nothing, in us."""

    refused: str | None
    gaps_us: int = 0


def read_back(log: Path) -> ReadBack:
    """What a verifier makes of a closed log: chain, order, seals and signatures. That the trust root names the key that
    signed it was found before the flight, and the audit of its decisions is of the ground.
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
