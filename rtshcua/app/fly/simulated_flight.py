"""The claims of a log that its flight was simulated, and at what speed, or its boundary emulated."""

from itertools import islice, takewhile
from pathlib import Path
from typing import Final

from rtshcua.adapters.boundary.optee import DEVELOPMENT
from rtshcua.adapters.store.logs import lines
from rtshcua.adapters.store.reading import open_regular
from rtshcua.evidence.finding import Claim
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import Effect, Genesis
from rtshcua.evidence.report import LogReport

#: modes in which the boundary's secure world is emulated
EMULATED: Final = ("trustzone-m", "optee")
#: the event of the effect
SIMULATED: Final = "simulated"


def pace_of(speed: float, *, own: bool) -> str | None:
    """The detail of the effect for a flight at `speed` times real time; None for a flight that is not known to be
    simulated. `own`: the run started the simulated vehicle itself.
    """
    if not own and speed == 1:
        return None
    pace = "as fast as life" if speed == 1 else f"{speed:g} times as fast as life"
    return f"a simulated vehicle, {pace}"


def with_simulated(report: LogReport, log: Path) -> LogReport:
    """Add to the report on a verified log that its flight was simulated, or its boundary emulated."""
    if report.failure is not None:
        return report
    claims, detail = [], simulated(log)
    if _mode(log) in EMULATED:
        claims.append(Claim("emulated", "that hardware kept the boundary out of reach: its secure world was emulated"))
    if _mode(log) == "optee":
        claims.append(Claim("development", f"that only its maker could change the boundary: {DEVELOPMENT}"))
    if detail is not None:
        claims.append(Claim("simulated", f"that anything flew: times are those of {detail}"))
    return report._replace(unproven=(*report.unproven, *claims))


def _mode(log: Path) -> str:
    """The enforcement mode in the genesis of a log."""
    with open_regular(log) as file:
        first = next(map(read, islice(lines(file), 1)), None)
        return first.mode if isinstance(first, Genesis) else ""


def simulated(log: Path) -> str | None:
    """The detail of the effect among the first effects of a log; None if there is none."""
    with open_regular(log) as file:
        effects = takewhile(lambda record: isinstance(record, Effect), map(read, islice(lines(file), 1, None)))
        return next((each.detail for each in effects if isinstance(each, Effect) and each.event == SIMULATED), None)
