"""Canonical integers in the words of the language."""

from collections.abc import Sequence
from itertools import pairwise
from math import atan2, degrees, isqrt
from typing import TYPE_CHECKING, NamedTuple

from rtshcua.decision.nearest import DAYTIME, Nearest
from rtshcua.decision.outline import rings as outline
from rtshcua.model.decision import Decisive
from rtshcua.model.flat.contract import CHOICE, PLACE, ZONE, Contract, Link, MotionKind, Parameter, SourceKind
from rtshcua.model.flat.mission import Invocation, Plan
from rtshcua.model.flat.policy import Monitor, MonitorKind, Policy
from rtshcua.model.flat.signal import ENUMERATION, POSITION
from rtshcua.model.flat.zone import AREA, CIRCLE, HIGHEST, LOWEST, Zone
from rtshcua.model.quantity import Dimension, display
from rtshcua.onboard.calls import argument, is_own
from rtshcua.onboard.calls import arguments as arguments
from rtshcua.onboard.calls import call as call
from rtshcua.onboard.calls import geographic as geographic
from rtshcua.onboard.calls import place as place
from rtshcua.onboard.calls import quantity as quantity

if TYPE_CHECKING:  # a run, which uses other words, loads nothing of the ground
    from rtshcua.ground.why.trace import ReadValue

_MINUTE = 60_000_000
_MOTIONS = {
    MotionKind.HOLD: "hold",
    MotionKind.CLIMB: "climb straight up",
    MotionKind.FLY: "fly to a point",
    MotionKind.COVER: "cover a zone",
    MotionKind.HOME: "return home and land",
    MotionKind.LAND: "land",
}


def length(mm: int) -> str:
    """A length."""
    return display(mm, Dimension.LENGTH)


def duration(us: int) -> str:
    """A duration."""
    return display(us, Dimension.DURATION)


def speed(mm_s: int) -> str:
    """A speed."""
    return display(mm_s, Dimension.SPEED)


def ratio(parts: int) -> str:
    """A ratio."""
    return display(parts, Dimension.RATIO)


def step(policy: Policy, one: Invocation) -> str:
    """A step as its skill and arguments are bound, in nobody's words but ours and the policy's; zones by name, size and
    way from home, places by their way from home. Who signed the mission chose the path in a zone: how far it leads is
    told too.
    """
    parts = step_parts(policy, one)
    told = (f"{name} = {value}{f' [{where}]' if where else ''}" for name, value, where in parts.arguments)
    return f"{parts.skill}({', '.join(told)}){f' {parts.path}' if parts.path else ''}"


class StepParts(NamedTuple):
    """A step in words: its skill; the name, value and place of each argument as it is bound (empty: it is no place);
    and how far its path in a zone leads.
    """

    skill: str
    arguments: tuple[tuple[str, str, str], ...]
    path: str


def step_parts(policy: Policy, one: Invocation) -> StepParts:
    """The parts of `step`."""
    contract = policy.contracts[one.skill]
    told = [
        (each.name, argument(policy, each, one.arguments), _where(policy, each, one.arguments))
        for each in contract.parameters
    ]
    covers = f"along {_path(one.plan.path)}" if one.plan.kind == MotionKind.COVER else ""
    return StepParts(contract.name, tuple(told), covers)


def quoted(policy: Policy, one: Invocation, clause: Decisive) -> str:
    """What decided, in the words of whoever wrote it; those of a step's own clause are no more than that."""
    text = "" if clause is None else f"`{' '.join(clause.text.split())}`"
    return f"{text}, in the mission's own words" if is_own(policy, one, clause) else text


def _path(path: Sequence[int]) -> str:
    points = list(zip(path[::2], path[1::2], strict=True))
    far = sum(isqrt((x - before_x) ** 2 + (y - before_y) ** 2) for (before_x, before_y), (x, y) in pairwise(points))
    return f"{len(points)} points, {_metres(far)} in all"


def _where(policy: Policy, parameter: Parameter, cells: Sequence[int]) -> str:
    value = cells[parameter.cell]
    if parameter.kind == PLACE:
        return _from_home(value, cells[parameter.cell + 1])
    if parameter.kind != ZONE or not parameter.low <= value <= parameter.high:
        return ""
    one = policy.zones[value]
    if one.shape == CIRCLE:
        x, y, squared = one.data
        return f"radius {_metres(isqrt(squared))}, its middle {_from_home(x, y)}"
    corners = [corner for ring in outline(one) for corner in ring]
    (west, east), (south, north) = ((min(each), max(each)) for each in zip(*corners, strict=True))
    size = f"{_metres(east - west)} from west to east by {_metres(north - south)}"
    return f"{size}, its middle {_from_home((west + east) // 2, (south + north) // 2)}"


def _metres(mm: int) -> str:
    """A length as a person compares it: to 0.1 m."""
    return f"{mm / 1000:.1f} m"


