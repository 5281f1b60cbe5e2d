"""Check the types of conditions: comparisons, memberships, zones, phases, `is known`, temporal operators."""

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.condition_nodes import Part, children, walk
from rtshcua.ground.checker.fitting import declaration_labels, stored
from rtshcua.ground.checker.name_scope import LOCAL_TIME, PHASE, Argument, Scope
from rtshcua.ground.checker.ranges import check_compared, check_ends
from rtshcua.ground.checker.types import DURATION, LENGTH, MISSION_PHASE, POSITION, TIME_OF_DAY, ZONE, Kind, Type, Typed
from rtshcua.ground.checker.values import typed, typed_range, unknown_member
from rtshcua.ground.checker.well_known import POSITION_SIGNAL
from rtshcua.model.flat.limits import MAX_WINDOW
from rtshcua.model.flat.zone import MAX_COORDINATE
from rtshcua.model.ir.expression import (
    Comparison,
    Condition,
    Edge,
    ForLast,
    Grow,
    Inside,
    Junction,
    Known,
    Near,
    Not,
    OneOf,
    Quantity,
    Reference,
    Value,
    Within,
    WithinLast,
)
from rtshcua.model.ir.places import ZoneDecl
from rtshcua.model.ir.signals import SignalDecl
from rtshcua.model.quantity import Datum, Dimension, display


def check_inside(scope: Scope, node: Inside) -> None:
    """Check `inside` and `outside`: of the vehicle's position, or of a position or zone argument."""
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
            f"`{scope.report.text(node.subject.span)}` cannot be inside or outside a zone",
            help=f"rename the signal to `{POSITION_SIGNAL}`: only that signal is the vehicle's position"
            if isinstance(found, SignalDecl) and subject.type == POSITION
            else f"use `{POSITION_SIGNAL}`, or an argument that is a position or a zone",
            labels=declaration_labels(scope, node.subject),
        )
    elif is_argument and not isinstance(scope.find(region.name), ZoneDecl):
        scope.report.add(
            codes.BAD_SUBJECT,
            node.region.span,
            "an argument can only be compared with a declared zone, not with another argument",
            help=f"write a declared zone instead of `{region.name}`, or move the rule into a template, whose "
            "parameters stand for declared zones",
            labels=declaration_labels(scope, region),
        )


def _margin(scope: Scope, node: Value) -> None:
    """Check a margin: a constant length in whole mm."""
    found = typed(scope, node)
    if found is None:
        return
    text = scope.report.text(node.span)
    if found.type != LENGTH:
        scope.report.add(
            codes.DIMENSION_MISMATCH,
            node.span,
            f"`{text}` is {found.type.describe()}; a zone can only grow by a length",
            help="write a length, such as `15 m`",
            labels=declaration_labels(scope, node),
        )
    elif found.constant is None:
        scope.report.add(
            codes.NOT_CONSTANT,
            node.span,
            f"`{text}` is not known before the flight",
            help="write a constant length, such as `15 m`, or a parameter of a template or a mission",
            labels=declaration_labels(scope, node),
        )
    elif abs(found.constant) > MAX_COORDINATE:
        scope.report.add(codes.NUMBER_SIZE, node.span, f"`{text}` is larger than the local plane")
    else:
        stored(scope, node, found.type, found.constant)


_HELP = "write `phase == inspection`, `phase != inspection` or `phase in {departure, inspection}`"


def is_phase(scope: Scope, node: Value) -> bool:
    """Whether a value is the mission's phase."""
    return isinstance(node, Reference) and node.name == PHASE and scope.find(PHASE) is None


def is_about_phase(part: Part) -> bool:
    """Whether a condition itself, not its children, reads the mission's phase."""
    match part:
        case Comparison():
            subject = part.left
        case Within() | OneOf():
            subject = part.subject
        case _:
            return False
    return isinstance(subject, Reference) and subject.name == PHASE


def phase_compared(scope: Scope, node: Comparison) -> None:
    """Check `phase == x` and `phase != x`."""
    name = node.right
    if not is_phase(scope, node.left):
        _report(scope, node.left, "`phase` must be the left side of a comparison")
    elif node.operator not in ("==", "!="):
        scope.report.add(codes.PHASE_NAME, node.span, "phases have no order", help=_HELP)
    elif not isinstance(name, Reference) or name.name in (PHASE, LOCAL_TIME) or "." in name.name:
        _report(scope, name, f"`{scope.report.text(name.span)}` is not the name of a phase")


