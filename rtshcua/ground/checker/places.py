"""What is asked to be inside or outside of a zone, and by how much a zone may grow."""

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.fitting import declaration_labels, stored
from rtshcua.ground.checker.scope import Argument, Scope
from rtshcua.ground.checker.types import LENGTH, POSITION, ZONE
from rtshcua.ground.checker.values import typed
from rtshcua.model.flat.zone import MAX_COORDINATE
from rtshcua.model.ir.expression import Grow, Inside, Reference, Value
from rtshcua.model.ir.places import ZoneDecl
from rtshcua.model.ir.signals import SignalDecl

#: the signal whose place is the vehicle's
POSITION_SIGNAL = "position"


def check_inside(scope: Scope, node: Inside) -> None:
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
            help=f"of all signals, it is `{POSITION_SIGNAL}` that is read as the vehicle's place: call this one so"
            if isinstance(found, SignalDecl) and subject.type == POSITION
            else f"ask it of `{POSITION_SIGNAL}`, or of an argument that is a position or a zone",
            labels=declaration_labels(scope, node.subject),
        )
    elif is_argument and not isinstance(scope.find(region.name), ZoneDecl):
        scope.report.add(
            codes.BAD_SUBJECT,
            node.region.span,
            "an argument is compared with a declared zone only, not with another argument",
            help=f"write a declared zone instead of `{region.name}`, in which only `{POSITION_SIGNAL}` can be; "
            "or make this a rule of a template, whose parameters stand for declared zones",
            labels=declaration_labels(scope, region),
        )


def _margin(scope: Scope, node: Value) -> None:
    """A margin is a length that is known at compile time, in whole mm."""
    found = typed(scope, node)
    if found is None:
        return
    text = scope.report.text(node.span)
    if found.type != LENGTH:
        scope.report.add(
            codes.DIMENSION_MISMATCH,
            node.span,
            f"a zone grows by a length, and `{text}` is {found.type.describe()}",
            help="write a length, such as `15 m`",
            labels=declaration_labels(scope, node),
        )
    elif found.constant is None:
        scope.report.add(
            codes.NOT_CONSTANT,
            node.span,
            f"a zone grows by what is known before the flight, and `{text}` is not",
            help="write a length, such as `15 m`, or the parameter of a template or a mission",
            labels=declaration_labels(scope, node),
        )
    elif abs(found.constant) > MAX_COORDINATE:
        scope.report.add(codes.NUMBER_SIZE, node.span, f"`{text}` is larger than the local plane")
    else:
        stored(scope, node, found.type, found.constant)
