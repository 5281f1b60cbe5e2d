"""Renders a flight's report as one self-contained HTML page that works offline and prints: with its own style and
scripts, which its Content Security Policy (level 3) names by digest, and nothing from elsewhere. The same report gives
the same bytes.
"""

import json
from base64 import b64encode
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from hashlib import sha256
from importlib.resources import files
from operator import itemgetter
from typing import Final, TypeVar
from urllib.parse import urlsplit

from markupsafe import Markup

from rtshcua.ground.drawing.drawn_site import FlightMark, FlownPlace, FlownWay
from rtshcua.ground.drawing.height_profile import flown_heights
from rtshcua.ground.drawing.html import rendered
from rtshcua.ground.drawing.time_charts import (
    ChartLimit,
    ChartLine,
    Lane,
    LaneChart,
    LaneEvent,
    TimeAxis,
    TimeChart,
    axis_of,
    clock,
    lane_chart,
    line_gap_us,
    thinned,
    time_chart,
)
from rtshcua.ground.drawing.zone_map import ZoneMap, mission_map
from rtshcua.ground.flight import embedding
from rtshcua.ground.flight.flight_content import LANES, DecisionView, FlightReport, SignalCurve
from rtshcua.ground.flight.flown import TrackPoint
from rtshcua.ground.flight.track import parts
from rtshcua.ground.flight.units import unit_of
from rtshcua.model.flat.zone import SHIFT, Projection
from rtshcua.model.quantity import Dimension, display

_Point = TypeVar("_Point")

#: where the templates are
PACKAGE: Final = "rtshcua.ground.flight"
#: the most decisions and events of the timeline that are told in full
MOST_TOLD: Final = 500
#: the share of the flight that the time axis shows of the time before
_BEFORE: Final = 20
#: the most points of a drawn line
_MOST_POINTS: Final = 1_200
#: the most decisions that are marked on the map
_MOST_MARKS: Final = 20
#: the most images on the map
_MOST_IMAGES: Final = 5_000
#: the width of the drawing of a signal, px
_NARROW: Final = 520


