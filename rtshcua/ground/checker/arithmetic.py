"""Types of sums, products, quotients, `abs`, `min` and `max`, and the exact values of constant ones."""

from collections.abc import Mapping, Sequence
from fractions import Fraction

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.fitting import declaration_labels, fit
from rtshcua.ground.checker.name_scope import Scope
from rtshcua.ground.checker.types import COUNT, DURATION, LENGTH, RATIO, SPEED, Kind, Type, Typed
from rtshcua.model.ir.expression import Arithmetic, Function, Value
from rtshcua.model.quantity import Dimension

#: canonical units per base unit, which needs no factor in a product: m, m/s, s, degree, the whole, V, one
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

#: the help on `*` and `/`
PRODUCTS = "a plain number or a ratio times anything keeps its dimension, and a speed times a duration is a length"
QUOTIENTS = (
    "dividing by a plain number or a ratio keeps the dimension, a length by a speed is a duration, a length by a "
    "duration is a speed, and equal dimensions give a plain number"
)


def product(left: Type, right: Type) -> Type | None:
    """Return the type of `left * right` for two numbers, or None."""
    for factor in (COUNT, RATIO):
        if left == factor:
            return right
        if right == factor:
            return left
    return LENGTH if {left, right} == {SPEED, DURATION} else None


def quotient(left: Type, right: Type) -> Type | None:
    """Return the type of `left / right` for two numbers, or None."""
    if left == right:
        return COUNT
    if right in (COUNT, RATIO):
        return left
    return _QUOTIENTS.get((left, right))


def arithmetic(scope: Scope, node: Arithmetic, left: Typed, right: Typed) -> Typed | None:
    """Check `left operator right` for operands of known types; None after a finding."""
    if not _numbers(scope, node.operator, (node.left, node.right), (left, right)):
        return None
    match node.operator:
        case "*":
            return _product(scope, node, left, right)
        case "/":
            return _quotient(scope, node, left, right)
        case _:
            return _sum(scope, node, left, right)


def function(scope: Scope, node: Function, found: Sequence[Typed]) -> Typed | None:
    """Check `abs`, `min` or `max` for operands of known types; a constant length takes the datum of an altitude."""
    if not _numbers(scope, node.name, node.operands, found):
        return None
    leading = next((each for each in found if each.constant is None or each.type.datum is not None), found[0])
    fitted = [
        fit(scope, operand, each, leading.type, (node.span, f"`{node.name}` needs operands of one dimension and datum"))
        for operand, each in zip(node.operands, found, strict=True)
    ]
    values = [each.constant for each in fitted if each is not None and each.constant is not None]
    if None in fitted:
        return None
    if len(values) < len(fitted):
        return Typed(leading.type, None)
    constant = abs(values[0]) if node.name == "abs" else min(values) if node.name == "min" else max(values)
    return Typed(leading.type, constant)


def _numbers(scope: Scope, word: str, nodes: Sequence[Value], found: Sequence[Typed]) -> bool:
    for node, each in zip(nodes, found, strict=True):
        if each.type.kind is not Kind.NUMBER:
            scope.report.add(
                codes.BAD_ARITHMETIC,
                node.span,
                f"the operands of `{word}` must be numbers, not {each.type.describe()}",
                labels=declaration_labels(scope, node),
            )
            return False
    return True


def _coherent(type: Type) -> int:
    assert type.dimension is not None
    return COHERENT[type.dimension]


def _product(scope: Scope, node: Arithmetic, left: Typed, right: Typed) -> Typed | None:
    """Check a product: one operand must be constant."""
    type = product(left.type, right.type)
    if type is None:
        scope.report.add(
            codes.BAD_ARITHMETIC,
            node.span,
            f"{left.type.describe()} times {right.type.describe()} has no supported unit",
            help=PRODUCTS,
            labels=_sides(node, left, right),
        )
        return None
    if left.constant is None and right.constant is None:
        scope.report.add(
            codes.BAD_ARITHMETIC,
            node.span,
            "one operand of `*` must be known before the flight",
            help="write a number on one side, as in `2 * altitude` or `speed * 3 s`",
            labels=_sides(node, left, right),
        )
        return None
    if left.constant is None or right.constant is None:
        return Typed(type, None)
    factor = Fraction(_coherent(type), _coherent(left.type) * _coherent(right.type))
    return Typed(type, left.constant * right.constant * factor)


def _quotient(scope: Scope, node: Arithmetic, left: Typed, right: Typed) -> Typed | None:
    """Check a quotient: the divisor must be constant and not zero."""
    if right.constant is None or right.constant == 0:
        unknown = right.constant is None
        text = scope.report.text(node.right.span)
        scope.report.add(
            codes.BAD_DIVISION,
            node.right.span,
            f"cannot divide by `{text}`: it is not known before the flight"
            if unknown
            else f"cannot divide by `{text}`: it is zero",
            help="multiply the other side of the comparison instead" if unknown else None,
            labels=declaration_labels(scope, node.right),
        )
        return None
    type = quotient(left.type, right.type)
    if type is None:
        scope.report.add(
            codes.BAD_ARITHMETIC,
            node.span,
            f"{left.type.describe()} cannot be divided by {right.type.describe()}",
            help=QUOTIENTS,
            labels=_sides(node, left, right),
        )
        return None
    if left.constant is None:
        return Typed(type, None)
    factor = Fraction(_coherent(type) * _coherent(right.type), _coherent(left.type))
    return Typed(type, left.constant / right.constant * factor)


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
        labels=_sides(node, left, right),
    )
    return None


def _sides(node: Arithmetic, left: Typed, right: Typed) -> list[tuple[Span, str]]:
    return [
        (node.left.span, f"this is {left.type.describe()}"),
        (node.right.span, f"this is {right.type.describe()}"),
    ]


def _sum_type(left: Type, right: Type, sign: int) -> Type | None:
    """The type of a sum (`sign` 1) or difference (-1). A length moves an altitude; two altitudes differ by a length."""
    altitudes = (left.dimension is Dimension.ALTITUDE, right.dimension is Dimension.ALTITUDE)
    if altitudes == (True, True):
        return LENGTH if sign < 0 and left == right else None
    if altitudes == (True, False) and right == LENGTH:
        return left
    if altitudes == (False, True) and left == LENGTH and sign > 0:
        return right
    return left if left == right else None
