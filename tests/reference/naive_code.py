"""A naive interpreter of conditions over sets of situations, independent of `evaluate`.

Truths are the letters T, F and U; the possible truths of a condition are a set. A single value is a set of one.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

from reference.naive_geometry import circle_far, circle_near, in_shape, touches, widened
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.policy import Policy, VehicleLimits
from rtshcua.model.flat.zone import CIRCLE, HIGHEST, LOWEST, Zone

DAY = 24 * 3600 * 1_000_000
Truths = frozenset[str]
T, F, U = frozenset("T"), frozenset("F"), frozenset("U")

Point = tuple[int, int]
#: widened legs (a, b, box) between two heights; a is None for an unknown place, and so are unknown heights
Leg = tuple[Point | None, Point | None, tuple[int, int, int, int], int | None, int | None]


class TooNear(Exception):
    """A circle is passed so near that rounding may matter; the test should use another case."""


@dataclass
class World:
    """Slots (None: missing), argument cells, the moment, and the legs of where the vehicle is. A letter
    for each temporal monitor, and the number of the phase among the policy's."""

    policy: Policy
    slots: list[int | None]
    arguments: tuple[int, ...]
    utc: int
    error: int
    legs: list[Leg]
    heights: tuple[int, int] | None = None  # of the legs, where the height ranges over them
    monitors: str = ""
    phase: int = -1
    through: int = 0  # zones are evaluated from the moment to this much later


def kleene_and(a: str, b: str) -> str:
    return "F" if "F" in (a, b) else "U" if "U" in (a, b) else "T"


def kleene_or(a: str, b: str) -> str:
    return "T" if "T" in (a, b) else "U" if "U" in (a, b) else "F"


Number = tuple[int, int] | None


def truths(code: tuple[int, ...], world: World) -> Truths:
    """Run the code on a stack of truths and numbers: `(c, k)` is c times the height plus k, None is missing."""
    stack: list = []
    for op, a, b in zip(code[::3], code[1::3], code[2::3], strict=True):
        if op in (Op.ADD, Op.SUB, *RELATIONS, Op.AND, Op.OR):
            right, left = stack.pop(), stack.pop()
            stack.append(joined(op, left, right, world))
        elif op == Op.SCALE:
            value = stack.pop()
            stack.append(None if value is None else (value[0] * a, value[1] * a))
        elif op == Op.NOT:
            stack.append(frozenset({"T": "F", "F": "T", "U": "U"}[x] for x in stack.pop()))
        else:
            stack.append(number(op, a, world) if op in (Op.CONST, Op.SIGNAL, Op.ARGUMENT) else atom(op, a, b, world))
    (answer,) = stack
    return answer


def joined(op: int, left: object, right: object, world: World) -> object:
    """The result of an instruction on two numbers or two truths."""
    if op in (Op.AND, Op.OR):
        table = kleene_and if op == Op.AND else kleene_or
        return frozenset(table(x, y) for x, y in product(left, right))
    if left is None or right is None:
        return None if op in (Op.ADD, Op.SUB) else U
    if op in RELATIONS:
        return compared(op, left, right, world.heights or (0, 0))
    sign = 1 if op == Op.ADD else -1
    return (left[0] + sign * right[0], left[1] + sign * right[1])


def number(op: int, a: int, world: World) -> Number:
    if op == Op.CONST:
        return 0, a
    return (0, world.arguments[a]) if op == Op.ARGUMENT else number_of(a, world)


def atom(op: int, a: int, b: int, world: World) -> Truths:
    policy = world.policy
    match op:
        case Op.SIGNAL_IN:
            value = world.slots[a]
            return U if value is None else T if value in policy.sets[b] else F
        case Op.KNOWN:
            return U if world.slots[a] is None else T
        case Op.ARGUMENT_IN:
            return T if world.arguments[a] in policy.sets[b] else F
        case Op.POSITION_IN:
            return inside(world, policy.zones[a])
        case Op.POSITION_IN_ARGUMENT:
            return inside(world, policy.zones[policy.tables[b][world.arguments[a]]])
        case Op.ARGUMENT_POINT_IN:
            within = T if in_shape((world.arguments[a], world.arguments[a + 1]), policy.zones[b]) else F
            return both(within, exists(world, policy.zones[b]))
        case Op.PHASE_IN:
            return T if world.phase in policy.sets[b] else F
        case Op.MONITOR:
            return frozenset(world.monitors[a])
        case Op.TIME_IN:
            if policy.vehicle.offsets:
                windows = (a, b + 1) if a <= b < DAY else (a, DAY) if b == DAY else (0, b + 1, a, DAY)
                return on_the_wall(world.utc, world.error, policy.vehicle, windows, DAY)
            return daytime(world.utc, world.error, policy.vehicle.utc_offset_us, a, b)
        case Op.WEEK_IN:
            return on_the_wall(world.utc, world.error, policy.vehicle, policy.sets[a], 7 * DAY)
        case _:
            raise AssertionError(op)


def number_of(slot: int, world: World) -> tuple[int, int] | None:
    if slot == world.policy.vehicle.height and world.heights is not None:
        return 1, 0
    value = world.slots[slot]
    return None if value is None else (0, value)


RELATIONS: dict[int, Callable[[int, int], bool]] = {
    Op.LT: lambda x, y: x < y,
    Op.LE: lambda x, y: x <= y,
    Op.GT: lambda x, y: x > y,
    Op.GE: lambda x, y: x >= y,
    Op.EQ: lambda x, y: x == y,
    Op.NE: lambda x, y: x != y,
}