def phase_in_range(scope: Scope, node: Within) -> None:
    """Report a range of phases."""
    _report(scope, node.range.low, "`phase` cannot be in a range: phases have no order")


def _report(scope: Scope, node: Value, message: str) -> None:
    scope.report.add(codes.PHASE_NAME, node.span, message, help=_HELP)


def check_known(scope: Scope, node: Known) -> None:
    """Report an `is known` of anything but a signal."""
    if typed(scope, node.subject) is None or isinstance(scope.find(node.subject.name), SignalDecl):
        return
    scope.report.add(
        codes.WRONG_KIND,
        node.subject.span,
        f"`{node.subject.name}` is not a signal and is always known",
        help="use `is known` with a signal, as in `position is known`",
        labels=declaration_labels(scope, node.subject),
    )


def check_unturned(scope: Scope, node: Not | Edge) -> None:
    """Report each `is known` under a `not` or an edge."""
    word = "not" if isinstance(node, Not) else "rising" if node.rising else "falling"
    for part in walk(node.operand):
        if isinstance(part, Known):
            scope.report.add(
                codes.TURNED_KNOWN,
                part.span,
                f"`{scope.report.text(part.span)}` is true or unknown, never false, so `{word}` has no effect on it",
                help="require that the signal is known; the `fallback` of the contract handles an unknown signal",
                labels=[(node.span, f"under this `{word}`")],
            )


def _enumeration(scope: Scope, node: Value) -> Type | None:
    """The enumeration type of a name's declaration, if any."""
    if isinstance(node, Reference):
        found = scope.find(node.name)
        if found is not None:
            type = scope.type_of(found)
            if type is not None and type.kind is Kind.ENUMERATION:
                return type
    return None


def _names_type(scope: Scope, node: Value, other: Value) -> bool:
    """Whether the name of an enumeration, instead of a signal, is compared with one of its members."""
    if not isinstance(node, Reference) or not isinstance(other, Reference) or scope.find(node.name) is not None:
        return False
    enum = scope.symbols.enums.get(node.name)
    return enum is not None and any(member.name.text == other.name for member in enum.members)


def check_comparison(scope: Scope, node: Comparison) -> None:
    """Check `left operator right`."""
    if is_phase(scope, node.left):
        phase_compared(scope, node)
        return
    asked = _enumeration(scope, node.left)
    for enum, member in ((node.left, node.right), (node.right, node.left)):
        if _names_type(scope, enum, member):  # only the enumeration is reported, the member is right
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
    """Check that both sides have the same dimension and datum; a literal length becomes an altitude above home."""
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
            f"cannot compare {left.type.describe()} with {right.type.describe()}",
            help="add the length to an altitude" if _lengths(left, right) else None,
            labels=[*declaration_labels(scope, node.left), *declaration_labels(scope, node.right)],
        )
    if len(scope.report.found) == before:
        check_compared(scope, node, left, right)


def _lengths(left: Typed, right: Typed) -> bool:
    return {left.type.dimension, right.type.dimension} == {Dimension.LENGTH, Dimension.ALTITUDE}


def _enumerated(scope: Scope, node: Comparison, left: Typed, right: Typed) -> None:
    """Check an enumeration against one of its constants; only an `enum` has an order."""
    enumeration = left.type.enumeration
    assert enumeration is not None
    if (left.constant is None) == (right.constant is None):
        scope.report.add(
            codes.NOT_COMPARABLE,
            node.span,
            "a value of an enumeration can only be compared with one of its names",
            help="write one of " + ", ".join(f"`{member}`" for member in enumeration.members),
            labels=declaration_labels(scope, node.left),
        )
    elif not enumeration.ordered and node.operator not in ("==", "!="):
        scope.report.add(
            codes.NOT_COMPARABLE,
            node.span,
            f"the values of `{enumeration.name}` have no order",
            help="compare them with `==`, `!=` or `in { ... }`",
            labels=[(enumeration.declared, "declared here")],
        )


