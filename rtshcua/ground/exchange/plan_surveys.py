"""Write the surveys of a plan as `cover` steps: each with its zone, its camera and a skill that states the pictures.

The compiler plans the lines again (docs/survey.md), so a survey is written this way only where that keeps its
meaning: the same area at the same height, with the same camera, overlap and pictures. Otherwise the legs of the planner
are kept.
"""

from collections.abc import Iterator, Sequence
from decimal import Decimal
from itertools import pairwise
from math import ceil, isqrt
from typing import Final, NamedTuple

from rtshcua.ground.checker.geojson import GeoPolygon, NoArea, Number, polygon_of
from rtshcua.ground.exchange.losses import Loss
from rtshcua.ground.exchange.plan_steps import CHANGE_SPEED, IGNORED, is_vertical
from rtshcua.ground.exchange.qgc_reading import QgcItem, QgcPlan
from rtshcua.ground.exchange.qgc_surveys import CORRIDOR, STRUCTURE, SURVEY, NoSurvey, PlannedCamera, QgcSurvey
from rtshcua.ground.exchange.stock_policy import CLIMB, CRUISE, ERROR_MM, FLIGHT_S, GeoPoint
from rtshcua.ground.exchange.zone_source import (
    SourceNames,
    SourceZone,
    circle_text,
    corridor_text,
    metres,
    place_text,
    polygons_text,
)
from rtshcua.ground.gateway.interface import ProposedStep
from rtshcua.ground.gateway.plan_transfer import WAYPOINT
from rtshcua.ground.gateway.translation import HOME_FRAMES
from rtshcua.ground.geometry.cameras import SurveyCamera, apart
from rtshcua.ground.geometry.inspection import CentreLine, parallel_lines
from rtshcua.ground.geometry.polygons import Point, contained, counter_clockwise, length
from rtshcua.ground.geometry.projection import projection_at
from rtshcua.ground.geometry.shapes import MultiPolygon, SimplePolygon
from rtshcua.ground.geometry.survey import AROUND, MOST_LINES, PathAim, around_reach, survey
from rtshcua.model.flat.zone import Projection, project, unproject
from rtshcua.model.quantity import Dimension, display

_NAMES: Final = {SURVEY: "survey", CORRIDOR: "corridor_scan", STRUCTURE: "structure_scan"}
_PATTERNS: Final = {SURVEY: "grid", CORRIDOR: "corridor", STRUCTURE: AROUND}
#: the commands that take pictures, and the parameter that is not 0 then: by distance; on the way (interval or number)
_TRIGGERS: Final = {206: 0, 2000: 2}
#: how much farther from a structure than planned a circle around it may be
_MOST_FARTHER: Final = 2
#: how much higher than a structure the way home is, mm
_OVER_MM: Final = 5_000
#: room outside of the way around a structure, mm
_ROOM_MM: Final = 10_000
#: the shortest interval of a camera that states none, ms
_INTERVAL_MS: Final = 100
_LEAST_SPEED, _MOST_SPEED = 1_000, 12_000  # mm/s
#: time to begin and to settle, s; and what a step may take longer than computed, of 100
_SETTLES_S, _MARGIN = 10, 105


class CoveredSurvey(NamedTuple):
    """A survey as source: its place in the file, its zones, the zone of a structure (empty: none), the camera of the
    vehicle, the skill, and the step. `way` are the flights to it and, of a structure, from it: the step comes after the
    flight at `place`. It is flown at most `farthest` mm from home and `highest` mm above it, takes `seconds`, and
    ends at `end`; `clear` is a height over a structure.
    """

    place: str
    zones: tuple[SourceZone, ...]
    keep_out: str
    camera: str
    skill: str
    step: ProposedStep
    way: tuple[QgcItem, ...]
    losses: tuple[Loss, ...]
    farthest: int
    highest: int
    seconds: int
    end: Point
    clear: int


class _Path(NamedTuple):
    """Where a survey is flown: the entry, the points and the heights of the path, in mm; the zones, of which the last
    is the area; and how far it sees, mm.
    """

    entry: Point
    points: tuple[Point, ...]
    heights: tuple[int, ...]
    zones: tuple[SourceZone, ...]
    sees: int