def compared(op: int, left: tuple[int, int], right: tuple[int, int], heights: tuple[int, int]) -> Truths:
    """The relation at the lowest and the highest height, and where the difference is 0 in between."""
    differences = [(left[0] - right[0]) * height + left[1] - right[1] for height in heights]
    if min(differences) < 0 < max(differences):
        differences.append(0)
    return frozenset("T" if RELATIONS[op](difference, 0) else "F" for difference in differences)


def inside(world: World, zone: Zone) -> Truths:
    """Inside is between floor and ceiling, and within the outline: each by itself may be unknown."""
    found: set[str] = set()
    for a, b, box, low, high in world.legs:
        if (zone.floor, zone.ceiling) == (LOWEST, HIGHEST):
            vertical = {"T"}
        elif low is None or high is None:
            vertical = {"U"}
        else:
            vertical = {"T" if zone.floor < z < zone.ceiling else "F" for z in (low, high)}
            if low <= zone.floor and high >= zone.ceiling and zone.ceiling - zone.floor > 1:
                vertical.add("T")
        if vertical == {"F"}:
            found.add("F")
            continue
        flat = U if a is None or b is None else horizontal(a, b, box, zone)
        found |= {kleene_and(v, h) for v, h in product(vertical, flat)}
    return both(frozenset(found), exists(world, zone))


def both(left: Truths, right: Truths) -> Truths:
    return frozenset(kleene_and(x, y) for x, y in product(left, right))


def exists(world: World, zone: Zone) -> Truths:
    """Whether the zone exists at each moment of the interval: in its hours, and between its dates."""
    first, error, offset = world.utc, world.error, world.policy.vehicle.utc_offset_us
    hours: set[str] = set()
    dates: set[str] = set()
    turns = (0, 1, -1, error, error + 1, -error, -error - 1)
    for boundary in (*zone.daily, *zone.dates, first):
        for moment in {boundary + turn for turn in turns} | {boundary - offset + turn for turn in turns}:
            same_time = first + (moment - first) % DAY
            for at in (first, first + world.through, moment, same_time):
                if first <= at <= first + world.through:
                    hours |= daytime(at, error, offset, *zone.daily) if zone.daily else T
                    dates |= between(at, error, *zone.dates) if zone.dates else T
    return both(frozenset(hours), frozenset(dates))


def between(utc: int, error: int, start: int, end: int) -> Truths:
    if start <= utc - error and utc + error <= end:
        return T
    return F if utc + error < start or utc - error > end else U


def horizontal(a: tuple[int, int], b: tuple[int, int], box: tuple[int, int, int, int], zone: Zone) -> Truths:
    if a == b and box == (0, 0, 0, 0):
        return T if in_shape(a, zone) else F
    outline = widened(a, b, box)
    if zone.shape != CIRCLE:
        return T | F if touches(outline, zone) else T if in_shape(a, zone) else F
    if circle_far(outline, zone) < zone.data[2]:
        return T
    reach = (max(-box[0], box[2]) ** 2 + max(-box[1], box[3]) ** 2) ** 0.5
    clear = float(circle_near(widened(a, b, (0, 0, 0, 0)), zone)) ** 0.5 - zone.data[2] ** 0.5 - reach
    if abs(clear) < 5:
        raise TooNear
    return F if clear > 0 else T | F


def daytime(utc: int, error: int, offset: int, start: int, end: int) -> Truths:
    """Evaluate the moment and each nearby boundary of the window that the error may reach."""
    end = min(end, DAY - 1)

    def within(moment: int) -> bool:
        time = (moment + offset) % DAY
        return start <= time <= end if start <= end else time >= start or time <= end

    first, last = utc - error, utc + error
    looked = {within(first), within(last)}
    for boundary in (start - 1, start, end, end + 1):
        next_one = first + (boundary - offset - first) % DAY
        if next_one <= last:
            looked.add(within(next_one))
    return U if len(looked) == 2 else T if True in looked else F


def on_the_wall(utc: int, error: int, vehicle: VehicleLimits, windows: tuple[int, ...], period: int) -> Truths:
    """The local time at both ends of our clock's interval, and at each change in between."""
    edges = {each % period for each in windows}

    def offset(moment: int) -> int | None:
        if not vehicle.offsets:
            return vehicle.utc_offset_us
        if not vehicle.offsets[0] <= moment < vehicle.offsets[-1]:
            return None
        return [of for since, of in zip(vehicle.offsets[::2], vehicle.offsets[1::2], strict=False) if since <= moment][
            -1
        ]

    def shown(moment: int) -> str:
        of = offset(moment)
        if of is None:
            return "U"
        time = (moment + of + 3 * DAY) % period
        pairs = zip(windows[::2], windows[1::2], strict=True)
        return "T" if any(start <= time < end for start, end in pairs) else "F"

    first, last = utc - error, utc + error
    looked = {first, last, *(each for each in vehicle.offsets[::2] if first <= each <= last)}
    for of in {offset(each) for each in looked} - {None}:
        for edge in edges:
            at = first + (edge - of - 3 * DAY - first) % period
            looked |= set(range(at, last + 1, period))
    answers = {shown(each) for each in looked}
    return frozenset(answers) if len(answers) == 1 else U
