"""Check values against the range of a signal, by its fields.

The range of an integer field is that of its type. Two components make a magnitude. A ratio is between 0 % and 100 %. A
floating-point field has no range.
"""

from collections.abc import Iterable, Sequence
from fractions import Fraction
from math import ceil, floor
from typing import Final, NamedTuple

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.arithmetic import COHERENT
from rtshcua.ground.checker.name_scope import Scope
from rtshcua.ground.checker.symbols import Extent
from rtshcua.ground.checker.types import Typed
from rtshcua.ground.checker.values import typed
from rtshcua.mavlink.dialect import Dialect
from rtshcua.mavlink.quantise import UNITS, quantise
from rtshcua.model.flat.limits import FULL
from rtshcua.model.ir.expression import Arithmetic, Comparison, Function, Reference, Value, Within
from rtshcua.model.ir.signals import SignalDecl
from rtshcua.model.quantity import Dimension, display

MAX_INTEGER: Final = (1 << 63) - 1
#: the range of an integer field, within the onboard limits
INTEGERS: Final = {
    f"{sign}int{bits}_t": (0, min((1 << bits) - 1, MAX_INTEGER)) if sign else (-(1 << bits - 1), (1 << bits - 1) - 1)
    for sign in ("", "u")
    for bits in (8, 16, 32, 64)
}


OPEN: Final = Extent(None, None)


class Carrier(NamedTuple):
    """A message and its numeric fields; a raw value `v` is `v * numerator / denominator` in the canonical unit."""

    message: str
    fields: Sequence[str]
    numerator: int
    denominator: int


def carried(dialect: Dialect, dimension: Dimension, carriers: Iterable[Carrier]) -> Extent:
    """Return the range of a signal that is read from one of these fields."""
    each = [_carried(dialect, carrier) for carrier in carriers]
    lows, highs = [one.low for one in each if one.low is not None], [one.high for one in each if one.high is not None]
    low = min(lows) if each and len(lows) == len(each) else None
    high = max(highs) if each and len(highs) == len(each) else None
    if dimension is not Dimension.RATIO:
        return Extent(low, high)
    return Extent(0 if low is None else max(low, 0), FULL if high is None else min(high, FULL))


def _carried(dialect: Dialect, carrier: Carrier) -> Extent:
    if len(carrier.fields) > 1:
        return Extent(0, None)
    held = INTEGERS.get(dialect.messages[carrier.message].fields[carrier.fields[0]].type)
    if held is None:
        return OPEN
    low, high = (quantise(end, carrier.numerator, carrier.denominator) for end in held)
    return Extent(low, high)


def reported(dialect: Dialect, signal: SignalDecl, dimension: Dimension) -> Extent:
    """Return the range of a numeric signal, whose fields were checked."""
    units = UNITS[Dimension.LENGTH if dimension is Dimension.ALTITUDE else dimension]
    return carried(
        dialect,
        dimension,
        (
            Carrier(
                source.message.text,
                [name.text for name in source.fields],
                *units[dialect.messages[source.message.text].fields[source.fields[0].text].unit],
            )
            for source in signal.sources
        ),
    )


def accepted(extent: Extent, dimension: Dimension, value: Fraction | int) -> str:
    """Return the help on the range of a signal, with the value nearest to `value`."""
    low = "" if extent.low is None else f"from `{display(ceil(extent.low), dimension)}`"
    high = "" if extent.high is None else f"to `{display(floor(extent.high), dimension)}`"
    nearest = extent.low if extent.low is not None and value < extent.low else extent.high
    assert nearest is not None
    near = display(ceil(nearest) if nearest is extent.low else floor(nearest), dimension)
    return f"its values are {' '.join(filter(None, (low, high)))}; the nearest is `{near}`"


