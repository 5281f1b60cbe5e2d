"""Types of values: numbers with a dimension and a datum, enumerations, zones, positions, times of day."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from functools import cache
from typing import NamedTuple

from rtshcua.diagnostics.span import Span
from rtshcua.model.quantity import Datum, Dimension


class Kind(Enum):
    """The kinds of values; only numbers have a dimension."""

    NUMBER = "number"
    ENUMERATION = "enumeration"
    ZONE = "zone"
    POSITION = "position"
    TIME_OF_DAY = "time of day"
    PHASE = "phase"


@dataclass(frozen=True, slots=True)
class Enumeration:
    """A named set of values: of an `enum` (ordered by value), or of a parameter's `one of` (in no order)."""

    name: str
    members: Mapping[str, int]
    ordered: bool
    declared: Span = field(compare=False)


@dataclass(frozen=True, slots=True)
class Type:  # noqa: PLW1641 - the dataclass makes the hash, of the same parts
    """The type of a value."""

    kind: Kind
    dimension: Dimension | None = None
    datum: Datum | None = None
    enumeration: Enumeration | None = None

    def __eq__(self, other: object) -> bool:
        """Equality as of a dataclass, but with the most distinctive field first: editors check at every keystroke."""
        if self is other:
            return True
        if not isinstance(other, Type):
            return NotImplemented
        same = self.kind is other.kind and self.dimension is other.dimension and self.datum is other.datum
        return same and self.enumeration == other.enumeration

    def describe(self) -> str:
        """The type for a message: `an altitude above home`."""
        if self.kind is Kind.NUMBER:
            return _WORDS[self.dimension] + ("" if self.datum is None else f" above {self.datum.value}")
        if self.kind is Kind.ENUMERATION:
            assert self.enumeration is not None
            return f"a value of `{self.enumeration.name}`"
        return f"a {self.kind.value}"


_WORDS = {
    Dimension.LENGTH: "a length",
    Dimension.ALTITUDE: "an altitude",
    Dimension.SPEED: "a speed",
    Dimension.DURATION: "a duration",
    Dimension.ANGLE: "an angle",
    Dimension.RATIO: "a ratio",
    Dimension.VOLTAGE: "a voltage",
    Dimension.COUNT: "a plain number",
    None: "a number",
}

#: an example literal of each dimension, for helps
EXAMPLES = {
    Dimension.LENGTH: "20 m",
    Dimension.ALTITUDE: "20 m",
    Dimension.SPEED: "5 m/s",
    Dimension.DURATION: "10 s",
    Dimension.ANGLE: "90 deg",
    Dimension.RATIO: "25 %",
    Dimension.VOLTAGE: "14.2 V",
    Dimension.COUNT: "3",
}


@cache
def number(dimension: Dimension, datum: Datum | None = None) -> Type:
    """Return a numeric type; the default datum of an altitude is home."""
    if dimension is Dimension.ALTITUDE and datum is None:
        datum = Datum.HOME
    return Type(Kind.NUMBER, dimension, datum)


LENGTH = number(Dimension.LENGTH)
HEIGHT = number(Dimension.ALTITUDE, Datum.HOME)
SPEED = number(Dimension.SPEED)
DURATION = number(Dimension.DURATION)
COUNT = number(Dimension.COUNT)
RATIO = number(Dimension.RATIO)
VOLTAGE = number(Dimension.VOLTAGE)
ZONE = Type(Kind.ZONE)
POSITION = Type(Kind.POSITION)
TIME_OF_DAY = Type(Kind.TIME_OF_DAY)
MISSION_PHASE = Type(Kind.PHASE)


class Typed(NamedTuple):
    """A value's type and, if constant, its exact value in the canonical unit, which may not be whole."""

    type: Type
    constant: Fraction | None


#: the built-in types by name
NAMED: Mapping[str, Type] = {
    **{dimension.value: number(dimension) for dimension in Dimension},
    "zone": ZONE,
    "position": POSITION,
}
