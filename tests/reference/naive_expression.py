"""The meaning of a condition by definition: evaluated on the IR, over a history of observations, in fractions.

Independent of the lowering: no linear forms, code or integers. A number is the interval of its possible values,
where a missing signal can be anything; a comparison is decided if all values give one result. Truths are T, F, U.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from rtshcua.model.ir import expression as ir
from rtshcua.model.quantity import Dimension

MAX_GAP = 1_000_000
DAY = 24 * 3600 * 1_000_000

#: canonical units in the SI unit (degree, the whole, one)
SI = {
    Dimension.LENGTH: 1000,
    Dimension.ALTITUDE: 1000,
    Dimension.SPEED: 1000,
    Dimension.DURATION: 10**6,
    Dimension.ANGLE: 10**7,
    Dimension.RATIO: 10**4,
    Dimension.COUNT: 1,
}


@dataclass(frozen=True)
class World:
    """One observation: canonical numbers, ordinals of enumerations and the place by name (None: missing)."""

    at_us: int
    numbers: Mapping[str, int | None]
    ordinals: Mapping[str, int | None]
    position: tuple[int, int] | None
    utc_us: int


@dataclass(frozen=True)
class Names:
    """The meaning of names: dimensions of numbers, members of enumerations, circles (x, y, radius)."""

    dimensions: Mapping[str, Dimension]
    enumerations: Mapping[str, Mapping[str, int]]
    circles: Mapping[str, tuple[int, int, int]]


ANYTHING = (None, None)  # no lower end, no upper end
Interval = tuple[Fraction | None, Fraction | None]


def truth(node: ir.Condition, history: Sequence[World], names: Names, phase: str | None) -> str:
    """The truth of a condition at the last observation of a history."""
    now = history[-1]
    match node:
        case ir.Comparison(left=ir.Reference(name="phase"), right=ir.Reference(name=asked)):
            return "T" if (phase == asked) == (node.operator == "==") else "F"
        case ir.OneOf(subject=ir.Reference(name="phase")):
            return "T" if phase in [name.text for name in node.names] else "F"
        case ir.Comparison():
            return comparison(node, now, names)
        case ir.Within():
            return within(node, now, names)
        case ir.OneOf(subject=ir.Reference(name=name)):
            ordinal = now.ordinals[name]
            members = [names.enumerations[name][each.text] for each in node.names]
            return "U" if ordinal is None else "T" if ordinal in members else "F"
        case ir.Inside(region=ir.Reference(name=name)):
            found = inside(now.position, names.circles[name])
            return NOT[found] if node.negated else found
        case ir.Not():
            return NOT[truth(node.operand, history, names, phase)]
        case ir.Junction():
            found_ = [truth(each, history, names, phase) for each in node.operands]
            return least(found_) if node.operator == "and" else greatest(found_)
        case ir.ForLast():
            return least(seen(node.operand, node.window.value, history, names))
        case ir.WithinLast():
            return greatest(seen(node.operand, node.window.value, history, names))
        case ir.Near():
            a, b = (truth(each, history, names, phase) for each in (node.left, node.right))
            once = [greatest(seen(each, node.window.value, history, names)) for each in (node.left, node.right)]
            return greatest([least([a, once[1]]), least([b, once[0]])])
        case ir.Edge():
            before = truth(node.operand, history[:-1], names, None) if len(history) > 1 else "U"
            after = truth(node.operand, history, names, None)
            return least([NOT[before], after] if node.rising else [before, NOT[after]])
        case _:
            raise AssertionError(node)


NOT = {"T": "F", "F": "T", "U": "U"}


def least(truths: Sequence[str]) -> str:
    """The minimum in the order F < U < T."""
    return "F" if "F" in truths else "U" if "U" in truths else "T"


def greatest(truths: Sequence[str]) -> str:
    """The maximum in the order F < U < T."""
    return "T" if "T" in truths else "U" if "U" in truths else "F"


def seen(node: ir.Condition, window: int, history: Sequence[World], names: Names) -> list[str]:
    """Every truth that the step function of a condition has in the window that ends now."""
    end = history[-1].at_us
    start = end - window
    found = ["U"] if start < history[0].at_us else []
    for number, world in enumerate(history):
        value = truth(node, history[: number + 1], names, None)
        if start <= world.at_us:
            found.append(value)
        if number + 1 < len(history):
            following = history[number + 1].at_us
            if following - world.at_us > 1 and start < following:  # a moment lies between, and in the window
                found.append(value if following - world.at_us <= MAX_GAP else "U")
    return found


def comparison(node: ir.Comparison, world: World, names: Names) -> str:
    """Of an enumeration with a member, or of two numbers."""
    for subject, member, operator in ((node.left, node.right, node.operator), (node.right, node.left, node.operator)):
        if isinstance(subject, ir.Reference) and subject.name in names.enumerations:
            assert isinstance(member, ir.Reference)
            ordinal, bound = world.ordinals[subject.name], names.enumerations[subject.name][member.name]
            if ordinal is None:
                return "U"
            point, limit = (Fraction(ordinal),) * 2, (Fraction(bound),) * 2
            return compared(operator, point, limit) if subject is node.left else compared(operator, limit, point)
    return compared(node.operator, number(node.left, world, names), number(node.right, world, names))


def within(node: ir.Within, world: World, names: Names) -> str:
    """Of a time of day, of an enumeration, or of a number in a range; both ends belong to it."""
    low, high, subject = node.range.low, node.range.high, node.subject
    if isinstance(low, ir.TimeOfDay) and isinstance(high, ir.TimeOfDay):
        time = world.utc_us % DAY
        both = (low.value <= time, time <= high.value)
        return "T" if (all(both) if low.value <= high.value else any(both)) else "F"
    if isinstance(subject, ir.Reference) and subject.name in names.enumerations:
        assert isinstance(low, ir.Reference)
        assert isinstance(high, ir.Reference)
        ordinal, members = world.ordinals[subject.name], names.enumerations[subject.name]
        return "U" if ordinal is None else "T" if members[low.name] <= ordinal <= members[high.name] else "F"
    value = number(subject, world, names)
    return least([compared(">=", value, number(low, world, names)), compared("<=", value, number(high, world, names))])


def inside(position: tuple[int, int] | None, circle: tuple[int, int, int]) -> str:
    """The boundary is outside."""
    if position is None:
        return "U"
    x, y, radius = circle
    return "T" if (position[0] - x) ** 2 + (position[1] - y) ** 2 < radius**2 else "F"


def compared(operator: str, left: Interval, right: Interval) -> str:
    """Whether all, or none, of the differences satisfy the relation to 0."""
    low, high = added(left, opposite(right))
    below = high is not None and high < 0
    above = low is not None and low > 0
    at_most = high is not None and high <= 0
    at_least = low is not None and low >= 0
    zero = at_most and at_least
    holds, fails = {
        "<": (below, at_least),
        "<=": (at_most, above),
        ">": (above, at_most),
        ">=": (at_least, below),
        "==": (zero, below or above),
        "!=": (below or above, zero),
    }[operator]
    return "T" if holds else "F" if fails else "U"


def number(node: ir.Value, world: World, names: Names) -> Interval:
    """The interval of a number, in SI units."""
    match node:
        case ir.Quantity():
            return (Fraction(node.value, SI[node.dimension]),) * 2
        case ir.Reference():
            value = world.numbers[node.name]
            return ANYTHING if value is None else (Fraction(value, SI[names.dimensions[node.name]]),) * 2
        case ir.Function(name="abs"):
            value_ = number(node.operands[0], world, names)
            return largest([value_, opposite(value_)])
        case ir.Function(name="max"):
            return largest([number(each, world, names) for each in node.operands])
        case ir.Function():
            return opposite(largest([opposite(number(each, world, names)) for each in node.operands]))
        case ir.Arithmetic():
            left, right = number(node.left, world, names), number(node.right, world, names)
            if node.operator in "+-":
                return added(left, right if node.operator == "+" else opposite(right))
            if node.operator == "/":
                return times(left, 1 / known(right))
            return times(right, known(left)) if constant(node.left) else times(left, known(right))
        case _:
            raise AssertionError(node)


def constant(node: ir.Value) -> bool:
    """Whether a number is made of literals only."""
    match node:
        case ir.Quantity():
            return True
        case ir.Function():
            return all(map(constant, node.operands))
        case ir.Arithmetic():
            return constant(node.left) and constant(node.right)
        case _:
            return False


def known(value: Interval) -> Fraction:
    """The number of an interval with one number in it."""
    assert value[0] is not None
    assert value[0] == value[1]
    return value[0]


def opposite(value: Interval) -> Interval:
    low, high = value
    return (None if high is None else -high, None if low is None else -low)


def added(left: Interval, right: Interval) -> Interval:
    low = None if left[0] is None or right[0] is None else left[0] + right[0]
    return low, None if left[1] is None or right[1] is None else left[1] + right[1]


def times(value: Interval, factor: Fraction) -> Interval:
    """An unknown number times zero stays unknown."""
    low, high = value if factor >= 0 else opposite(value)
    size = abs(factor)
    return (None if low is None else low * size, None if high is None else high * size)


def largest(values: Sequence[Interval]) -> Interval:
    """The largest of some numbers is at least the largest lower end, and at most the largest upper end."""
    lows = [low for low, _ in values if low is not None]
    highs = [high for _, high in values]
    high = None if None in highs else max(each for each in highs if each is not None)
    return (max(lows) if lows else None, high)
