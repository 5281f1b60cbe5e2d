"""Numbers as they are written, made whole in the canonical unit of their dimension; never through a float."""

from enum import Enum
from functools import lru_cache
from typing import NamedTuple

from rtshcua.model.quantity import UNITS, Dimension, Unit

LIMIT = 2**63 - 1

PLAIN = Unit(Dimension.COUNT, 1)
DEGREE = UNITS["deg"]

#: What canonical units are called in the plural; a count has none.
CANONICAL: dict[Dimension, str] = {
    Dimension.LENGTH: "mm",
    Dimension.SPEED: "mm/s",
    Dimension.DURATION: "us",
    Dimension.ANGLE: "steps of 1e-7 degree",
    Dimension.RATIO: "hundredths of 1 %",
    Dimension.VOLTAGE: "mV",
    Dimension.COUNT: "",
}

_DIGITS = 40  # more than any quantity has; keeps a text of a million digits from being computed


class Trouble(Enum):
    """Why a number has no exact value."""

    UNKNOWN_UNIT = "unknown unit"
    NOT_EXACT = "not exact"
    OUT_OF_BOUNDS = "out of bounds"


class Exact(NamedTuple):
    """`value` in canonical units; where `trouble` is `NOT_EXACT`, the whole number nearest to what was written."""

    value: int
    dimension: Dimension
    trouble: Trouble | None


@lru_cache(maxsize=4096)
def exact(number: str, unit: str | None, negative: bool = False) -> Exact:
    """The value of `number` (digits, perhaps `_` and one `.`) in `unit`; no unit is a plain count."""
    known = PLAIN if unit is None else UNITS.get(unit)
    if known is None:
        return Exact(0, Dimension.COUNT, Trouble.UNKNOWN_UNIT)
    whole, _, fraction = number.replace("_", "").partition(".")
    fraction = fraction.rstrip("0")
    whole = whole.lstrip("0")
    if len(whole) > _DIGITS:
        return Exact(0, known.dimension, Trouble.OUT_OF_BOUNDS)
    trouble = Trouble.NOT_EXACT if len(fraction) > _DIGITS else None
    fraction = fraction[:_DIGITS]
    numerator = int(whole + fraction or "0") * known.numerator
    denominator = 10 ** len(fraction) * known.denominator
    value, rest = divmod(numerator, denominator)
    if rest:
        value += 2 * rest >= denominator
        trouble = Trouble.NOT_EXACT
    if value > LIMIT:
        trouble = Trouble.OUT_OF_BOUNDS
    return Exact(-value if negative else value, known.dimension, trouble)
