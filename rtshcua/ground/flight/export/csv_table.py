"""A flight as one CSV table (RFC 4180) for spreadsheets.

A row for each reported position; each signal has its last value before that time, or nothing if it was unknown or
stale. Decisions and events are in the column `records` of the first row after them (those after the last row, in the
last one), so that the file is complete and can be piped. The column `log` says whether the log verifies. No cell with
a text begins like a formula.
"""

import csv
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from io import StringIO
from typing import Final

from rtshcua.ground.flight.export.exported import (
    DEGREES,
    HEADING,
    METRES,
    SECONDS,
    FlightExport,
    decimal,
    shown,
    utc_text,
)
from rtshcua.ground.flight.flown import SignalSeries, TrackPoint
from rtshcua.ground.flight.units import SignalUnit, unit_of

DATUM: Final = "each column of heights names its own"
_TRACK: Final = (
    "time_utc", "t_s", "latitude_deg", "longitude_deg", "above_sea_m", "above_home_m", "above_ground_m",
    "speed_north_m_s", "speed_east_m_s", "speed_down_m_s", "heading_true_deg",
)  # fmt: skip
#: characters by which spreadsheets recognise a formula, also in their full-width forms
_FORMULA: Final = tuple("=+-@＝＋－＠")


def csv_table(export: FlightExport) -> bytes:
    """The table in UTF-8, with a header."""
    telemetry = export.flight.telemetry
    signals = () if telemetry is None else telemetry.signals
    columns = [_Column(each, unit_of(each)) for each in signals]
    text = StringIO()
    table = csv.writer(text)  # quotes and lines as in RFC 4180
    table.writerow((*_TRACK, *(each.title for each in columns), "records", "log"))
    status = "verified" if export.verified else "not verified"
    for point, records in zip(export.track, _records(export), strict=True):
        table.writerow((*_cells(export, point), *(each.at(point.t_us) for each in columns), records, status))
    return text.getvalue().encode()


def _text(text: str) -> str:
    """A text that no spreadsheet takes for a formula; an apostrophe before it means a text."""
    text = shown(text)
    return f"'{text}" if text.lstrip().startswith(_FORMULA) else text


def _cells(export: FlightExport, point: TrackPoint) -> Iterator[str]:
    yield utc_text(export.flight.utc_of(point.t_us))
    yield decimal(point.t_us, SECONDS)
    yield decimal(point.latitude, DEGREES)
    yield decimal(point.longitude, DEGREES)
    yield decimal(point.above_sea, METRES)
    yield decimal(point.above_home, METRES)
    yield "" if point.above_ground is None else decimal(point.above_ground, METRES)
    for speed in (point.north, point.east, point.down):
        yield decimal(speed, METRES)
    yield "" if point.heading is None else decimal(point.heading, HEADING)


class _Column:
    """A signal as a column."""

    def __init__(self, signal: SignalSeries, unit: SignalUnit) -> None:
        self.title = _text(f"signal.{signal.name}{unit.title}")
        self._signal, self._digits = signal, unit.digits

    def at(self, t_us: int) -> str:
        """The cell at a time."""
        points = self._signal.points
        before = bisect_right(points, t_us, key=lambda each: each[0])
        if not before or t_us - points[before - 1][0] > self._signal.stale_us:
            return ""
        value = points[before - 1][1]
        if value is None:
            return ""
        label = self._signal.labels.get(value)
        return decimal(value, self._digits) if label is None else _text(label)


def _records(export: FlightExport) -> list[str]:
    """The decisions and events of each row."""
    found: list[list[str]] = [[] for _ in export.track]
    for each in export.told if found else ():
        row = bisect_left(export.track, each.t_us, key=lambda point: point.t_us)
        found[min(row, len(found) - 1)].append(each.words)
    return [_text("; ".join(each)) for each in found]
