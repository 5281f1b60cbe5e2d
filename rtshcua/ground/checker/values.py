"""Type values, evaluate constant ones, and report those that do not fit by unit or datum."""

import re
from fractions import Fraction
from functools import lru_cache

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.arithmetic import arithmetic, function
from rtshcua.ground.checker.fitting import fit, stored
from rtshcua.ground.checker.name_scope import LOCAL_TIME, PHASE, Scope
from rtshcua.ground.checker.symbols import correction, suggestion
from rtshcua.ground.checker.types import MISSION_PHASE, POSITION, TIME_OF_DAY, Enumeration, Type, Typed, number
from rtshcua.model.ir.expression import (
    Arithmetic,
    Coordinates,
    Function,
    Quantity,
    Range,
    Reference,
    TimeOfDay,
    Value,
)
from rtshcua.model.quantity import UNITS


def typed(
    scope: Scope, node: Value, expected: Type | None = None, asked: tuple[Span, str] | None = None
) -> Typed | None:
    """Return the typed value, checked against the type `expected` (None: any); None after a finding.

    `asked` is a label for the place that requires the type.
    """
    found = _infer(scope, node, expected)
    if found is None or expected is None:
        return found
    return fit(scope, node, found, expected, asked)


def _infer(scope: Scope, node: Value, expected: Type | None) -> Typed | None:
    match node:
        case Quantity():
            return Typed(number(node.dimension, node.datum), _exactly(node.value))
        case Reference():
            return _reference(scope, node, expected)
        case Arithmetic():
            if _parted(scope, node):
                return None
            left, right = _infer(scope, node.left, None), _infer(scope, node.right, None)
            return None if left is None or right is None else arithmetic(scope, node, left, right)
        case Function():
            operands = [_infer(scope, operand, None) for operand in node.operands]
            known = [operand for operand in operands if operand is not None]
            return function(scope, node, known) if len(known) == len(operands) else None
        case TimeOfDay():
            return Typed(TIME_OF_DAY, Fraction(node.value))
        case Coordinates():
            return Typed(POSITION, None)


@lru_cache(maxsize=1 << 12)
def _exactly(value: int) -> Fraction:
    return Fraction(value)


def _parted(scope: Scope, node: Arithmetic) -> bool:
    """Whether a value is `8 m / s` instead of `8 m/s`; reports it."""
    number = node.left.right if isinstance(node.left, Arithmetic) else node.left
    name = node.right
    if node.operator != "/" or not isinstance(number, Quantity) or not isinstance(name, Reference):
        return False
    written = scope.report.text(number.span)
    unit = re.search(r"[a-z]+$", written)
    if unit is None or f"{unit[0]}/{name.name}" not in UNITS or scope.find(name.name) is not None:
        return False
    meant = f"{written}/{name.name}"
    scope.report.add(
        codes.UNKNOWN_NAME,
        name.span,
        f"`{name.name}` is not declared",
        help=f"write `{meant}`, without spaces in the unit",
        fix=(number.span.to(name.span), meant, f"write `{meant}`"),
    )
    return True


def _reference(scope: Scope, node: Reference, expected: Type | None) -> Typed | None:
    name = node.name
    if expected is not None and expected.enumeration is not None:
        member = expected.enumeration.members.get(name)
        if member is not None:
            return Typed(expected, Fraction(member))
    if name == LOCAL_TIME:
        return Typed(TIME_OF_DAY, None)
    found = scope.find(name)
    if found is not None:
        type = scope.type_of(found)
        return None if type is None else Typed(type, None)
    if name == PHASE:
        return Typed(MISSION_PHASE, None)
    if expected is not None and expected.enumeration is not None:
        unknown_member(scope, node.span, name, expected.enumeration)
    else:
        scope.unknown(node.span, name)
    return None


def unknown_member(scope: Scope, span: Span, name: str, enumeration: Enumeration) -> None:
    """Report a name that is not a value of an enumeration."""
    members = ", ".join(f"`{member}`" for member in enumeration.members)
    scope.report.add(
        codes.UNKNOWN_MEMBER,
        span,
        f"`{name}` is not a value of `{enumeration.name}`",
        help=suggestion(name, enumeration.members) or f"its values are {members}",
        fix=correction(scope.report, span, name, enumeration.members),
        labels=[(enumeration.declared, f"`{enumeration.name}` is declared here")],
    )


def typed_range(scope: Scope, node: Range, expected: Type | None) -> tuple[Typed, Typed] | None:
    """Return both ends of a range, of one type; report a constant range that is empty."""
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
            f"the range `{scope.report.text(node.span)}` is empty: its lower end is above its upper end",
            help=f"write `{swapped}`",
            fix=(node.span, swapped, "swap the ends"),
        )
        return None
    return low, high


def whole_range(scope: Scope, node: Range, expected: Type) -> tuple[int, int] | None:
    """Return both ends of a range as whole canonical numbers; None after a finding, or if an end is not constant."""
    ends = typed_range(scope, node, expected)
    if ends is None or ends[0].constant is None or ends[1].constant is None:
        return None
    low, high = (
        stored(scope, node.low, expected, ends[0].constant),
        stored(scope, node.high, expected, ends[1].constant),
    )
    return None if low is None or high is None else (low, high)
