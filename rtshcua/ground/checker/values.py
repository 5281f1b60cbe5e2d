"""The type of a value, and its number where it is constant. What does not fit, by unit or datum, is reported."""

from typing import NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.scope import LOCAL_TIME, Argument, Scope
from rtshcua.ground.checker.symbols import suggestion
from rtshcua.ground.checker.types import (
    COUNT,
    EXAMPLES,
    LENGTH,
    POSITION,
    TIME_OF_DAY,
    Enumeration,
    Kind,
    Type,
    number,
)
from rtshcua.model.ir.expression import Arithmetic, Coordinates, Quantity, Range, Reference, TimeOfDay, Value
from rtshcua.model.ir.places import ZoneDecl
from rtshcua.model.ir.signals import SignalDecl
from rtshcua.model.quantity import UNITS, Datum, Dimension


class Typed(NamedTuple):
    """A value's type, and its canonical integer where it is made of literals only."""

    type: Type
    constant: int | None


def typed(
    scope: Scope, node: Value, expected: Type | None = None, asked: tuple[Span, str] | None = None
) -> Typed | None:
    """The type of a value where one of type `expected` (None: any) is asked; None after a finding.

    `asked` is a label for the place that asks.
    """
    found = _infer(scope, node, expected)
    if found is None or expected is None:
        return found
    return fit(scope, node, found, expected, asked)


def _infer(scope: Scope, node: Value, expected: Type | None) -> Typed | None:
    match node:
        case Quantity():
            return Typed(number(node.dimension, node.datum), node.value)
        case Reference():
            return _reference(scope, node, expected)
        case Arithmetic():
            return _arithmetic(scope, node)
        case TimeOfDay():
            return Typed(TIME_OF_DAY, node.value)
        case Coordinates():
            return Typed(POSITION, None)


def _reference(scope: Scope, node: Reference, expected: Type | None) -> Typed | None:
    name = node.name
    if expected is not None and expected.enumeration is not None:
        member = expected.enumeration.members.get(name)
        if member is not None:
            return Typed(expected, member)
    if name == LOCAL_TIME:
        return Typed(TIME_OF_DAY, None)
    found = scope.find(name)
    if found is not None:
        type = scope.type_of(found)
        return None if type is None else Typed(type, None)
    if expected is not None and expected.enumeration is not None:
        unknown_member(scope, node.span, name, expected.enumeration)
    else:
        scope.unknown(node.span, name)
    return None


def unknown_member(scope: Scope, span: Span, name: str, enumeration: Enumeration) -> None:
    """Report a name that is no value of an enumeration."""
    members = ", ".join(f"`{member}`" for member in enumeration.members)
    scope.report.add(
        codes.UNKNOWN_MEMBER,
        span,
        f"`{name}` is not a value of `{enumeration.name}`",
        help=suggestion(name, enumeration.members) or f"its values are {members}",
        labels=[(enumeration.declared, f"`{enumeration.name}` is declared here")],
    )


def _arithmetic(scope: Scope, node: Arithmetic) -> Typed | None:
    left, right = _infer(scope, node.left, None), _infer(scope, node.right, None)
    if left is None or right is None:
        return None
    for side, operand in ((node.left, left), (node.right, right)):
        if operand.type.kind is not Kind.NUMBER:
            scope.report.add(
                codes.BAD_ARITHMETIC,
                side.span,
                f"`{node.operator}` takes numbers, and this is {operand.type.describe()}",
                labels=declaration_labels(scope, side),
            )
            return None
    return _product(scope, node, left, right) if node.operator == "*" else _sum(scope, node, left, right)


def _product(scope: Scope, node: Arithmetic, left: Typed, right: Typed) -> Typed | None:
    """A product has a plain number, known when it is compiled, on one side."""
    for factor, other in ((right, left), (left, right)):
        if factor.type == COUNT and factor.constant is not None:
            constant = None if other.constant is None else factor.constant * other.constant
            return Typed(other.type, constant)
    scope.report.add(
        codes.BAD_ARITHMETIC,
        node.span,
        "one side of `*` must be a plain number that is written out",
        help="write a number without a unit on one side, as in `2 * altitude`",
    )
    return None


def _sum(scope: Scope, node: Arithmetic, left: Typed, right: Typed) -> Typed | None:
    sign = 1 if node.operator == "+" else -1
    constant = None
    if left.constant is not None and right.constant is not None:
        constant = left.constant + sign * right.constant
    type = _sum_type(left.type, right.type, sign)
    if type is not None:
        return Typed(type, constant)
    both_altitudes = left.type.dimension is right.type.dimension is Dimension.ALTITUDE
    code = codes.DATUM_MISMATCH if both_altitudes and sign < 0 else codes.DIMENSION_MISMATCH
    words = "added to" if sign > 0 else "subtracted from"
    scope.report.add(
        code,
        node.span,
        f"{right.type.describe()} cannot be {words} {left.type.describe()}",
        help="the difference of two altitudes is a length; add a length to an altitude" if both_altitudes else None,
        labels=[
            (node.left.span, f"this is {left.type.describe()}"),
            (node.right.span, f"this is {right.type.describe()}"),
        ],
    )
    return None


