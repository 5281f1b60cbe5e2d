"""Conditions are well typed: what is compared has one dimension and datum, or one enumeration."""

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.scope import LOCAL_TIME, Argument, Scope
from rtshcua.ground.checker.types import POSITION, TIME_OF_DAY, ZONE, Kind, Type
from rtshcua.ground.checker.values import (
    Typed,
    declaration_labels,
    typed,
    typed_range,
    unknown_member,
)
from rtshcua.model.flat.zone import MAX_COORDINATE
from rtshcua.model.ir.expression import (
    Arithmetic,
    Comparison,
    Condition,
    Grow,
    Inside,
    Junction,
    Not,
    OneOf,
    Quantity,
    Reference,
    Value,
    Within,
)
from rtshcua.model.ir.places import ZoneDecl
from rtshcua.model.ir.signals import SignalDecl
from rtshcua.model.quantity import Dimension

#: the signal whose place is the vehicle's
POSITION_SIGNAL = "position"


def check_condition(scope: Scope, node: Condition) -> None:
    """Report everything in a condition that has no meaning."""
    match node:
        case Comparison():
            _comparison(scope, node)
        case Within():
            _within(scope, node)
        case OneOf():
            _one_of(scope, node)
        case Inside():
            _inside(scope, node)
        case Not():
            check_condition(scope, node.operand)
        case Junction():
            for operand in node.operands:
                check_condition(scope, operand)


def _enumeration(scope: Scope, node: Value) -> Type | None:
    """The enumeration that a name's declaration gives to its value, if it does."""
    if isinstance(node, Reference):
        found = scope.find(node.name)
        if found is not None:
            type = scope.type_of(found)
            if type is not None and type.kind is Kind.ENUMERATION:
                return type
    return None


def _comparison(scope: Scope, node: Comparison) -> None:
    asked = _enumeration(scope, node.left)
    left = typed(scope, node.left, _enumeration(scope, node.right) if asked is None else None)
    right = typed(scope, node.right, asked)
    if left is None or right is None:
        return
    if left.type.kind is Kind.NUMBER and right.type.kind is Kind.NUMBER:
        _same(scope, node, left, right)
    elif asked is not None or left.type.kind is Kind.ENUMERATION:
        _enumerated(scope, node, left, right)
    else:
        _incomparable(scope, node, left)


def _same(scope: Scope, node: Comparison, left: Typed, right: Typed) -> None:
    """Both sides of one dimension and datum; a literal length takes the datum of an altitude above home."""
    if left.type == right.type:
        return
    altitude = Dimension.ALTITUDE
    if left.constant is not None and right.type.dimension is altitude:
        typed(scope, node.left, right.type)
    elif right.constant is not None or left.type.dimension is not altitude is right.type.dimension:
        typed(scope, node.right, left.type)
    elif left.constant is not None:
        typed(scope, node.left, right.type)
    else:
        both = left.type.dimension is right.type.dimension
        scope.report.add(
            codes.DATUM_MISMATCH if both else codes.DIMENSION_MISMATCH,
            node.span,
            f"{left.type.describe()} is compared with {right.type.describe()}",
            help="a length becomes an altitude only when it is added to one" if _lengths(left, right) else None,
            labels=[*declaration_labels(scope, node.left), *declaration_labels(scope, node.right)],
        )


def _lengths(left: Typed, right: Typed) -> bool:
    return {left.type.dimension, right.type.dimension} == {Dimension.LENGTH, Dimension.ALTITUDE}


def _enumerated(scope: Scope, node: Comparison, left: Typed, right: Typed) -> None:
    """A name's value against a constant of its enumeration; only an `enum` has an order."""
    enumeration = left.type.enumeration
    assert enumeration is not None
    if (left.constant is None) == (right.constant is None):
        scope.report.add(
            codes.NOT_COMPARABLE,
            node.span,
            "a value of an enumeration is compared with one of its names",
            help="write one of " + ", ".join(f"`{member}`" for member in enumeration.members),
            labels=declaration_labels(scope, node.left),
        )
    elif not enumeration.ordered and node.operator not in ("==", "!="):
        scope.report.add(
            codes.NOT_COMPARABLE,
            node.span,
            f"the choices of `{enumeration.name}` have no order",
            help="compare them with `==`, `!=` or `in { ... }`",
            labels=[(enumeration.declared, "declared here")],
        )


def _incomparable(scope: Scope, node: Comparison, left: Typed) -> None:
    if left.type == TIME_OF_DAY:
        help = "write `local time in 08:00 .. 18:00`"
    elif left.type in (ZONE, POSITION):
        help = "ask whether it is `inside` or `outside` a zone"
    else:
        help = None
    scope.report.add(
        codes.NOT_COMPARABLE,
        node.span,
        f"`{node.operator}` compares numbers and enumerations, and `{scope.report.text(node.left.span)}` is "
        f"{left.type.describe()}",
        help=help,
        labels=declaration_labels(scope, node.left),
    )