class _Demand(NamedTuple):
    """What the pictures show: the camera along the path, the distance of pictures in mm, the overlaps in 1/10000, and
    the speed in mm/s.
    """

    camera: SurveyCamera
    every: int
    forward: int
    side: int
    speed: int


def covered_plan(plan: QgcPlan, surveys: Sequence[CoveredSurvey]) -> QgcPlan:
    """A plan with the ways to these surveys in the place of their legs."""
    ways = {each.place: each.way for each in surveys}
    kept = [item for item in plan.items if _survey_of(item.place) not in ways]
    flown = sorted([*kept, *(item for way in ways.values() for item in way)], key=lambda each: _number(each.place))
    return plan._replace(
        items=tuple(flown),
        losses=tuple(each for each in plan.losses if each.place not in ways),
        not_kept=tuple(each for each in plan.not_kept if each.place not in ways),
    )


def _survey_of(place: str) -> str:
    """The place of the item of a mission that a place is in: `/mission/items/3`."""
    return "/".join(place.split("/")[:4])


def _number(place: str) -> int:
    return int(place.split("/")[3])


def cover_survey(plan: QgcPlan, one: QgcSurvey, home: GeoPoint, names: SourceNames) -> CoveredSurvey:
    """A survey as source. Raises `NoSurvey` if that would not keep its meaning."""
    plane = projection_at(home.latitude, home.longitude)
    if one.kind != STRUCTURE:
        _check_legs(plan, one)
    demand = _demand(plan, one)
    lens, name = names.of(one.camera.name, "camera"), names.of(_NAMES[one.kind], "survey")
    path = _around(one, demand, plane, names) if one.kind == STRUCTURE else _over(plan, one, demand, plane, names)
    seconds = _seconds(path, demand.speed) * _MARGIN // 100
    return CoveredSurvey(
        one.place,
        path.zones,
        path.zones[0].name if one.kind == STRUCTURE else "",
        _camera_text(lens, one.camera),
        "\n".join(_skill_lines(name, lens, one, path, demand, seconds)),
        ProposedStep(name, {"over": path.zones[-1].name}, ()),
        tuple(_way(one, path, plane)),
        tuple(_losses(one, path, demand)),
        max(length((0, 0), each) for each in (*path.points, path.entry)) + ERROR_MM,
        max(path.heights[-1], one.entrance),
        seconds,
        path.points[-1],
        one.top + _OVER_MM if one.kind == STRUCTURE else 0,
    )


def _check_legs(plan: QgcPlan, one: QgcSurvey) -> None:
    """Refuse a survey whose legs do something else than to take pictures on the way at one height."""
    legs = [each for each in plan.items if _survey_of(each.place) == one.place]
    flights = [each for each in legs if each.command == WAYPOINT]
    if len(flights) < 2:
        raise NoSurvey("its legs are not in the file")
    if any(each.frame not in HOME_FRAMES for each in flights):
        raise NoSurvey("its height is not above home")
    if any(each.params[6] is None or abs(each.params[6] * 1000 - one.distance) > 1 for each in flights):
        raise NoSurvey("its height is not the distance of its camera")
    _check_others([each for each in legs if each.command != WAYPOINT])


def _check_others(others: Sequence[QgcItem]) -> None:
    if any(IGNORED.get(each.command) != "camera" for each in others):
        raise NoSurvey("it has other commands than flights and pictures")
    if not any(each.command in _TRIGGERS and each.params[_TRIGGERS[each.command]] for each in others):
        raise NoSurvey("it takes no pictures")


