"""Zones, tables of derived zones, and the projection."""

from collections.abc import Generator, Iterator

from rtshcua.decision.checks.indexes import at, index, within
from rtshcua.decision.checks.rings import rings
from rtshcua.decision.outline import rings as outline
from rtshcua.model.flat.limits import DAY, MAX_TABLES, MAX_TOTAL_VERTICES, MAX_VALUE, MAX_ZONES
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import (
    AREA,
    CIRCLE,
    HALF_TURN,
    HIGHEST,
    LOWEST,
    MAX_COORDINATE,
    MAX_RINGS,
    MAX_VERTICES,
    POLYGON,
    SHIFT,
    Projection,
    Zone,
    unproject,
)

#: 1e-7 degree is about 11 mm at the equator
MAX_FACTOR = 32 << SHIFT


def zones(policy: Policy) -> Iterator[str]:
    """What is wrong with a policy's geometry."""
    yield from at("projection", _projection(policy.projection))
    yield from within("number of zones", len(policy.zones), 0, MAX_ZONES)
    yield from within("number of declared zones", policy.declared, 0, len(policy.zones))
    yield from within("number of vertices", sum(map(_vertices, policy.zones)), 0, MAX_TOTAL_VERTICES)
    for number, zone in enumerate(policy.zones):
        yield from at(f"zone {number}", _zone(zone))
    yield from within("number of tables", len(policy.tables), 0, MAX_TABLES)
    for number, table in enumerate(policy.tables):
        if len(table) != policy.declared:
            yield f"table {number}: {len(table)} entries for {policy.declared} declared zones"
        for entry in table:
            yield from at(f"table {number}", index("zone", entry, len(policy.zones)))


def _projection(projection: Projection) -> Iterator[str]:
    yield from _on_earth(projection.latitude, projection.longitude)
    yield from within("east", projection.east, 1, MAX_FACTOR)
    yield from within("north", projection.north, 1, MAX_FACTOR)


def place(projection: Projection, x: int, y: int) -> Iterator[str]:
    """What is wrong with a local place that may be flown to: it must have a latitude and a longitude."""
    yield from at(f"place {x}, {y}", _near(projection, x))
    yield from at(f"place {x}, {y}", _on_earth(*unproject(projection, x, y)))


def _near(projection: Projection, x: int) -> Iterator[str]:
    if abs(x) << SHIFT >= HALF_TURN * projection.east:
        yield "it is half around the earth"


def _on_earth(latitude: int, longitude: int) -> Iterator[str]:
    yield from within("latitude", latitude, -900_000_000, 900_000_000)  # 1e-7 degree
    yield from within("longitude", longitude, -HALF_TURN, HALF_TURN)


def _vertices(zone: Zone) -> int:
    """How many vertices there are at least, before anything else is known of a zone."""
    counts = 1 + min(max(zone.data[0], 0), MAX_RINGS) if zone.shape == AREA and zone.data else 0
    return max(len(zone.data) - counts, 0) // 2


def _zone(zone: Zone) -> Iterator[str]:
    yield from within("floor", zone.floor, LOWEST, HIGHEST)
    yield from within("ceiling", zone.ceiling, zone.floor, HIGHEST)
    if zone.shape == CIRCLE:
        if len(zone.data) != 3:
            yield "a circle has a centre and a squared radius"
        yield from within("squared radius", zone.data[2], 1, MAX_COORDINATE * MAX_COORDINATE)
        coordinates = zone.data[:2]
    elif zone.shape in (POLYGON, AREA):
        start = yield from _counts(zone)
        coordinates = zone.data[start:]
    else:
        yield f"there is no shape {zone.shape}"
    for coordinate in coordinates:
        yield from within("coordinate", coordinate, -MAX_COORDINATE, MAX_COORDINATE)
    if zone.shape != CIRCLE:
        yield from rings(tuple(outline(zone)))
    yield from _times(zone)


def _counts(zone: Zone) -> Generator[str, None, int]:
    """What is wrong with the numbers of rings and corners; where the coordinates begin."""
    data, start = zone.data, 0
    if zone.shape == AREA:
        count = data[0] if data else 0
        yield from within("number of rings", count, 1, MAX_RINGS)
        start = 1 + count
        for corners in data[1:start]:
            yield from within("number of corners", corners, 3, MAX_TOTAL_VERTICES)
        if len(data) != start + 2 * sum(data[1:start]):
            yield "the coordinates are not as many as the corners of the rings need"
    else:
        if len(data) % 2:
            yield "a coordinate is missing"
        yield from within("number of vertices", len(data) // 2, 3, MAX_VERTICES)
    return start


def _times(zone: Zone) -> Iterator[str]:
    if len(zone.daily) not in (0, 2) or len(zone.dates) not in (0, 2):
        yield "a time has a start and an end"
    if zone.daily and not (0 <= zone.daily[0] < DAY and 0 <= zone.daily[1] <= DAY):
        yield f"{zone.daily[0]}..{zone.daily[1]} us is no window of a day"
    if zone.dates and not 0 <= zone.dates[0] <= zone.dates[1] <= MAX_VALUE:
        yield f"{zone.dates[0]}..{zone.dates[1]} us is no interval of UTC"
