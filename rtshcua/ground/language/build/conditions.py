"""Values that are computed, and conditions."""

from typing import Any, Literal

from rtshcua.diagnostics.codes import SYNTAX
from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.build.literals import Literals, whole_day
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
    Quantity,
    Range,
    Reference,
    Value,
    Within,
    WithinLast,
)
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.skills import Clause


class Conditions(Literals):
    """Values and conditions."""

    def reference(self, span: Span, text: str) -> Reference:
        """A name that stands for a value."""
        return Reference(span=span, name=text)

    def local_time(self, span: Span, text: str) -> Reference:
        """`local time`, one name however it is spaced."""
        return Reference(span=span, name="local time")

    def sum(self, span: Span, left: Value, operator: Literal["+", "-"], right: Value) -> Node:
        """`left + right`, `left - right`."""
        return self.nested(Arithmetic(span=span, operator=operator, left=left, right=right), left, right)

    def product(self, span: Span, left: Value, operator: Literal["*", "/"], right: Value) -> Node:
        """`left * right`, `left / right`."""
        return self.nested(Arithmetic(span=span, operator=operator, left=left, right=right), left, right)

    def function(self, span: Span, name: Literal["abs", "min", "max"], *operands: Value) -> Node:
        """`abs(value)`, `min(value, value, ...)`, `max(value, value, ...)`."""
        if (len(operands) == 1) != (name == "abs"):
            takes = "one value" if name == "abs" else "two values or more"
            help = "write it as in `abs(a - b)`" if name == "abs" else f"write it as in `{name}(a, b)`"
            self.report(SYNTAX, f"`{name}` takes {takes}, not {len(operands)}", span, help)
        return self.nested(Function(span=span, name=name, operands=operands), *operands)

    def bracket(self, span: Span, value: Node) -> Node:
        """Parentheses leave what is in them as it is, and count as a level."""
        return self.nested(value, value)

    group = bracket

    def range(self, span: Span, low: Value, high: Value) -> Range:
        """`low .. high`."""
        return Range(span=span, low=low, high=high)

    def comparison(self, span: Span, left: Value, operator: Any, right: Value) -> Comparison:
        """`left < right` and the like."""
        return Comparison(span=span, operator=operator, left=left, right=right)

    def within(self, span: Span, subject: Value, range: Range, days: tuple[int, ...] | None) -> Within:
        """`subject in low .. high`, `local time in 08:00 .. 18:00 on monday .. friday`."""
        return Within(span=span, subject=subject, range=range, days=days or ())

    def within_days(self, span: Span, subject: Value, days: tuple[int, ...]) -> Within:
        """`local time on saturday, sunday`."""
        start, end = whole_day(span)
        return Within(span=span, subject=subject, range=Range(span=span, low=start, high=end), days=days)

    def one_of_names(self, span: Span, subject: Value, names: tuple[Name, ...]) -> OneOf:
        """`subject in {a, b}`."""
        return OneOf(span=span, subject=subject, names=names)

    def inside(self, span: Span, subject: Value, region: Reference | Grow) -> Inside:
        """`subject inside region`."""
        return Inside(span=span, subject=subject, region=region, negated=False)

    def outside(self, span: Span, subject: Value, region: Reference | Grow) -> Inside:
        """`subject outside region`."""
        return Inside(span=span, subject=subject, region=region, negated=True)

    def known(self, span: Span, subject: Reference) -> Known:
        """`subject is known`."""
        return Known(span=span, subject=subject)

    def grow(self, span: Span, zone: Reference, margin: Value) -> Grow:
        """`grow(zone, margin)`."""
        return Grow(span=span, zone=zone, margin=margin)

    def rising(self, span: Span, operand: Condition) -> Node:
        """`rising operand`."""
        return self.nested(Edge(span=span, rising=True, operand=operand), operand)

    def falling(self, span: Span, operand: Condition) -> Node:
        """`falling operand`."""
        return self.nested(Edge(span=span, rising=False, operand=operand), operand)

    def for_last(self, span: Span, operand: Condition, window: Quantity) -> Node:
        """`operand for the last 3 s`."""
        return self.nested(ForLast(span=span, operand=operand, window=window), operand)

    def within_last(self, span: Span, operand: Condition, window: Quantity) -> Node:
        """`operand within the last 5 s`."""
        return self.nested(WithinLast(span=span, operand=operand, window=window), operand)

    def near(self, span: Span, left: Condition, window: Quantity, right: Condition) -> Node:
        """`left within 5 s of right`."""
        return self.nested(Near(span=span, left=left, right=right, window=window), left, right)

    def negation(self, span: Span, operand: Condition) -> Node:
        """`not operand`."""
        return self.nested(Not(span=span, operand=operand), operand)

    def conjunction(self, span: Span, *operands: Condition) -> Node:
        """`a and b and c`."""
        return self.nested(Junction(span=span, operator="and", operands=operands), *operands)

    def disjunction(self, span: Span, *operands: Condition) -> Node:
        """`a or b or c`."""
        return self.nested(Junction(span=span, operator="or", operands=operands), *operands)

    def clauses(self, condition: Condition, where_fitted: bool = False) -> tuple[Clause, ...]:
        """Splits a top-level `and`, so that a refusal can name the one operand that decided."""
        if isinstance(condition, Junction) and condition.operator == "and":
            return tuple(clause for operand in condition.operands for clause in self.clauses(operand, where_fitted))
        return (Clause(span=condition.span, condition=condition, where_fitted=where_fitted),)
