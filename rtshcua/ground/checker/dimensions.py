"""What dimensions make of each other when their numbers are multiplied and divided."""

from collections.abc import Mapping

from rtshcua.ground.checker.types import COUNT, DURATION, LENGTH, RATIO, SPEED, Type
from rtshcua.model.quantity import Dimension

#: how many canonical units make the unit that needs no factor in a product: m, m/s, s, degree, the whole, V, one
COHERENT: Mapping[Dimension, int] = {
    Dimension.LENGTH: 1_000,
    Dimension.ALTITUDE: 1_000,
    Dimension.SPEED: 1_000,
    Dimension.DURATION: 1_000_000,
    Dimension.ANGLE: 10_000_000,
    Dimension.RATIO: 10_000,
    Dimension.VOLTAGE: 1_000,
    Dimension.COUNT: 1,
}

_QUOTIENTS: Mapping[tuple[Type, Type], Type] = {(LENGTH, SPEED): DURATION, (LENGTH, DURATION): SPEED}

#: what `*` and `/` can do, for a message
PRODUCTS = "a plain number or a ratio times anything keeps its dimension, and a speed times a duration is a length"
QUOTIENTS = (
    "dividing by a plain number or a ratio keeps the dimension, a length by a speed is a duration, a length by a "
    "duration is a speed, and equal dimensions give a plain number"
)


def product(left: Type, right: Type) -> Type | None:
    """The type of `left * right` for two numbers, or None."""
    for factor in (COUNT, RATIO):
        if left == factor:
            return right
        if right == factor:
            return left
    return LENGTH if {left, right} == {SPEED, DURATION} else None


def quotient(left: Type, right: Type) -> Type | None:
    """The type of `left / right` for two numbers, or None."""
    if left == right:
        return COUNT
    if right in (COUNT, RATIO):
        return left
    return _QUOTIENTS.get((left, right))
