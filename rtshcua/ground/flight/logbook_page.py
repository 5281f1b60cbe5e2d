"""Renders several flights as a logbook: an index page with totals and a sortable table that links each report."""

from collections.abc import Sequence
from typing import Final, NamedTuple

from markupsafe import Markup

from rtshcua.ground.drawing.html import rendered
from rtshcua.ground.flight.flight_content import FlightReport
from rtshcua.ground.flight.flight_page import PACKAGE, content_policy, script

_VERDICTS: Final = ("verified", "incomplete", "failed")


class LogbookEntry(NamedTuple):
    """A flight of a logbook: its page, relative to the index, and its report."""

    link: str
    flight: FlightReport


class UnreadLog(NamedTuple):
    """A log of which no page could be made: its name, and why."""

    name: str
    why: str


class LogbookTotals(NamedTuple):
    """The totals of a logbook: times in us, distances in mm over ground, of the flights with telemetry. A flight whose
    log failed counts in `flights` and `verdicts` alone.
    """

    flights: int
    lasted_us: int
    distance: int
    verdicts: tuple[tuple[str, int], ...]
    completed: int

    @property
    def failed(self) -> int:
        """How many logs failed."""
        return dict(self.verdicts)["failed"]


def totals(flights: Sequence[FlightReport]) -> LogbookTotals:
    """The totals of some flights."""
    believed = [each for each in flights if each.verdict != "failed"]
    return LogbookTotals(
        len(flights),
        sum(each.lasted_us for each in believed),
        sum(each.distance or 0 for each in believed),
        tuple((name, sum(each.verdict == name for each in flights)) for name in _VERDICTS),
        sum(each.ending == "completed" for each in believed),
    )


def logbook_page(entries: Sequence[LogbookEntry], made_at: str, made_by: str, unread: Sequence[UnreadLog] = ()) -> str:
    """Render a logbook, the latest flight first; each log that could not be read is a row that says why."""
    scripts = [script("sort.js")]
    ordered = sorted(entries, key=lambda each: each.flight.begun_utc_us, reverse=True)
    return rendered(
        PACKAGE,
        "logbook.html",
        entries=ordered,
        totals=totals([each.flight for each in ordered]),
        unread=unread,
        simulated=sum(each.flight.simulated for each in entries),
        made_at=made_at,
        made_by=made_by,
        scripts=[Markup(text) for text in scripts],
        policy=Markup(content_policy(scripts)),
        lasted=lasted,
    )


def lasted(us: int) -> str:
    """A duration as hours, minutes and seconds."""
    seconds = us // 1_000_000
    return f"{seconds // 3_600}:{seconds // 60 % 60:02}:{seconds % 60:02}"