def _sum_type(left: Type, right: Type, sign: int) -> Type | None:
    """The type of a sum (`sign` 1) or difference (-1); a length moves an altitude, two altitudes differ by a length."""
    altitudes = (left.dimension is Dimension.ALTITUDE, right.dimension is Dimension.ALTITUDE)
    if altitudes == (True, True):
        return LENGTH if sign < 0 and left == right else None
    if altitudes == (True, False) and right == LENGTH:
        return left
    if altitudes == (False, True) and left == LENGTH and sign > 0:
        return right
    return left if left == right else None


def fit(scope: Scope, node: Value, found: Typed, expected: Type, asked: tuple[Span, str] | None = None) -> Typed | None:
    """`found` as a value of type `expected`; a constant length is an altitude above home where one is asked."""
    if found.type == expected:
        return found
    asked_altitude = expected.dimension is Dimension.ALTITUDE
    if asked_altitude and found.type == LENGTH and found.constant is not None and expected.datum is Datum.HOME:
        return Typed(expected, found.constant)
    datum = asked_altitude and (
        found.type.dimension is Dimension.ALTITUDE or (found.type == LENGTH and found.constant is not None)
    )
    if datum:
        here = "above home" if found.type == LENGTH else f"above {found.type.datum.value}"  # type: ignore[union-attr]
        message = f"`{scope.report.text(node.span)}` is {here}, where {expected.describe()} is asked"
    else:
        message = f"{expected.describe()} is asked, and `{scope.report.text(node.span)}` is {found.type.describe()}"
    replacement = _corrected(scope, node, found, expected)
    scope.report.add(
        codes.DATUM_MISMATCH
        if datum
        else codes.DIMENSION_MISMATCH
        if _numbers(found.type, expected)
        else codes.WRONG_TYPE,
        node.span,
        message,
        help=_accepted(expected, replacement),
        labels=[*declaration_labels(scope, node), *(() if asked is None else (asked,))],
        fix=None if replacement is None else (node.span, replacement, f"write `{replacement}`"),
    )
    return None


def _numbers(left: Type, right: Type) -> bool:
    return left.kind is Kind.NUMBER and right.kind is Kind.NUMBER


def _accepted(expected: Type, replacement: str | None) -> str:
    if replacement is not None:
        return f"write `{replacement}`, if that is what you mean"
    if expected.kind is Kind.NUMBER and expected.dimension is not None:
        example = EXAMPLES[expected.dimension] + (" above sea" if expected.datum is Datum.SEA else "")
        return f"write {expected.describe()}, such as `{example}`"
    if expected.enumeration is not None:
        return "its values are " + ", ".join(f"`{member}`" for member in expected.enumeration.members)
    return f"write {expected.describe()}"


def _corrected(scope: Scope, node: Value, found: Typed, expected: Type) -> str | None:
    """The literal with the unit or the datum that was asked, where that is likely what was meant."""
    if not isinstance(node, Quantity) or expected.kind is not Kind.NUMBER or expected.dimension is None:
        return None
    written = scope.report.text(node.span)
    if found.type == LENGTH and expected.dimension is Dimension.ALTITUDE:
        return f"{written} above {Datum.SEA.value}"
    if found.type == COUNT:
        return f"{written} {EXAMPLES[expected.dimension].split()[-1]}"
    if found.type == LENGTH and expected.dimension is Dimension.SPEED:
        unit = next((name for name in sorted(UNITS, key=len, reverse=True) if written.endswith(name)), "")
        return f"{written}/s" if f"{unit}/s" in UNITS else None
    return None


def declaration_labels(scope: Scope, node: Value) -> list[tuple[Span, str]]:
    """A label that points at the declaration of a name, for a value that is just a name."""
    if not isinstance(node, Reference):
        return []
    found = scope.find(node.name)
    if isinstance(found, Argument):
        return [(found.declaration.span, f"`{node.name}` is declared here")]
    if isinstance(found, SignalDecl):
        return [(found.name.span, f"`{node.name}` is declared here")]
    if isinstance(found, ZoneDecl):
        return [(found.name.span, f"`{node.name}` is declared here")]
    return []


def typed_range(scope: Scope, node: Range, expected: Type | None) -> tuple[Typed, Typed] | None:
    """Both ends of a range, of one type; a range whose ends are constant is not empty."""
    low = typed(scope, node.low, expected)
    high = typed(scope, node.high, expected)
    if low is None or high is None:
        return None
    wraps = low.type == TIME_OF_DAY
    if low.constant is not None and high.constant is not None and low.constant > high.constant and not wraps:
        swapped = f"{scope.report.text(node.high.span)} .. {scope.report.text(node.low.span)}"
        scope.report.add(
            codes.EMPTY_RANGE,
            node.span,
            f"the range `{scope.report.text(node.span)}` is empty: its first end is above its second",
            help=f"write `{swapped}`",
            fix=(node.span, swapped, "swap the ends"),
        )
        return None
    return low, high
