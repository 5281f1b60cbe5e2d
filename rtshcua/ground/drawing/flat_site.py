"""What a drawing shows of a bundle alone: the site of a flat policy, and the way of a flat mission."""

from math import isqrt
from typing import Final

from rtshcua.decision.outline import rings
from rtshcua.ground.drawing.drawn_site import FlightMargins, PlannedStep, PlannedWay, Site, ZoneOutline, ZoneView
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import CIRCLE, HIGHEST, LOWEST, Zone
from rtshcua.model.quantity import Dimension, display

#: uses of a zone in the airspace
ALLOWED: Final = "allowed"
FORBIDDEN: Final = "forbidden"
OTHER: Final = ""


def site_of(policy: Policy, elevation: int | None = None) -> Site:
    """The site of a policy. A bundle has no `elevation` of home (mm above mean sea level): sources or telemetry do.

    Of the zones that the compiler derived, those are shown that a rule grows from another zone.
    """
    inside, outside = ((), ()) if policy.airspace is None else (policy.airspace.inside, policy.airspace.outside)
    uses = {declared_name(policy.zones[number].name): ALLOWED for number in inside}
    uses |= {declared_name(policy.zones[number].name): FORBIDDEN for number in outside}
    zones = [_view(zone, uses.get(zone.name, OTHER), derived=False) for zone in policy.zones[: policy.declared]]
    grown = {policy.zones[number].name: policy.zones[number] for number in sorted(_in_rules(policy))}
    zones += [_view(zone, OTHER, derived=True) for name, zone in grown.items() if name.startswith("grow(")]
    return Site(
        policy.name,
        tuple(zones),
        (0, 0),
        policy.vehicle.home_within,
        policy.vehicle.return_altitude,
        elevation,
        margins_of(policy),
    )


def declared_name(name: str) -> str:
    """The name of the declared zone of a zone of an airspace, which may be its sure or possible part: the compiler
    derives these where the elevation of home has an error.
    """
    for part in ("surely(", "possibly("):
        if name.startswith(part) and name.endswith(")"):
            return name[len(part) : -1]
    return name


def _in_rules(policy: Policy) -> set[int]:
    """The indexes of the derived zones that the conditions of rules read."""
    clauses = [rule.when for rule in policy.rules if rule.when is not None]
    found = set()
    for clause in (*clauses, *(monitor.when for monitor in policy.monitors)):
        for op, a, b in zip(clause.code[::3], clause.code[1::3], clause.code[2::3], strict=True):
            number = a if op == Op.POSITION_IN else b if op == Op.ARGUMENT_POINT_IN else -1
            if number >= policy.declared:
                found.add(number)
    return found


def margins_of(policy: Policy) -> FlightMargins:
    """The margins of the vehicle of a policy."""
    vehicle = policy.vehicle
    return FlightMargins(vehicle.position_error, vehicle.speed, vehicle.braking, vehicle.reaction_us)


def way_of(mission: Mission) -> PlannedWay:
    """The way of a mission."""
    return PlannedWay(
        mission.name,
        tuple(
            PlannedStep(
                each.step + 1,
                places(each.plan.path),
                MotionKind(each.plan.kind),
                each.plan.altitude,
                each.plan.speed,
                each.plan.heights,
            )
            for each in mission.invocations
        ),
    )


def places(path: tuple[int, ...]) -> tuple[tuple[int, int], ...]:
    """The places of the path of a flat plan."""
    return tuple(zip(path[::2], path[1::2], strict=True))


def ground_of(zone: Zone) -> ZoneOutline:
    """The outline of a flat zone."""
    if zone.shape == CIRCLE:
        x, y, squared = zone.data
        return ZoneOutline(centre=(x, y), radius_squared=squared)
    return ZoneOutline(rings=tuple(rings(zone)))


def limits_of(zone: Zone) -> tuple[int | None, int | None]:
    """The floor and the ceiling of a flat zone, mm above home, None where it has none."""
    return None if zone.floor == LOWEST else zone.floor, None if zone.ceiling == HIGHEST else zone.ceiling


def is_timed(zone: Zone) -> bool:
    """Whether a flat zone exists only at some times."""
    return bool(zone.daily or zone.weekly or zone.dates)


def told_band(floor: int | None, ceiling: int | None) -> str:
    """The heights of a zone in words, with their datum."""
    low, high = ("" if each is None else display(each, Dimension.LENGTH) for each in (floor, ceiling))
    if low and high:
        return f"{low} to {high} above home"
    return f"from {low} above home" if low else f"up to {high} above home" if high else "at every height"


def _view(zone: Zone, use: str, *, derived: bool) -> ZoneView:
    ground, (floor, ceiling) = ground_of(zone), limits_of(zone)
    if ground.centre is not None:
        shape = f"circle of radius {display(isqrt(ground.radius_squared), Dimension.LENGTH)}"
    else:
        shape = f"outline with {sum(map(len, ground.rings))} corners"
    return ZoneView(
        name=zone.name,
        note="",
        use=use,
        shape=shape,
        band=told_band(floor, ceiling),
        times="at some times" if is_timed(zone) else "always",
        ground=ground,
        floor=floor,
        ceiling=ceiling,
        places=(),
        place="",
        changed=False,
        derived=derived,
        timed=is_timed(zone),
    )