def _from_home(x: int, y: int) -> str:
    """The way from the declared home to a place in local mm; the bearing in degrees from true north, clockwise."""
    far = isqrt(x * x + y * y)
    return f"{_metres(far)} from home, bearing {round(degrees(atan2(x, y))) % 360}°" if far else "at home"


def parameter(policy: Policy, one: Parameter) -> str:
    """A parameter with its range."""
    if one.kind == CHOICE:
        return f"{one.name}: one of {', '.join(one.labels[one.low : one.high + 1])}"
    if one.kind == ZONE:
        return f"{one.name}: zone, one of {', '.join(zone.name for zone in policy.zones[one.low : one.high + 1])}"
    if one.kind == PLACE:
        return f"{one.name}: position"
    return f"{one.name}: {one.dimension} in {quantity(one.low, one.dimension)} .. {quantity(one.high, one.dimension)}"


def link(policy: Policy, one: Link) -> str:
    """A link with its arguments and its time."""
    contract = policy.contracts[one.skill]
    limit = f" for at most {duration(one.limit_us)}" if one.limit_us else ""
    return f"{contract.name}({arguments(policy, contract.parameters, one.arguments)}){limit}"


def motion(contract: Contract) -> str:
    """Where a skill takes the vehicle."""
    return _MOTIONS[MotionKind(contract.motion.kind)]


def plan(policy: Policy, one: Plan) -> str:
    """Where a step takes the vehicle."""
    points = list(zip(one.path[::2], one.path[1::2], strict=True))
    parts = [_MOTIONS[MotionKind(one.kind)]]
    if len(points) == 1:
        parts.append(f"at {place(policy, *points[0])}")
    elif points:
        parts.append(f"along {len(points)} points from {place(policy, *points[0])} to {place(policy, *points[-1])}")
    if one.heights:
        levels = len(set(one.heights))
        parts.append(f"at {levels} heights from {length(one.lowest)} to {length(max(one.heights))} above home")
    elif one.altitude:
        parts.append(f"{length(one.altitude)} above home")
    if one.headings:
        parts.append("facing inward")
    if one.kind in (MotionKind.FLY, MotionKind.COVER):
        parts.append(f"at {speed(one.speed)}" if one.speed else "at the vehicle's own speed")
    return ", ".join(parts)


def zone(policy: Policy, one: Zone) -> str:
    """A zone's shape and height."""
    if one.shape == CIRCLE:
        x, y, squared = one.data
        shape = f"circle of {length(round(squared**0.5))} around {place(policy, x, y)}"
    else:
        first = next(outline(one))[0]
        count = sum(len(ring) for ring in outline(one))
        several = f" in {one.data[0]} rings" if one.shape == AREA else ""
        shape = f"polygon of {count} corners{several}, the first at {place(policy, *first)}"
    floor = "no floor" if one.floor == LOWEST else f"floor {length(one.floor)}"
    ceiling = "no ceiling" if one.ceiling == HIGHEST else f"ceiling {length(one.ceiling)} above home"
    return f"{shape}; {floor}, {ceiling}"


def source(kind: int) -> str:
    """A source of decisions."""
    return SourceKind(kind).name.lower()


def monitor(monitor: Monitor) -> str:
    """What a temporal monitor looks at, and how far back."""
    match monitor.kind:
        case MonitorKind.FOR_LAST:
            return f"`{monitor.when.text}` for the last {duration(monitor.window_us)}"
        case MonitorKind.WITHIN_LAST:
            return f"`{monitor.when.text}` within the last {duration(monitor.window_us)}"
        case MonitorKind.RISING:
            return f"rising `{monitor.when.text}`"
        case _:
            return f"falling `{monitor.when.text}`"


def read_value(policy: Policy, read: "ReadValue") -> str:
    """The value of a signal that a decision read."""
    assert read.signal is not None
    known = [value for value in read.values if value is not None]
    if len(known) < len(read.values):
        told = "unknown"
    elif read.signal.kind == POSITION:
        told = place(policy, known[0], known[1])
    elif read.signal.kind == ENUMERATION:
        told = dict(read.signal.labels).get(known[0], str(known[0]))
    else:
        told = quantity(known[0], read.signal.dimension)
    return f"{told}{' (stale)' if read.stale else ''}"


def would_pass(nearest: Nearest) -> str:
    """What a subject should be."""
    return f"{nearest.subject} = {nearest_value(nearest)}"


def nearest_value(nearest: Nearest) -> str:
    """The value that would pass."""
    if nearest.choices:
        return " or ".join(nearest.choices)
    if nearest.dimension == DAYTIME:
        minutes = nearest.value // _MINUTE
        return f"{minutes // 60:02}:{minutes % 60:02}"
    return quantity(nearest.value, nearest.dimension)