def check_compared(scope: Scope, node: Comparison, left: Typed, right: Typed) -> None:
    """Report a constant outside the range of the other side of a comparison."""
    if right.constant is not None and left.constant is None:
        _check(scope, node.left, left, node.right, right.constant)
    elif left.constant is not None and right.constant is None:
        _check(scope, node.right, right, node.left, left.constant)


def check_ends(scope: Scope, node: Within, subject: Typed, ends: tuple[Typed, Typed]) -> None:
    """Report each end of a range that is outside the range of its subject."""
    for written, end in zip((node.range.low, node.range.high), ends, strict=True):
        if end.constant is not None:
            _check(scope, node.subject, subject, written, end.constant)


def _check(scope: Scope, subject: Value, type: Typed, written: Value, constant: Fraction) -> None:
    extent, dimension = extent_of(scope, subject), type.type.dimension
    if dimension is None or extent.has(constant):
        return
    beyond(scope, written, scope.report.text(subject.span), extent, dimension, constant)


def beyond(
    scope: Scope, written: Value, what: str, extent: Extent, dimension: Dimension, value: Fraction | int
) -> None:
    """Report a value outside the range of the signal or expression `what`."""
    low = extent.low is not None and value < extent.low
    signal, text = scope.symbols.signals.get(what), scope.report.text(written.span)
    if not any(map(str.isdigit, text)):  # a parameter of a template
        text = display(floor(value), dimension)
    scope.report.add(
        codes.BEYOND_RANGE,
        written.span,
        f"`{text}` is {'below' if low else 'above'} the range of `{what}`",
        help=accepted(extent, dimension, value),
        labels=[] if signal is None else [(signal.name.span, "declared here, with its fields")],
    )


def extent_of(scope: Scope, node: Value) -> Extent:
    """Return the range of an expression over signals, whose types were checked."""
    found = typed(scope, node)
    if found is not None and found.constant is not None:
        return Extent(found.constant, found.constant)
    match node:
        case Reference():
            return scope.symbols.ranges.get(node.name, OPEN)
        case Arithmetic():
            return _arithmetic(scope, node)
        case Function():
            return _function(node.name, [extent_of(scope, operand) for operand in node.operands])
        case _:
            return OPEN


def _arithmetic(scope: Scope, node: Arithmetic) -> Extent:
    left, right = extent_of(scope, node.left), extent_of(scope, node.right)
    if node.operator in ("+", "-"):
        if node.operator == "-":
            right = _times(right, Fraction(-1))
        return Extent(_added(left.low, right.low), _added(left.high, right.high))
    types = [typed(scope, each) for each in (node, node.left, node.right)]
    units = [Fraction(COHERENT[each.type.dimension]) for each in types if each is not None and each.type.dimension]
    assert len(units) == len(types)
    whole, one, other = units
    if node.operator == "*":
        if left.low == left.high and left.low is not None:
            left, right = right, left
        assert right.low is not None
        return _times(left, right.low * whole / (one * other))
    assert right.low is not None
    return _times(left, whole * other / one / right.low)


def _added(one: Fraction | int | None, other: Fraction | int | None) -> Fraction | int | None:
    return None if one is None or other is None else one + other


def _times(extent: Extent, factor: Fraction) -> Extent:
    low, high = (None if end is None else end * factor for end in extent)
    return Extent(low, high) if factor >= 0 else Extent(high, low)


def _function(name: str, extents: Sequence[Extent]) -> Extent:
    if name == "abs":
        low, high = extents[0]
        if low is not None and low >= 0:
            return extents[0]
        return Extent(0, None if low is None or high is None else max(-low, high))
    if name == "min":  # min(a, b) = -max(-a, -b)
        negated = [_times(each, Fraction(-1)) for each in extents]
        return _times(_function("max", negated), Fraction(-1))
    lows = [each.low for each in extents if each.low is not None]
    highs = [each.high for each in extents if each.high is not None]
    return Extent(max(lows) if lows else None, max(highs) if len(highs) == len(extents) else None)
