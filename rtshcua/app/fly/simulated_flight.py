"""That a flight was simulated, or faster than life: as its log tells it, before anything is decided."""

from itertools import islice, takewhile
from pathlib import Path
from typing import Final

from rtshcua.adapters.store.logs import lines
from rtshcua.adapters.store.reading import open_regular
from rtshcua.evidence.finding import Claim
from rtshcua.evidence.reading import read
from rtshcua.evidence.records import Effect
from rtshcua.evidence.report import LogReport

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
    detail = None if report.failure is not None else simulated(log)
    if detail is None:
        return report
    claim = Claim("simulated", f"that anything flew: times are those of {detail}")
    return report._replace(unproven=(*report.unproven, claim))


def simulated(log: Path) -> str | None:
    """What the log says of it, among the effects that follow the genesis: the boundary's own statement comes first."""
    with open_regular(log) as file:
        effects = takewhile(lambda record: isinstance(record, Effect), map(read, islice(lines(file), 1, None)))
        return next((each.detail for each in effects if isinstance(each, Effect) and each.event == SIMULATED), None)
