"""Values and conditions. Values have a dimension; conditions have one of three truth values (Kleene)."""

from typing import Literal

from rtshcua.model.ir.node import Name, Node
from rtshcua.model.quantity import Datum, Dimension


class Quantity(Node, kw_only=True):
    """A number with its unit, as an integer in the canonical unit of `dimension`; `datum` only where one is written."""

    kind: Literal["quantity"] = "quantity"
    value: int
    dimension: Dimension
    datum: Datum | None = None


class Coordinates(Node, kw_only=True):
    """A place on the ground, WGS 84, in 1e-7 degree: `47.3977 N, 8.5456 E`."""

    kind: Literal["coordinates"] = "coordinates"
    latitude: int
    longitude: int


class TimeOfDay(Node, kw_only=True):
    """A local time of day in us since midnight: `08:00`."""

    kind: Literal["time-of-day"] = "time-of-day"
    value: int


class Reference(Node, kw_only=True):
    """A signal, an argument, a zone, a zone's entry, an enumerator, `local time` or the mission's `phase`, by name."""

    kind: Literal["reference"] = "reference"
    name: str


class Arithmetic(Node, kw_only=True):
    """`left operator right`. `+` and `-` take values of one dimension; of `*` one side, of `/` the right side is known
    at compile time, and dimensions multiply: `speed * 3 s` is a length, `length / 4 m/s` a duration.
    """

    kind: Literal["arithmetic"] = "arithmetic"
    operator: Literal["+", "-", "*", "/"]
    left: "Value"
    right: "Value"


class Function(Node, kw_only=True):
    """`abs(a)`, `min(a, b, ...)`, `max(a, b, ...)` over numbers of one dimension and datum."""

    kind: Literal["function"] = "function"
    name: Literal["abs", "min", "max"]
    operands: tuple["Value", ...]


class Grow(Node, kw_only=True):
    """`grow(zone, margin)`: all points nearer to the zone than `margin`; a negative margin shrinks."""

    kind: Literal["grow"] = "grow"
    zone: Reference
    margin: "Value"  # known at compile time: a length, or a parameter of a template or a mission


class Range(Node, kw_only=True):
    """`low .. high`, both ends belong to it."""

    kind: Literal["range"] = "range"
    low: "Value"
    high: "Value"


#: the possible values of a comparison or an argument
Value = Quantity | Coordinates | TimeOfDay | Reference | Arithmetic | Function


class Comparison(Node, kw_only=True):
    """`left operator right`: both of one dimension and datum, or both of one enumeration."""

    kind: Literal["comparison"] = "comparison"
    operator: Literal["<", "<=", ">", ">=", "==", "!="]
    left: Value
    right: Value


class Within(Node, kw_only=True):
    """`subject in low .. high`, or `local time in 22:00 .. 06:00` (wraps over midnight).

    `days` are the days of the week on which such a window begins (`on monday .. friday`), as of `Daily`; empty
    means all. `local time on saturday` is from the first to the last us of the day.
    """

    kind: Literal["within"] = "within"
    subject: Value
    range: Range
    days: tuple[int, ...] = ()


class OneOf(Node, kw_only=True):
    """`subject in {a, b}`: an enumeration's value is among the names."""

    kind: Literal["one-of"] = "one-of"
    subject: Value
    names: tuple[Name, ...]


class Inside(Node, kw_only=True):
    """`subject inside region` or, negated, `subject outside region`. The boundary counts as outside of `inside`."""

    kind: Literal["inside"] = "inside"
    subject: Value
    region: Reference | Grow
    negated: bool


class Known(Node, kw_only=True):
    """`subject is known`: true while the signal has a value, unknown while it has none; never false."""

    kind: Literal["known"] = "known"
    subject: Reference


class Not(Node, kw_only=True):
    """Kleene negation."""

    kind: Literal["not"] = "not"
    operand: "Condition"


class Junction(Node, kw_only=True):
    """Kleene conjunction (`and`) or disjunction (`or`) of two or more operands, in source order."""

    kind: Literal["junction"] = "junction"
    operator: Literal["and", "or"]
    operands: tuple["Condition", ...]


class ForLast(Node, kw_only=True):
    """`condition for the last 3 s`: bounded-past *historically*, true while the condition was true all along."""

    kind: Literal["for-last"] = "for-last"
    operand: "Condition"
    window: Quantity


class WithinLast(Node, kw_only=True):
    """`condition within the last 5 s`: bounded-past *once*, true if the condition was true at some moment of it."""

    kind: Literal["within-last"] = "within-last"
    operand: "Condition"
    window: Quantity


class Near(Node, kw_only=True):
    """`a within 5 s of b`: one of them is true now, and the other was within that time; the same as
    `(a and b within the last 5 s) or (b and a within the last 5 s)`.
    """

    kind: Literal["near"] = "near"
    left: "Condition"
    right: "Condition"
    window: Quantity


class Edge(Node, kw_only=True):
    """`rising condition`: true now and false at the observation before; `falling` the other way round."""

    kind: Literal["edge"] = "edge"
    rising: bool
    operand: "Condition"


Condition = Comparison | Within | OneOf | Inside | Known | Not | Junction | ForLast | WithinLast | Near | Edge