def _demand(plan: QgcPlan, one: QgcSurvey) -> _Demand:
    camera, sideways = one.camera, one.kind == STRUCTURE
    wide, high = (camera.width, camera.pixels_wide), (camera.height, camera.pixels_high)
    along, across = (wide, high) if sideways != camera.portrait else (high, wide)
    interval_us = max(camera.interval_ms, _INTERVAL_MS) * 1000
    seen = SurveyCamera(along[0], across[0], along[1], across[1], camera.focal, interval_us, 1_000)
    spacing, forward, side = one.frontal, one.frontal_overlap, one.side_overlap
    if sideways:  # the planner's frontal direction is upwards
        spacing, forward, side = one.side, side, forward
    every = min(spacing, apart(seen.shows_along(one.distance), forward))
    if every < 1:
        raise NoSurvey("its pictures are too near to each other")
    return _Demand(seen, every, forward, side, _speed(plan, one))


def _speed(plan: QgcPlan, one: QgcSurvey) -> int:
    """The speed that the plan sets before a survey, or else the one that it is planned for, in mm/s."""
    speed = plan.speed or Decimal(0)
    for each in plan.items:
        if _number(each.place) < _number(one.place) and each.command == CHANGE_SPEED and not is_vertical(each):
            speed = each.params[1] if each.params[1] is not None and each.params[1] > 0 else speed
    return max(_LEAST_SPEED, min(int(speed * 1000) or CRUISE, _MOST_SPEED))


# ---------------------------------------------------------------- where it is flown