def page(report: FlightReport, *, live: bool = False, tiles: str = "") -> str:
    """Render a report; a `live` one fetches itself again from where it came. `tiles` is the address of map tiles, with
    `{z}`, `{x}` and `{y}`, which a reader may switch on.
    """
    # a mission may have been issued long before: what is earlier than this stands at the begin of the axis
    first_us = min([0, *(each.t_us for each in report.timeline)])
    axis = axis_of(max(first_us, -report.lasted_us // _BEFORE), _last_us(report))
    flown = _flown(report)
    heights = None if flown is None else flown_heights(report.site, flown)
    seen = report.track is not None and bool(report.track.places)
    plan = mission_map(report.site, report.way, flown=flown) if seen else None
    narrow = axis._replace(width=_NARROW)
    signals = tuple(
        _signal(each, narrow, report.log_ends_us)
        for each in report.signals
        if any(v is not None for _, v in each.series.points)
    )
    tiles = tiles if plan is not None else ""
    scripts = [script("cursor.js")]
    scripts += [script("growing.js")] if live else []
    scripts += [script("tiles.js")] if tiles else []
    verifier = embedding.script() if report.log else ""
    return rendered(
        PACKAGE,
        "flight_report.html",
        flight=report,
        axis=axis,
        plan=plan,
        heights=heights,
        lanes=_lanes(report, axis),
        signals=signals,
        most=MOST_TOLD,
        decided={each.seq for each in report.decisions[:MOST_TOLD]},
        data=_data(report, axis, plan),
        scripts=[Markup(text) for text in scripts],
        policy=Markup(content_policy([*scripts, verifier] if verifier else scripts, live=live, tiles=tiles)),
        live=live,
        tiles=tiles,
        tiles_from=origin_of(tiles),
        verifier=Markup(verifier),
        chunks=_chunks,
        clocked=clocked,
        aged=aged,
        degrees=_degrees,
        metres=_metres,
    )


def refused_page(text: str) -> str:
    """A page in place of one that cannot be made, which says why."""
    return rendered(PACKAGE, "refused.html", text=text)


@cache
def script(name: str) -> str:
    """A script that ships."""
    return (files(PACKAGE) / "templates" / name).read_text(encoding="utf-8")


def origin_of(tiles: str) -> str:
    """The scheme and the host of the address of tiles."""
    parts = urlsplit(tiles)
    return f"{parts.scheme}://{parts.netloc}" if tiles else ""


def content_policy(scripts: Sequence[str], *, live: bool = False, tiles: str = "") -> str:
    """The Content Security Policy of a page with these scripts, which may fetch itself again if it is `live`, and
    images from where `tiles` are; the template adds the digest of the style.
    """
    digests = " ".join(f"'sha256-{b64encode(sha256(text.encode()).digest()).decode('ascii')}'" for text in scripts)
    fetching = "connect-src 'self'; " if live else ""
    fetching += f"img-src {origin_of(tiles)}; " if tiles else ""
    return f"default-src 'none'; script-src {digests}; {fetching}base-uri 'none'; form-action 'none'"


def _last_us(report: FlightReport) -> int:
    """The end of the time axis: the last record, or the last of the telemetry that goes on after it."""
    if report.log_ends_us is None:
        return report.lasted_us
    track = () if report.track is None else report.track.points
    times = [each.t_us for each in track[-1:]]
    times += [t_us for each in report.signals for t_us, _ in each.series.points[-1:]]
    return max([report.lasted_us, *times])


def _flown(report: FlightReport) -> FlownWay | None:
    """The track in parts between gaps of the telemetry, with a mark where each of the first decisions fell."""
    track = report.track
    if track is None:
        return None
    places = track.places or ((0, 0),) * len(track.points)
    flown = [_flown_place(*each) for each in zip(track.points, places, strict=True)]
    first = sorted(report.decisions, key=_goes_on)[:_MOST_MARKS]
    marks = tuple(
        FlightMark(each.t_us, *(each.where or (0, 0)), f"{each.seq}: {_marked(each)}",
                   "event" if _goes_on(each) else "refused")
        for each in sorted(first, key=lambda each: each.t_us)
        if each.where is not None or not track.places
    )  # fmt: skip
    apart = [tuple(flown[part.start : part.stop]) for part in parts(track.points)]
    split = [_split(each, report.log_ends_us, lambda place: place.t_us) for each in apart]
    later = tuple(tuple(each) for _, each in split if each)
    return FlownWay(tuple(tuple(each) for each, _ in split if each), marks, _places_of_images(report), later)


def _flown_place(point: TrackPoint, place: tuple[int, int]) -> FlownPlace:
    ground = None if point.above_ground is None else point.above_home - point.above_ground
    return FlownPlace(point.t_us, *place, point.above_home, ground)


def _places_of_images(report: FlightReport) -> tuple[tuple[int, int, str], ...]:
    first = report.images[:_MOST_IMAGES]
    return tuple((*each.where, f"image {each.number}") for each in first if each.where is not None)


def _split(
    points: Sequence[_Point], log_ends_us: int | None, time: Callable[[_Point], int]
) -> tuple[Sequence[_Point], Sequence[_Point]]:
    """The points of a line up to the end of the log, and from the last of these on; the latter only if more follow."""
    end = len(points) if log_ends_us is None else bisect_right(points, log_ends_us, key=time)
    return points[:end], points[max(end - 1, 0) :] if end < len(points) else ()


def _scaled(points: Sequence[tuple[int, int | None]], divide: int) -> list[tuple[int, float | None]]:
    return [(t_us, None if value is None else value / divide) for t_us, value in points]


def _signal(view: SignalCurve, axis: TimeAxis, log_ends_us: int | None) -> TimeChart:
    series = view.series
    unit = unit_of(series)
    divide = 10**unit.digits
    points = _scaled(thinned(series.points, _MOST_POINTS), 1 if series.labels else divide)
    limits = [ChartLimit(each.value / divide, each.told, each.low) for each in view.limits]
    used = {int(value) for _, value in points if value is not None}
    labels = {number: series.labels.get(number, str(number)) for number in sorted(used)} if series.labels else None
    told = f"The values of {series.name} over time."
    until, later = _split(points, log_ends_us, itemgetter(0))
    lines = [ChartLine("signal", series.name, until, series.stale_us)]
    if later:
        lines.append(ChartLine("later", f"{series.name} after the last record of the log", later, series.stale_us))
    return time_chart(series.name, told, unit.symbol, axis, lines, limits, labels)


def _lanes(report: FlightReport, axis: TimeAxis) -> LaneChart:
    lanes = []
    for name in LANES:
        events = [
            LaneEvent(each.t_us, each.until_us, each.kind, f"{clocked(each.t_us)} {each.told.replace('`', '')}",
                      "" if each.seq is None else f"record-{each.seq}")
            for each in report.timeline
            if each.lane == name
        ]  # fmt: skip
        lanes.append(Lane(name, events[:MOST_TOLD]))
    return lane_chart(
        "The timeline of the flight", "Lanes of events; the table beneath tells them in words.", axis, lanes
    )


def clocked(t_us: int) -> str:
    """A time since the beginning, to a tenth of a second."""
    tenths = abs(t_us) // 100_000
    return f"{'-' * (t_us < 0)}{clock(tenths // 10)}.{tenths % 10}"


def aged(us: int) -> str:
    """An age, to the precision that a person can use."""
    return display(-(-us // 1_000) * 1_000, Dimension.DURATION) if us < 10_000_000 else f"{us // 1_000_000} s"


def _degrees(cd: int | None) -> str:
    """An angle in 1/100 degree, to a tenth."""
    return "" if cd is None else f"{'-' * (cd < 0)}{abs(cd) // 100}.{abs(cd) % 100 // 10}°"


def _metres(mm: int | None) -> str:
    """A length in mm, to a tenth of a metre."""
    return "" if mm is None else f"{'-' * (mm < 0)}{abs(mm) // 1_000}.{abs(mm) % 1_000 // 100} m"


def _chunks(digest: str) -> list[str]:
    return [digest[at : at + 8] for at in range(0, len(digest), 8)]


def _data(report: FlightReport, axis: TimeAxis, plan: ZoneMap | None) -> Markup:
    """What the cursor shows, as JSON that is safe in a page: times in ms, places in cm, heights in dm, as differences
    from one to the next. `map` is where a place is on the map: the scale in px per cm, and home.
    """
    data: dict[str, object] = {
        "from": axis.from_us // 1_000,
        "to": axis.to_us // 1_000,
        "home": None,
        "track": None,
        "map": None,
        "signals": [_signal_data(each, axis) for each in report.signals if each.series.points],
    }
    track, elevation = report.track, report.site.elevation
    if track is not None:
        data["home"] = None if elevation is None else round(elevation / 100)
        data["track"] = {
            "t": _differences(each.t_us // 1_000 for each in track.points),
            "up": _differences(each.above_home // 100 for each in track.points),
            "x": _differences(x // 10 for x, _ in track.places),
            "y": _differences(y // 10 for _, y in track.places),
        }
    if plan is not None:
        data["map"] = {"scale": 10 * plan.on.scale, "x0": plan.on.x0, "y0": plan.on.y0, **_plane(report.projection)}
    return safe_json(data)


def _goes_on(decision: DecisionView) -> bool:
    """Whether a decision lets a step fly, not a fallback."""
    return decision.outcome == "allow" and not decision.flies


def _marked(decision: DecisionView) -> str:
    return decision.flies.partition("(")[0] if decision.outcome == "allow" and decision.flies else decision.outcome


def _plane(projection: Projection | None) -> dict[str, float]:
    """The local plane for the drawing of tiles: the origin in degrees, and cm per degree; nothing if it is removed."""
    if projection is None:
        return {}
    cm = 10_000_000 / (1 << SHIFT) / 10
    return {
        "latitude": projection.latitude / 1e7, "longitude": projection.longitude / 1e7,
        "east": projection.east * cm, "north": projection.north * cm,
    }  # fmt: skip


def _signal_data(view: SignalCurve, axis: TimeAxis) -> dict[str, object]:
    series = view.series
    unit = unit_of(series)
    divide = 10**unit.digits
    points = thinned(series.points, _MOST_POINTS)
    return {
        "name": series.name,
        "gap": line_gap_us(series.stale_us, axis) // 1_000,
        "unit": unit.symbol,
        "divide": 1 if series.labels else divide,
        "labels": {str(number): text for number, text in series.labels.items()},
        "t": _differences(t_us // 1_000 for t_us, _ in points),
        "v": [value for _, value in points],
    }


def _differences(values: Iterable[int]) -> list[int]:
    found: list[int] = []
    before = 0
    for value in values:
        found.append(value - before)
        before = value
    return found


def safe_json(value: object) -> Markup:
    """JSON for a data block of a page: pure ASCII, and without `<`, `>` and `&`."""
    text = json.dumps(value, ensure_ascii=True, separators=(",", ":"))
    return Markup(text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026"))
