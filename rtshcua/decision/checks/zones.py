"""Zones, tables of derived zones, and the projection."""

from collections.abc import Iterator

from rtshcua.decision.checks.indexes import at, index, within
from rtshcua.model.flat.limits import MAX_TABLES, MAX_TOTAL_VERTICES, MAX_ZONES
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import (
    CIRCLE,
    HIGHEST,
    LOWEST,
    MAX_COORDINATE,
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
    yield from within("number of vertices", sum(len(zone.data) // 2 for zone in policy.zones), 0, MAX_TOTAL_VERTICES)
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
    yield from at(f"place {x}, {y}", _on_earth(*unproject(projection, x, y)))


def _on_earth(latitude: int, longitude: int) -> Iterator[str]:
    yield from within("latitude", latitude, -900_000_000, 900_000_000)  # 1e-7 degree
    yield from within("longitude", longitude, -1_800_000_000, 1_800_000_000)


def _zone(zone: Zone) -> Iterator[str]:
    yield from within("floor", zone.floor, LOWEST, HIGHEST)
    yield from within("ceiling", zone.ceiling, zone.floor, HIGHEST)
    if zone.shape == CIRCLE:
        if len(zone.data) != 3:
            yield "a circle has a centre and a squared radius"
        yield from within("squared radius", zone.data[2], 1, MAX_COORDINATE * MAX_COORDINATE)
        coordinates = zone.data[:2]
    elif zone.shape == POLYGON:
        if len(zone.data) % 2:
            yield "a coordinate is missing"
        yield from within("number of vertices", len(zone.data) // 2, 3, MAX_VERTICES)
        coordinates = zone.data
    else:
        yield f"there is no shape {zone.shape}"
    for coordinate in coordinates:
        yield from within("coordinate", coordinate, -MAX_COORDINATE, MAX_COORDINATE)