def _over(plan: QgcPlan, one: QgcSurvey, demand: _Demand, plane: Projection, names: SourceNames) -> _Path:
    """The path of a survey, or of a corridor scan, over its area."""
    corners = tuple(project(plane, *each) for each in one.corners)
    spacing = apart(demand.camera.shows_across(one.distance), demand.side)
    points: tuple[Point, ...] | None
    if one.kind == CORRIDOR:
        lines = parallel_lines(CentreLine(corners, one.width // 2), ERROR_MM, max(spacing, 1), MOST_LINES)
        points = None if lines is None else tuple(point for each in lines for point in each)
        entry = _between(corners[0], corners[1])
        shape = corridor_text([(longitude, latitude) for latitude, longitude in one.corners], one.width)
    else:
        shape = polygons_text([_polygon(one)])
        ring = tuple(counter_clockwise(corners))
        entry = _entry(plan, one, ring, plane)
        points = survey(SimplePolygon(ring), "grid", one.distance, ERROR_MM, entry, PathAim(spacing=max(spacing, 1)))
    if not points:
        raise NoSurvey("its area is too small for a path that stays inside")
    at = place_text(*unproject(plane, *entry))
    name = names.of(f"{_NAMES[one.kind]}_area", "area")
    zone = SourceZone(name, (f"of the plan: {one.place}",), shape, (f"entry {at}",))
    return _Path(entry, points, (one.distance,), (zone,), one.distance)


def _polygon(one: QgcSurvey) -> GeoPolygon:
    ring = [[_number_of(longitude), _number_of(latitude)] for latitude, longitude in one.corners]
    try:
        return polygon_of([[*ring, *ring[:1]]], one.place)
    except NoArea as error:
        raise NoSurvey(error.message) from None


def _number_of(e7: int) -> Number:
    whole, rest = divmod(abs(e7), 10_000_000)
    return Number(f"{'-' if e7 < 0 else ''}{whole}.{rest:07}")


def _entry(plan: QgcPlan, one: QgcSurvey, ring: tuple[Point, ...], plane: Projection) -> Point:
    """A place inside of the area, near the beginning of the planner's first leg that is in it."""
    flights = [each for each in plan.items if _survey_of(each.place) == one.place and each.command == WAYPOINT]
    places = [project(plane, *(int((each or 0) * 10_000_000) for each in item.params[4:6])) for item in flights]
    for begin, end in pairwise(places):
        for eighths in (1, 2, 4):
            entry = _between(begin, end, eighths)
            if contained((ring,), entry):
                return entry
    raise NoSurvey("its legs are not in its area")


def _between(begin: Point, end: Point, eighths: int = 1) -> Point:
    """The point after some eighths of a leg."""
    x, y = (a * (8 - eighths) + b * eighths for a, b in zip(begin, end, strict=True))
    return x // 8, y // 8


def _around(one: QgcSurvey, demand: _Demand, plane: Projection, names: SourceNames) -> _Path:
    """The rounds around a structure, in the layers of the planner, from the lowest."""
    polygon = _polygon(one)
    hole = tuple(counter_clockwise([project(plane, *each) for each in one.corners]))
    lowest = (
        one.top - one.frontal // 2 - (one.layers - 1) * one.frontal if one.from_top else one.bottom + one.frontal // 2
    )
    if lowest < 1 or demand.side == 0:
        raise NoSurvey("its lowest layer is not above home" if lowest < 1 else "its layers do not overlap")
    heights = tuple(lowest + layer * one.frontal for layer in range(one.layers))
    x, y = hole[0]
    far = one.distance + 4 * max(length(hole[0], each) for each in hole) + _ROOM_MM
    outer = ((x - far, y - far), (x + far, y - far), (x + far, y + far), (x - far, y + far))
    points = survey(MultiPolygon((outer, hole[::-1])), AROUND, lowest, ERROR_MM, None, PathAim(distance=one.distance))
    if not points:
        raise NoSurvey("there is no way around it")
    sees = around_reach(hole, one.distance)
    if sees > _MOST_FARTHER * one.distance:
        raise NoSurvey(f"a circle around it is up to {metres(sees)} away from it, and no skill follows its outline")
    opposite = points[len(points) // 2]
    centre = (points[0][0] + opposite[0]) // 2, (points[0][1] + opposite[1]) // 2
    radius = length(centre, points[0]) + _ROOM_MM
    body, name = names.of("structure", "structure"), names.of("structure_area", "area")
    top = (f"ceiling {metres(one.top)}",)
    at = place_text(*unproject(plane, *points[0]))
    circle = circle_text(*unproject(plane, *centre), radius)
    zones = (
        SourceZone(body, (f"of the plan: {one.place}",), polygons_text([polygon]), top),
        SourceZone(name, ("around it",), f"difference({circle}, {body})", (f"entry {at}",)),
    )
    return _Path(points[0], points, heights, zones, sees)


def _way(one: QgcSurvey, path: _Path, plane: Projection) -> list[QgcItem]:
    """The flights to the entry, and from a structure back to its height."""
    latitude, longitude = (Decimal(each) / 10_000_000 for each in unproject(plane, *path.entry))

    def flight(height: int, place: str) -> QgcItem:
        params = (None, None, None, None, latitude, longitude, Decimal(height) / 1000)
        return QgcItem(place, WAYPOINT, 3, params, of=one.kind)

    there = flight(path.heights[0], one.place)
    if one.kind != STRUCTURE:
        return [there]
    return [flight(one.entrance, f"{one.place}/to"), there, flight(one.entrance, f"{one.place}/from")]


def _seconds(path: _Path, speed: int) -> int:
    """The time of the path at all heights: each leg is flown from rest to rest (`decision/flying.py`)."""
    steady, legs = min(speed, CRUISE), [length(*each) for each in pairwise((path.entry, *path.points))]
    once = sum(_leg_s(each, steady) for each in legs)
    levels = [_leg_s(above - below, CLIMB) for below, above in pairwise(path.heights)]
    return once * len(path.heights) + sum(levels) + _SETTLES_S


def _leg_s(way: int, speed: int) -> int:
    """The time of a leg in mm at a speed in mm/s, rounded up, with an acceleration of 1 m/s2."""
    flown = isqrt(4 * way // 1_000) if way * 1_000 < speed * speed else way // speed + speed // 1_000
    return flown + 1


# ---------------------------------------------------------------- the source


def _camera_text(name: str, camera: PlannedCamera) -> str:
    interval = max(camera.interval_ms, _INTERVAL_MS)
    return (
        f"camera {name} sensor {_optical(camera.width)} by {_optical(camera.height)} focal {_optical(camera.focal)} "
        f"pixels {camera.pixels_wide} by {camera.pixels_high} every at least {interval} ms "
        f"exposure at most 1 ms{' portrait' if camera.portrait else ''}"
    )


def _optical(length_um: int) -> str:
    whole, rest = divmod(length_um, 1000)
    return f"{whole}.{rest:03} mm" if rest else f"{whole} mm"


def _pixel_um(path: _Path, demand: _Demand) -> int:
    """What a pixel shows at most."""
    return ceil(demand.camera.sample_distance(path.sees) * 1000)


def _skill_lines(name: str, lens: str, one: QgcSurvey, path: _Path, demand: _Demand, seconds: int) -> Iterator[str]:
    low, high, every = metres(path.heights[0]), metres(path.heights[-1]), metres(demand.every)
    pattern, charge = _PATTERNS[one.kind], min(80, -(-100 * seconds // FLIGHT_S) + 1)
    layered = len(path.heights) > 1
    top = "highest" if layered else "altitude"
    yield f"skill {name}("
    yield "  over: zone,"
    if layered:
        yield f"  lowest: altitude in {low} .. {low} = {low},"
    yield f"  {top}: altitude in {high} .. {high} = {high},"
    heights = "from lowest to highest every step" if layered else "at altitude"
    if layered:
        step = metres(min(one.frontal, apart(demand.camera.shows_across(one.distance), demand.side)))
        yield f"  step: length in {step} .. {step} = {step},"
    if one.kind == STRUCTURE:
        away = metres(one.distance)
        yield f"  away: length in {away} .. {away} = {away},"
        heights += " distance away"
    speed = metres(demand.speed)
    yield f"  pattern: one of {pattern} = {pattern},"
    yield f"  speed: speed in {metres(min(_LEAST_SPEED, demand.speed))}/s .. {speed}/s = {speed}/s,"
    yield ") {"
    facing = " facing inward" if one.kind == STRUCTURE else ""
    yield f"  motion cover over {heights} pattern pattern{facing} speed speed"
    yield "  class tactical"
    yield "  deadline 5 s"
    yield "  valid for 4 h"
    yield f"  lasts at most {seconds} s"
    yield "  grace 1 s"
    yield "  require battery > 35 %"
    yield "  assume gps.fix >= fix_3d"
    area = "over" if one.kind == STRUCTURE else "grow(over, 15 m)"
    yield f"  maintain position inside {area} and height <= {top} + 5 m"
    yield (
        f"  pictures by {lens} every {every} resolution {_optical(_pixel_um(path, demand))} "
        f"overlap {_share(demand.forward)} forward {_share(demand.side)} side"
    )
    yield (
        f"  emits MAV_CMD_IMAGE_START_CAPTURE to camera with param3 = 1 every {every} succeeds with image within 3 s"
    )
    yield "  fallback hover for 10 s, return_home, emergency_land"
    yield f"  energy at most {charge} %"
    yield "  record intent, decision, state, authorization, effect"
    yield "}"


def _share(share: int) -> str:
    return display(share, Dimension.RATIO)


def _losses(one: QgcSurvey, path: _Path, demand: _Demand) -> Iterator[Loss]:
    """How the step differs from the planner's legs."""
    yield Loss("camera-trigger", one.place, f"a picture every {metres(demand.every)}")
    unstated = "the exposure" if one.camera.interval_ms else "the exposure and the shortest interval"
    yield Loss("camera-figures", one.place, f"{unstated} of {one.camera.name}")
    if one.kind == STRUCTURE:
        pixel = _optical(_pixel_um(path, demand))
        yield Loss("structure-round", one.place, f"{metres(one.distance)} to {metres(path.sees)} away, {pixel} a pixel")
        if one.pitch:
            yield Loss("gimbal", one.place, f"GimbalPitch {one.pitch:f}")
        if one.from_top:
            yield Loss("survey-lines", one.place, "the highest layer first")
        return
    yield Loss(
        "survey-lines", one.place, f"angle {one.angle:f} deg" if one.kind == SURVEY else "first corner and order"
    )
    if one.turnaround > 0:
        yield Loss("turnaround", one.place, f"{one.turnaround:f} m")
    if one.stops:
        yield Loss("hover-and-capture", one.place, one.kind)
