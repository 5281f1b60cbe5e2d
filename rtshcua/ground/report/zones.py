"""The zones of a policy, and those that its rules grow out of them, exactly as they are signed."""

from collections.abc import Iterator

from rtshcua.decision.outline import rings
from rtshcua.ground.lower.zones import derived_name
from rtshcua.ground.report.model import Ground, PlaceTold, ZoneTold
from rtshcua.ground.report.subject import Subject, within
from rtshcua.ground.report.words.places import places_of, told_band, told_shape, told_times
from rtshcua.ground.report.words.values import degrees
from rtshcua.model.flat.zone import CIRCLE, HIGHEST, LOWEST, Zone, project, unproject
from rtshcua.model.ir.expression import Grow, Quantity
from rtshcua.model.ir.places import Combination, GeoJson, Shape, ZoneDecl
from rtshcua.model.quantity import Dimension, display

ALLOWED, FORBIDDEN, OTHER = "allowed", "forbidden", ""


def zones(subject: Subject, changed: frozenset[str]) -> tuple[ZoneTold, ...]:
    """The declared zones in their order, then those that rules derive."""
    policy = subject.policy
    told = [_declared(subject, zone, changed) for zone in policy.zones[: policy.declared]]
    grown = _grown(subject)
    seen: set[str] = set()
    for zone in policy.zones[policy.declared :]:
        if zone.name in grown and zone.name not in seen:
            seen.add(zone.name)
            told.append(_derived(zone, grown[zone.name]))
    return tuple(told)


def ground_of(zone: Zone) -> Ground:
    """The outline of a flat zone."""
    if zone.shape == CIRCLE:
        x, y, squared = zone.data
        return Ground(centre=(x, y), radius_squared=squared)
    return Ground(rings=tuple(rings(zone)))


def _declared(subject: Subject, zone: Zone, changed: frozenset[str]) -> ZoneTold:
    declared = subject.symbols.zones[zone.name]
    return ZoneTold(
        name=zone.name,
        note=subject.note(declared),
        use=_use(subject, zone.name),
        shape=told_shape(declared.shape),
        band=told_band(declared),
        times=told_times(declared),
        ground=ground_of(zone),
        floor=None if zone.floor == LOWEST else zone.floor,
        ceiling=None if zone.ceiling == HIGHEST else zone.ceiling,
        places=tuple(_places(subject, declared, zone)),
        place=subject.place(declared.span),
        changed=zone.name in changed,
    )


def _derived(zone: Zone, grow: Grow) -> ZoneTold:
    margin = grow.margin.value if isinstance(grow.margin, Quantity) else 0
    length = display(abs(margin), Dimension.LENGTH)
    way = f"nearer than {length} to" if margin >= 0 else f"further than {length} inside of"
    return ZoneTold(
        name=zone.name,
        note="",
        use=OTHER,
        shape=f"all places {way} `{grow.zone.name}`",
        band=f"as `{grow.zone.name}`",
        times=f"as `{grow.zone.name}`",
        ground=ground_of(zone),
        floor=None if zone.floor == LOWEST else zone.floor,
        ceiling=None if zone.ceiling == HIGHEST else zone.ceiling,
        places=(),
        place="",
        changed=False,
        derived=True,
    )


def _use(subject: Subject, name: str) -> str:
    airspace = subject.lowered.declaration.airspace
    if airspace is None:
        return OTHER
    if name in {each.text for each in airspace.outside}:
        return FORBIDDEN
    return ALLOWED if name in {each.text for each in airspace.inside} else OTHER


def _grown(subject: Subject) -> dict[str, Grow]:
    """The zones that rules grow, by the name that they have in what is signed."""
    found = {}
    for rule in subject.rules:
        for node in within(rule.when):
            if isinstance(node, Grow) and isinstance(node.margin, Quantity):
                found[derived_name(node.zone.name, node.margin.value, smaller=False)] = node
    return found


def _places(subject: Subject, declared: ZoneDecl, zone: Zone) -> Iterator[PlaceTold]:
    """The places that a zone is written by, its entry, and of an outline from a file every corner."""
    projection = subject.policy.projection
    written = list(places_of(declared.shape))
    if declared.entry is not None:
        written.append(("entry", declared.entry))
    for what, at in written:
        x, y = project(projection, at.latitude, at.longitude)
        yield _place(what, at.latitude, at.longitude, x, y)
    if _from_file(declared.shape):
        for number, ring in enumerate(ground_of(zone).rings, 1):
            for corner, (x, y) in enumerate(ring, 1):
                yield _place(f"ring {number}, corner {corner}", *unproject(projection, x, y), x, y)


def _from_file(shape: Shape) -> bool:
    """Whether no place of a shape, or of a part of it, is written in a source."""
    if isinstance(shape, Combination):
        return any(map(_from_file, shape.shapes))
    return isinstance(shape, GeoJson)


def _place(what: str, latitude: int, longitude: int, x: int, y: int) -> PlaceTold:
    return PlaceTold(what, degrees(latitude, "N", "S"), degrees(longitude, "E", "W"), x, y)