def _clock(scope: Scope, node: Comparison, left: Typed, right: Typed) -> None:
    """Check `local time` against a constant time of day, with an order only."""
    if left.type != right.type:
        odd, other = (node.left, left) if right.type == TIME_OF_DAY else (node.right, right)
        message = (
            f"cannot compare `{scope.report.text(odd.span)}`, {other.type.describe()}, with {TIME_OF_DAY.describe()}"
        )
        help = "compare a time of day with `local time`, as in `local time >= 19:00`"
    elif (left.constant is None) == (right.constant is None):
        message = "`local time` can only be compared with a constant time of day"
        help = "write `local time >= 19:00`, or `local time in 08:00 .. 18:00`"
    elif node.operator in ("==", "!="):
        message = f"`{node.operator}` compares with a single moment, which no clock can measure exactly"
        help = "write a window, such as `local time in 08:00 .. 08:10`, or a comparison, such as `local time >= 08:00`"
    else:
        return
    scope.report.add(codes.NOT_COMPARABLE, node.span, message, help=help, labels=declaration_labels(scope, node.left))


def _incomparable(scope: Scope, node: Comparison, left: Typed) -> None:
    help = "use `inside` or `outside` with a zone" if left.type in (ZONE, POSITION) else None
    scope.report.add(
        codes.NOT_COMPARABLE,
        node.span,
        f"`{node.operator}` compares numbers and enumerations; `{scope.report.text(node.left.span)}` is "
        f"{left.type.describe()}",
        help=help,
        labels=declaration_labels(scope, node.left),
    )


def check_within(scope: Scope, node: Within) -> None:
    """Check `subject in low .. high`."""
    if is_phase(scope, node.subject):
        phase_in_range(scope, node)
        return
    subject = typed(scope, node.subject)
    if subject is None:
        return
    kind = subject.type.kind
    if _has_no_range(scope, node, subject):
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
            "a range of times needs `local time` and two constant ends",
            help="write `local time in 08:00 .. 18:00`",
        )


def _has_no_range(scope: Scope, node: Within, subject: Typed) -> bool:
    """Whether a subject cannot be in a range; reports it."""
    kind, enumeration = subject.type.kind, subject.type.enumeration
    labels = declaration_labels(scope, node.subject)
    text, type = scope.report.text(node.subject.span), subject.type.describe()
    if node.days and kind is not Kind.TIME_OF_DAY:
        message = f"only `local time` can have days of the week; `{text}` is {type}"
        help = "write `local time in 08:00 .. 18:00 on monday .. friday`"
    elif kind in (Kind.ZONE, Kind.POSITION):
        message = f"`{text}` is {type}; a range needs a number"
        help = "use `inside` or `outside` with a zone"
    elif enumeration is not None and not enumeration.ordered:
        message, help = f"the values of `{enumeration.name}` have no order", "write `in { ... }`"
        labels = [(enumeration.declared, "declared here")]
    else:
        return False
    scope.report.add(codes.NOT_COMPARABLE, node.span, message, help=help, labels=labels)
    return True


def check_one_of(scope: Scope, node: OneOf) -> None:
    """Check `subject in {a, b}`."""
    if is_phase(scope, node.subject):
        return  # any name may be that of a phase
    subject = typed(scope, node.subject)
    if subject is None:
        return
    enumeration = subject.type.enumeration
    if enumeration is None:
        scope.report.add(
            codes.NOT_COMPARABLE,
            node.subject.span,
            f"`in {{ ... }}` needs a value of an enumeration, not {subject.type.describe()}",
            help="write `in LOW .. HIGH` for numbers" if subject.type.kind is Kind.NUMBER else None,
            labels=declaration_labels(scope, node.subject),
        )
        return
    for name in node.names:
        if name.text not in enumeration.members:
            unknown_member(scope, name.span, name.text, enumeration)


Temporal = ForLast | WithinLast | Near | Edge