def _within(scope: Scope, node: Within) -> None:
    subject = typed(scope, node.subject)
    if subject is None:
        return
    kind = subject.type.kind
    if kind in (Kind.ZONE, Kind.POSITION):
        scope.report.add(
            codes.NOT_COMPARABLE,
            node.span,
            f"`{scope.report.text(node.subject.span)}` is {subject.type.describe()}, and a range has numbers",
            help="ask whether it is `inside` or `outside` a zone",
            labels=declaration_labels(scope, node.subject),
        )
        return
    if kind is Kind.ENUMERATION and subject.type.enumeration is not None and not subject.type.enumeration.ordered:
        scope.report.add(
            codes.NOT_COMPARABLE,
            node.span,
            f"the choices of `{subject.type.enumeration.name}` have no order",
            help="write `in { ... }`",
            labels=[(subject.type.enumeration.declared, "declared here")],
        )
        return
    ends = typed_range(scope, node.range, subject.type)
    if ends is None or kind is not Kind.TIME_OF_DAY:
        return
    is_clock = isinstance(node.subject, Reference) and node.subject.name == LOCAL_TIME
    if not is_clock or ends[0].constant is None or ends[1].constant is None:
        scope.report.add(
            codes.NOT_COMPARABLE,
            node.span,
            "only `local time` can be in a range of times, and both its ends are written out",
            help="write `local time in 08:00 .. 18:00`",
        )


def _one_of(scope: Scope, node: OneOf) -> None:
    subject = typed(scope, node.subject)
    if subject is None:
        return
    enumeration = subject.type.enumeration
    if enumeration is None:
        scope.report.add(
            codes.NOT_COMPARABLE,
            node.subject.span,
            f"`in {{ ... }}` asks for a value of an enumeration, and this is {subject.type.describe()}",
            help="write `in low .. high` for numbers" if subject.type.kind is Kind.NUMBER else None,
            labels=declaration_labels(scope, node.subject),
        )
        return
    for name in node.names:
        if name.text not in enumeration.members:
            unknown_member(scope, name.span, name.text, enumeration)


def _inside(scope: Scope, node: Inside) -> None:
    """Where the vehicle is, where an argument is, or whether a zone argument lies within a zone."""
    region = node.region.zone if isinstance(node.region, Grow) else node.region
    if isinstance(node.region, Grow):
        _margin(scope, node.region.margin)
    of_region = typed(scope, region, ZONE)
    subject = typed(scope, node.subject)
    if of_region is None or subject is None:
        return
    found = scope.find(node.subject.name) if isinstance(node.subject, Reference) else None
    is_vehicle = isinstance(found, SignalDecl) and found.name.text == POSITION_SIGNAL
    is_argument = isinstance(found, Argument) and subject.type in (ZONE, POSITION)
    if not is_vehicle and not is_argument:
        scope.report.add(
            codes.BAD_SUBJECT,
            node.subject.span,
            f"`{scope.report.text(node.subject.span)}` cannot be inside or outside of a zone",
            help=f"ask it of `{POSITION_SIGNAL}`, or of an argument that is a position or a zone",
            labels=declaration_labels(scope, node.subject),
        )
    elif is_argument and not isinstance(scope.find(region.name), ZoneDecl):
        scope.report.add(
            codes.BAD_SUBJECT,
            node.region.span,
            "an argument is compared with a declared zone only, not with another argument",
            labels=declaration_labels(scope, region),
        )


def _margin(scope: Scope, margin: Quantity) -> None:
    if margin.dimension is not Dimension.LENGTH:
        scope.report.add(
            codes.DIMENSION_MISMATCH,
            margin.span,
            f"a zone grows by a length, and `{scope.report.text(margin.span)}` is none",
            help="write a length, such as `15 m`",
        )
    elif abs(margin.value) > MAX_COORDINATE:
        scope.report.add(
            codes.NUMBER_SIZE, margin.span, f"`{scope.report.text(margin.span)}` is larger than the local plane"
        )


def references(node: Condition | Value) -> list[Reference]:
    """All names that a condition refers to, in source order."""
    found: list[Reference] = []
    stack: list[object] = [node]
    while stack:
        item = stack.pop()
        match item:
            case Reference():
                found.append(item)
            case Arithmetic() | Comparison():
                stack += [item.right, item.left]
            case Within():
                stack += [item.range.high, item.range.low, item.subject]
            case OneOf():
                stack.append(item.subject)
            case Inside():
                region = item.region.zone if isinstance(item.region, Grow) else item.region
                stack += [region, item.subject]
            case Not():
                stack.append(item.operand)
            case Junction():
                stack += reversed(item.operands)
            case _:
                pass
    return found
