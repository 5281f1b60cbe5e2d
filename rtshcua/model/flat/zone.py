"""Zones in local integer millimetres.

x is east, y is north of the vehicle's declared home; the map from WGS 84 is `Projection`. Coordinates stay within
`MAX_COORDINATE`, so that every cross product of differences fits into a signed 64-bit integer.
"""

from rtshcua.model.flat.struct import Flat

MAX_COORDINATE = 1 << 29  # mm, about 537 km
MAX_VERTICES = 4096
LOWEST, HIGHEST = -(1 << 30), 1 << 30  # mm above home: no floor, no ceiling

MAX_RINGS = 1024
CIRCLE, POLYGON, AREA = 0, 1, 2


class Projection(Flat, frozen=True):
    """Local mm from 1e-7 degree: `x = (longitude - longitude0) * east >> SHIFT`, `y = (latitude - latitude0) * north
    >> SHIFT`. The difference of the longitudes is the one within 180 degrees, also where longitude 180 lies between.

    `east` and `north` are mm per 1e-7 degree, times 2**SHIFT, computed at compile time on the WGS 84 ellipsoid at
    home. The shift rounds towards minus infinity: at most 1 mm. At mid-latitudes, distances are true to 1 part in
    1,000 within 5 km of home and to 1 part in 10,000 within 500 m; docs/adr/0011-zones.md has the bound.
    """

    latitude: int
    longitude: int
    east: int
    north: int


SHIFT = 20

#: a whole turn, in 1e-7 degree
TURN = 3_600_000_000
HALF_TURN = TURN // 2


def meridian(longitude: int, near: int) -> int:
    """The number, within 180 degrees of the longitude `near`, of the same meridian as `longitude`, which may be
    beyond 180 degrees. In 1e-7 degree.
    """
    return near + (longitude - near + HALF_TURN) % TURN - HALF_TURN


def project(projection: Projection, latitude: int, longitude: int) -> tuple[int, int]:
    """(x, y) in local mm of a place in 1e-7 degree."""
    return (
        (meridian(longitude, projection.longitude) - projection.longitude) * projection.east >> SHIFT,
        (latitude - projection.latitude) * projection.north >> SHIFT,
    )


def unproject(projection: Projection, x: int, y: int) -> tuple[int, int]:
    """(latitude, longitude) in 1e-7 degree of a local place, rounded to the nearest 1e-7 degree; the longitude is
    from 180 W to 180 E, also across longitude 180.
    """
    east, north = projection.east, projection.north
    longitude = projection.longitude + ((x << SHIFT) + east // 2) // east
    return (
        projection.latitude + ((y << SHIFT) + north // 2) // north,
        longitude if abs(longitude) <= HALF_TURN else meridian(longitude, 0),
    )


class Zone(Flat, frozen=True):
    """An open set: a point on its boundary, floor or ceiling is outside.

    `shape` is `CIRCLE` with `data` = (x, y, radius squared), or `POLYGON` with `data` = (x0, y0, x1, y1, ...),
    simple and counter-clockwise, or `AREA` with `data` = (rings, corners of each ring ..., x0, y0, ...): outer
    rings counter-clockwise, holes clockwise, all simple and without a common point. `floor`, `ceiling` in mm above
    home. `name` is the name in the source, `grow(...)` for a derived zone.
    """

    name: str
    shape: int
    floor: int
    ceiling: int
    data: tuple[int, ...]
    daily: tuple[int, ...] = ()  # (start, end): only between these us since local midnight, over midnight if reversed
    dates: tuple[int, ...] = ()  # (start, end): only between these us of UTC since the epoch, both included
    #: in place of `daily`: (start, end, start, end, ...), strictly ascending: only from each of these us since the
    #: local Monday 00:00 until before the one after it
    weekly: tuple[int, ...] = ()
