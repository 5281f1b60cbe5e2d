"""That a flight was simulated, or faster than life, or its boundary emulated: as its log tells it."""

from itertools import islice, takewhile
from pathlib import Path
from typing import Final

from rtshcua.adapters.store.logs import lines
from rtshcua.adapters.store.reading import open_regular
from rtshcua.evidence.finding import Claim
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import Effect, Genesis
from rtshcua.evidence.report import LogReport

#: modes in which the boundary's secure world is emulated
EMULATED: Final = ("trustzone-m",)
#: the event of the effect
SIMULATED: Final = "simulated"


def pace_of(speed: float, *, own: bool) -> str | None:
    """What a log says of a flight at `speed` seconds of flight in a second; None where it is a flight as any other.

    `own`: of the simulated vehicle that we start ourselves; another one may be simulated too, which we cannot know.
    """
    if not own and speed == 1:
        return None
    pace = "as fast as life" if speed == 1 else f"{speed:g} times as fast as life"
    return f"a simulated vehicle, {pace}"


def with_simulated(report: LogReport, log: Path) -> LogReport:
    """The report on a log whose beginning was verified, with what this says of its times."""
    if report.failure is not None:
        return report
    claims, detail = [], simulated(log)
    if _mode(log) in EMULATED:
        claims.append(Claim("emulated", "that hardware kept the boundary out of reach: its secure world was emulated"))
    if detail is not None:
        claims.append(Claim("simulated", f"that anything flew: times are those of {detail}"))
    return report._replace(unproven=(*report.unproven, *claims))


def _mode(log: Path) -> str:
    """Where decisions were made, as the genesis says it."""
    with open_regular(log) as file:
        first = next(map(read, islice(lines(file), 1)), None)
        return first.mode if isinstance(first, Genesis) else ""


def simulated(log: Path) -> str | None:
    """What the log says of it, among the effects that follow the genesis: the boundary's own statement comes first."""
    with open_regular(log) as file:
        effects = takewhile(lambda record: isinstance(record, Effect), map(read, islice(lines(file), 1, None)))
        return next((each.detail for each in effects if isinstance(each, Effect) and each.event == SIMULATED), None)
