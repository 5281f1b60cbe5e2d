"""Comparisons and memberships: what is compared has one dimension and datum, or one enumeration, or is the phase."""

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.fitting import declaration_labels
from rtshcua.ground.checker.phases import is_phase, phase_compared, phase_in_range
from rtshcua.ground.checker.ranges import check_compared, check_ends
from rtshcua.ground.checker.scope import LOCAL_TIME, Scope
from rtshcua.ground.checker.types import MISSION_PHASE, POSITION, TIME_OF_DAY, ZONE, Kind, Type, Typed
from rtshcua.ground.checker.values import typed, typed_range, unknown_member
from rtshcua.model.ir.expression import Comparison, OneOf, Reference, Value, Within
from rtshcua.model.quantity import Dimension


def _enumeration(scope: Scope, node: Value) -> Type | None:
    """The enumeration that a name's declaration gives to its value, if it does."""
    if isinstance(node, Reference):
        found = scope.find(node.name)
        if found is not None:
            type = scope.type_of(found)
            if type is not None and type.kind is Kind.ENUMERATION:
                return type
    return None


def _names_type(scope: Scope, node: Value, other: Value) -> bool:
    """Whether an enumeration is named where its value is meant, and compared with one of its members."""
    if not isinstance(node, Reference) or not isinstance(other, Reference) or scope.find(node.name) is not None:
        return False
    enum = scope.symbols.enums.get(node.name)
    return enum is not None and any(member.name.text == other.name for member in enum.members)


def check_comparison(scope: Scope, node: Comparison) -> None:
    """`left operator right`."""
    if is_phase(scope, node.left):
        phase_compared(scope, node)
        return
    asked = _enumeration(scope, node.left)
    for enum, member in ((node.left, node.right), (node.right, node.left)):
        if _names_type(scope, enum, member):  # a signal of that type is meant, and the member is right
            typed(scope, enum)
            return
    left = typed(scope, node.left, _enumeration(scope, node.right) if asked is None else None)
    right = typed(scope, node.right, asked)
    if left is None or right is None:
        return
    if right.type == MISSION_PHASE:
        phase_compared(scope, node)
        return
    if TIME_OF_DAY in (left.type, right.type):
        _clock(scope, node, left, right)
    elif left.type.kind is Kind.NUMBER and right.type.kind is Kind.NUMBER:
        _same(scope, node, left, right)
    elif asked is not None or left.type.kind is Kind.ENUMERATION:
        _enumerated(scope, node, left, right)
    else:
        _incomparable(scope, node, left)


def _same(scope: Scope, node: Comparison, left: Typed, right: Typed) -> None:
    """Both sides of one dimension and datum; a literal length takes the datum of an altitude above home."""
    if left.type == right.type:
        check_compared(scope, node, left, right)
        return
    before = len(scope.report.found)
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
    if len(scope.report.found) == before:
        check_compared(scope, node, left, right)


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


def _clock(scope: Scope, node: Comparison, left: Typed, right: Typed) -> None:
    """`local time` before or after a time of day that is written out; what is meant is a part of the same day."""
    if left.type != right.type:
        odd, other = (node.left, left) if right.type == TIME_OF_DAY else (node.right, right)
        message = (
            f"`{scope.report.text(odd.span)}` is {other.type.describe()}, and is compared with {TIME_OF_DAY.describe()}"
        )
        help = "a time of day is compared with `local time`, as in `local time >= 19:00`"
    elif (left.constant is None) == (right.constant is None):
        message = f"`{node.operator}` compares `local time` with a time of day that is written out"
        help = "write `local time >= 19:00`, or `local time in 08:00 .. 18:00`"
    elif node.operator in ("==", "!="):
        message = f"`{node.operator}` asks for one moment of the day, which no clock can be held to"
        help = "write a window, such as `local time in 08:00 .. 08:10`, or a comparison, such as `local time >= 08:00`"
    else:
        return
    scope.report.add(codes.NOT_COMPARABLE, node.span, message, help=help, labels=declaration_labels(scope, node.left))


def _incomparable(scope: Scope, node: Comparison, left: Typed) -> None:
    help = "ask whether it is `inside` or `outside` a zone" if left.type in (ZONE, POSITION) else None
    scope.report.add(
        codes.NOT_COMPARABLE,
        node.span,
        f"`{node.operator}` compares numbers and enumerations, and `{scope.report.text(node.left.span)}` is "
        f"{left.type.describe()}",
        help=help,
        labels=declaration_labels(scope, node.left),
    )


def check_within(scope: Scope, node: Within) -> None:
    """`subject in low .. high`."""
    if is_phase(scope, node.subject):
        phase_in_range(scope, node)
        return
    subject = typed(scope, node.subject)
    if subject is None:
        return
    kind = subject.type.kind
    if node.days and kind is not Kind.TIME_OF_DAY:
        scope.report.add(
            codes.NOT_COMPARABLE,
            node.span,
            f"only `local time` is on days of the week, and `{scope.report.text(node.subject.span)}` is "
            f"{subject.type.describe()}",
            help="write `local time in 08:00 .. 18:00 on monday .. friday`",
            labels=declaration_labels(scope, node.subject),
        )
        return
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
    if ends is not None and kind is Kind.NUMBER:
        check_ends(scope, node, subject, ends)
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


def check_one_of(scope: Scope, node: OneOf) -> None:
    """`subject in {a, b}`."""
    if is_phase(scope, node.subject):
        return  # any name may be a phase's
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