def check_window(scope: Scope, window: Quantity) -> None:
    """Check a window: a duration above zero, within the onboard history."""
    if typed(scope, window, DURATION) is None or 0 < window.value <= MAX_WINDOW:
        return
    longer = window.value > 0
    scope.report.add(
        codes.WINDOW_LENGTH,
        window.span,
        f"the window `{scope.report.text(window.span)}` is longer than the onboard history"
        if longer
        else f"the window `{scope.report.text(window.span)}` is empty",
        help=f"write a window above `0 s`, at most `{display(MAX_WINDOW, Dimension.DURATION)}`",
    )


def check_observable(scope: Scope, node: Temporal) -> None:
    """Report the phase, arguments and inexact zones under a temporal operator, at any depth."""
    for part in walk(node):
        if is_about_phase(part):
            scope.report.add(
                codes.TIMED_ARGUMENT,
                part.span,
                "a temporal condition cannot read the phase",
                help="test the phase separately, as in `phase == inspection and ... for the last 3 s`",
                labels=[(node.span, "this is observed also without a mission")],
            )
        elif isinstance(part, Reference) and isinstance(found := scope.find(part.name), Argument):
            scope.report.add(
                codes.TIMED_ARGUMENT,
                part.span,
                f"a temporal condition cannot read the argument `{part.name}`",
                help="compare signals, zones and times with constants",
                labels=[
                    (node.span, "this is observed also when the skill does not run"),
                    (found.declaration.span, f"`{part.name}` is declared here"),
                ],
            )
        elif isinstance(part, Edge):
            _exact(scope, part)


def _exact(scope: Scope, edge: Edge) -> None:
    """Report an inexact zone under an edge: a grown one, or one with a band above sea if the elevation of a vehicle has
    an error.
    """
    for part in walk(edge.operand):
        if isinstance(part, Inside) and not isinstance(part.region, Grow):
            _banded(scope, edge, part.region)
        if isinstance(part, Grow):
            scope.report.add(
                codes.TIMED_ARGUMENT,
                part.span,
                f"`{'rising' if edge.rising else 'falling'}` cannot read a grown zone",
                help="declare a zone with the grown shape",
                labels=[(edge.span, "an edge needs an exact zone, and a grown zone is a safe approximation")],
            )


def _banded(scope: Scope, edge: Edge, region: Reference) -> None:
    zone = scope.find(region.name)
    bands = (zone.floor, zone.ceiling) if isinstance(zone, ZoneDecl) else ()
    above_sea = next((each for each in bands if each is not None and each.datum is Datum.SEA), None)
    errors = (each.elevation_within for each in scope.symbols.vehicles.values())
    error = next((each for each in errors if each is not None and each.value > 0), None)
    if above_sea is None or error is None:
        return
    scope.report.add(
        codes.TIMED_ARGUMENT,
        region.span,
        f"`{'rising' if edge.rising else 'falling'}` cannot read `{region.name}`, whose height above sea is not known "
        "exactly",
        help="declare a zone whose floor and ceiling are above home",
        labels=[
            (edge.span, "an edge needs an exact zone"),
            (above_sea.span, "above sea"),
            (error.span, "the error of the elevation"),
        ],
    )


def check_condition(scope: Scope, node: Condition, *, observed: bool = False) -> None:
    """Report all findings on a condition; `observed` if it is under a temporal operator."""
    match node:
        case Comparison():
            check_comparison(scope, node)
        case Within():
            check_within(scope, node)
        case OneOf():
            check_one_of(scope, node)
        case Inside():
            check_inside(scope, node)
        case Known():
            check_known(scope, node)
        case Not():
            check_unturned(scope, node)
            check_condition(scope, node.operand, observed=observed)
        case Junction():
            for operand in node.operands:
                check_condition(scope, operand, observed=observed)
        case ForLast() | WithinLast() | Near() | Edge():
            if not isinstance(node, Edge):
                check_window(scope, node.window)
            if isinstance(node, Edge):
                check_unturned(scope, node)
            if not observed:
                check_observable(scope, node)
            for operand in (node.left, node.right) if isinstance(node, Near) else (node.operand,):
                check_condition(scope, operand, observed=True)


def references(node: Part) -> list[Reference]:
    """All names that a condition refers to, in source order, without `phase` and the names of phases."""
    parts = tuple(walk(node))
    phases = {name for part in parts if is_about_phase(part) for name in children(part)}
    return [part for part in parts if isinstance(part, Reference) and part not in phases]
