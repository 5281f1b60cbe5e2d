"""Values and conditions. Values have a dimension; conditions have one of three truth values (Kleene)."""

from typing import Annotated, Literal

from pydantic import Field

from rtshcua.model.ir.node import Name, Node
from rtshcua.model.quantity import Datum, Dimension


class Quantity(Node):
    """A number with its unit, as an integer in the canonical unit of `dimension`; `datum` only where one is written."""

    kind: Literal["quantity"] = "quantity"
    value: int
    dimension: Dimension
    datum: Datum | None = None


class Coordinates(Node):
    """A place on the ground, WGS 84, in 1e-7 degree: `47.3977 N, 8.5456 E`."""

    kind: Literal["coordinates"] = "coordinates"
    latitude: int
    longitude: int


class TimeOfDay(Node):
    """A local time of day in us since midnight: `08:00`."""

    kind: Literal["time-of-day"] = "time-of-day"
    value: int


class Reference(Node):
    """A signal, an argument, a zone, a zone's entry, an enumerator, or `local time`, by name."""

    kind: Literal["reference"] = "reference"
    name: str


class Arithmetic(Node):
    """`left operator right` over values of one dimension; `*` takes a plain number on one side."""

    kind: Literal["arithmetic"] = "arithmetic"
    operator: Literal["+", "-", "*"]
    left: "Value"
    right: "Value"


class Grow(Node):
    """`grow(zone, margin)`: all points nearer to the zone than `margin`; a negative margin shrinks."""

    kind: Literal["grow"] = "grow"
    zone: Reference
    margin: Quantity


class Range(Node):
    """`low .. high`, both ends belong to it."""

    kind: Literal["range"] = "range"
    low: "Value"
    high: "Value"


Value = Annotated[
    Quantity | Coordinates | TimeOfDay | Reference | Arithmetic, Field(discriminator="kind")
]  # the values a comparison or an argument may have


class Comparison(Node):
    """`left operator right`: both of one dimension and datum, or both of one enumeration."""

    kind: Literal["comparison"] = "comparison"
    operator: Literal["<", "<=", ">", ">=", "==", "!="]
    left: Value
    right: Value


class Within(Node):
    """`subject in low .. high`, or `local time in 22:00 .. 06:00` (wraps over midnight)."""

    kind: Literal["within"] = "within"
    subject: Value
    range: Range


class OneOf(Node):
    """`subject in {a, b}`: an enumeration's value is among the names."""

    kind: Literal["one-of"] = "one-of"
    subject: Value
    names: tuple[Name, ...]


class Inside(Node):
    """`subject inside region` or, negated, `subject outside region`. The boundary counts as outside of `inside`."""

    kind: Literal["inside"] = "inside"
    subject: Value
    region: Annotated[Reference | Grow, Field(discriminator="kind")]
    negated: bool


class Not(Node):
    """Kleene negation."""

    kind: Literal["not"] = "not"
    operand: "Condition"


class Junction(Node):
    """Kleene conjunction (`and`) or disjunction (`or`) of two or more operands, in source order."""

    kind: Literal["junction"] = "junction"
    operator: Literal["and", "or"]
    operands: tuple["Condition", ...]


Condition = Annotated[Comparison | Within | OneOf | Inside | Not | Junction, Field(discriminator="kind")]

for _node in (Arithmetic, Range, Comparison, Within, OneOf, Inside, Not, Junction):
    _node.model_rebuild()
