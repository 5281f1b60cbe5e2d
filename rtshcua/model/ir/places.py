"""Zones and vehicles."""

from typing import Literal

from rtshcua.model.ir.expression import Coordinates, Quantity, Reference, TimeOfDay
from rtshcua.model.ir.node import Name, Node

#: after the name of a zone: the place in it to fly to
ENTRY = ".entry"


class Circle(Node, kw_only=True):
    """All points nearer to `center` than `radius`."""

    kind: Literal["circle"] = "circle"
    center: Coordinates
    radius: Quantity


class Polygon(Node, kw_only=True):
    """A simple polygon by its corners, WGS 84, in either direction, not closed by a repeated corner. `holes` are simple
    polygons inside of it that do not belong to it, nor do their edges.
    """

    kind: Literal["polygon"] = "polygon"
    corners: tuple[Coordinates, ...]
    holes: tuple[tuple[Coordinates, ...], ...] = ()


class Corridor(Node, kw_only=True):
    """`corridor(a, b, c, width 40 m)`: all points nearer to the line through the places than half the width."""

    kind: Literal["corridor"] = "corridor"
    points: tuple[Coordinates, ...]
    width: Quantity


class GeoJson(Node, kw_only=True):
    """`from "zones/bridge.geojson"`, `from "..." feature "name"`: a Polygon or MultiPolygon of RFC 7946. `path` is as
    written, relative to the source; `feature` is a Feature's `id`, or its `name` property.
    """

    kind: Literal["geojson"] = "geojson"
    path: str
    feature: str | None


class Combination(Node, kw_only=True):
    """`union(a, b, ...)`, or `difference(a, b, ...)`: what is in the first and in none of the others."""

    kind: Literal["combination"] = "combination"
    operator: Literal["union", "difference"]
    shapes: tuple["Shape", ...]


#: a reference names another zone, whose ground plan is used
Shape = Circle | Polygon | Corridor | GeoJson | Combination | Reference


class Daily(Node):
    """`active 08:00 .. 18:00`: the zone exists between these local times of every day, over midnight if reversed.

    `days` are the days of the week on which these windows begin (`active 22:00 .. 06:00 on friday`), counted from
    Monday, 0, and ascending; empty means all. `active on saturday, sunday` is from the first to the last us of the
    days.
    """

    start: TimeOfDay
    end: TimeOfDay
    days: tuple[int, ...] = ()


class Dates(Node):
    """`active "2026-05-01T08:00Z" .. "2026-05-02T18:00Z"`: the zone exists between two moments, us since the epoch."""

    start_us: int
    end_us: int


class ZoneDecl(Node):
    """`zone bridge_a = polygon(...) floor 0 m ceiling 60 m above home entry 47.39 N, 8.54 E active 08:00 .. 18:00`."""

    name: Name
    shape: Shape
    floor: Quantity | None
    ceiling: Quantity | None
    entry: Coordinates | None
    daily: Daily | None = None
    dates: Dates | None = None


class Braking(Node):
    """`brakes from 12 m/s in 6 s after 500 ms`: told to stop, the vehicle continues for `reaction` and then
    decelerates evenly.
    """

    speed: Quantity
    time: Quantity
    reaction: Quantity


class NamedSpeed(Node):
    """`landing 0.5 m/s below 10 m`: a lower bound of one of the vehicle's speeds; `below` is the height of the last
    part of a landing, for that speed only.
    """

    name: Name
    speed: Quantity
    below: Quantity | None = None


class Acceleration(Node):
    """`accelerates to 5 m/s in 5 s`: a lower bound of the acceleration and deceleration on a leg."""

    speed: Quantity
    time: Quantity


class OpticalLength(Node, kw_only=True):
    """A small length in um, finer than the mm of other lengths: `13.2 mm`."""

    value: int


class CameraDecl(Node, kw_only=True):
    """`camera mapper sensor 13.2 mm by 8.8 mm focal 8.8 mm pixels 5472 by 3648 every at least 700 ms exposure at most
    1 ms`.

    `width` and `columns` are across the direction of flight of a camera that looks down, `height` and `rows` along it;
    the other way round if it is mounted `portrait`. `interval` is the shortest time between two pictures.
    """

    name: Name
    width: OpticalLength
    height: OpticalLength
    focal: OpticalLength
    columns: Quantity
    rows: Quantity
    interval: Quantity
    exposure: Quantity
    portrait: bool


class VehicleDecl(Node):
    """One aircraft, as the checks, the simulation and "wrong vehicle" need it; signed with the policy.

    `endurance` is the hover time of a full battery, `reserve` the charge that must remain after landing at home,
    `within` how far the real home may lie from the declared one, `utc_offset` the local time's distance from UTC,
    or `time_zone` the IANA name of its time zone. `elevation` (`elevation 408 m above sea within 5 m`) converts
    altitudes above sea. `without` are the signals of sensors that are not fitted. `speeds`, `acceleration`, `wind`
    and `flight` are the inputs of proofs about durations and charges; each has a default
    (`rtshcua.ground.lower.vehicle`).
    """

    name: Name
    identity: str
    home: Coordinates
    within: Quantity
    speed: Quantity
    climb: Quantity
    position_error: Quantity
    endurance: Quantity
    reserve: Quantity
    utc_offset: Quantity | None
    elevation: Quantity | None = None  # of home above sea
    elevation_within: Quantity | None = None  # how far the real elevation of the ground at home may differ
    return_altitude: Quantity | None = None  # `return at 30 m`: the autopilot's return climbs to it before it flies
    braking: Braking | None = None
    without: tuple[Name, ...] = ()
    speeds: tuple[NamedSpeed, ...] = ()
    acceleration: Acceleration | None = None
    wind: Quantity | None = None  # the greatest wind in which it flies
    flight: Quantity | None = None  # how long a full battery lasts, whatever the vehicle flies
    time_zone: Name | None = None  # `clock "Europe/Berlin"`
    cells: Quantity | None = None  # `cells 4`: the number in series, by which `battery.cell` is divided
    cameras: tuple[CameraDecl, ...] = ()  # read on the ground alone
    servos: tuple[Quantity, ...] = ()  # `servos 9, 10`: outputs that no part of the vehicle's motion uses
