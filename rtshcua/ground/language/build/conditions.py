"""Actions for computed values and conditions. The docstring of an action shows the source text of its rule."""

from typing import Literal

from rtshcua.diagnostics.codes import SYNTAX
from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.build.literals import LAST_US
from rtshcua.ground.language.build.reader import Action, Reader, nesting, node
from rtshcua.model.ir.expression import (
    Arithmetic,
    Comparison,
    Condition,
    Edge,
    ForLast,
    Function,
    Grow,
    Inside,
    Junction,
    Known,
    Near,
    Not,
    OneOf,
    Range,
    Reference,
    TimeOfDay,
    Value,
    Within,
    WithinLast,
)
from rtshcua.model.ir.node import Node

FORMS: dict[str, Action] = {
    "sum": nesting(Arithmetic, "left", "operator", "right"),
    "product": nesting(Arithmetic, "left", "operator", "right"),
    "range": node(Range, "low", "high"),
    "comparison": node(Comparison, "left", "operator", "right"),
    "within": node(Within, "subject", "range", "days"),
    "one_of_names": node(OneOf, "subject", "names"),
    "inside": node(Inside, "subject", "region", negated=False),
    "outside": node(Inside, "subject", "region", negated=True),
    "known": node(Known, "subject"),
    "grow": node(Grow, "zone", "margin"),
    "rising": nesting(Edge, "operand", rising=True),
    "falling": nesting(Edge, "operand", rising=False),
    "for_last": nesting(ForLast, "operand", "window"),
    "within_last": nesting(WithinLast, "operand", "window"),
    "near": nesting(Near, "left", "window", "right"),
    "negation": nesting(Not, "operand"),
}


def reference(reader: Reader, span: Span, text: str) -> Reference:
    """A name used as a value."""
    return Reference(span=span, name=text)


def local_time(reader: Reader, span: Span, text: str) -> Reference:
    """`local time`, with any white space."""
    return Reference(span=span, name="local time")


def function(reader: Reader, span: Span, name: Literal["abs", "min", "max"], *operands: Value) -> Node:
    """`abs(value)`, `min(value, value, ...)`, `max(value, value, ...)`."""
    if (len(operands) == 1) != (name == "abs"):
        takes = "one value" if name == "abs" else "two or more values"
        help = "write it as in `abs(a - b)`" if name == "abs" else f"write it as in `{name}(a, b)`"
        reader.report(SYNTAX, f"`{name}` takes {takes}, not {len(operands)}", span, help)
    return reader.nested(Function(span=span, name=name, operands=operands), *operands)


def bracket(reader: Reader, span: Span, value: Node) -> Node:
    """Parentheses: the inner node itself, one nesting level deeper."""
    return reader.nested(value, value)


group = bracket


def within_days(reader: Reader, span: Span, subject: Value, days: tuple[int, ...]) -> Within:
    """`local time on saturday, sunday`."""
    start, end = TimeOfDay(span=span, value=0), TimeOfDay(span=span, value=LAST_US)
    return Within(span=span, subject=subject, range=Range(span=span, low=start, high=end), days=days)


def conjunction(reader: Reader, span: Span, *operands: Condition) -> Node:
    """`a and b and c`."""
    return reader.nested(Junction(span=span, operator="and", operands=operands), *operands)


def disjunction(reader: Reader, span: Span, *operands: Condition) -> Node:
    """`a or b or c`."""
    return reader.nested(Junction(span=span, operator="or", operands=operands), *operands)
