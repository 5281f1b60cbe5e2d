"""E0323: the mission's phase is compared with names of phases, which are looked up nowhere."""

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.parts import Part
from rtshcua.ground.checker.scope import LOCAL_TIME, PHASE, Scope
from rtshcua.model.ir.expression import Comparison, OneOf, Reference, Value, Within

_HELP = "write `phase == inspection`, `phase != inspection` or `phase in {departure, inspection}`"


def is_phase(scope: Scope, node: Value) -> bool:
    """Whether a value is the mission's phase."""
    return isinstance(node, Reference) and node.name == PHASE and scope.find(PHASE) is None


def is_about_phase(part: Part) -> bool:
    """Whether a condition itself, not what it consists of, asks for the mission's phase; nothing else is called so."""
    match part:
        case Comparison():
            subject = part.left
        case Within() | OneOf():
            subject = part.subject
        case _:
            return False
    return isinstance(subject, Reference) and subject.name == PHASE


def phase_compared(scope: Scope, node: Comparison) -> None:
    """`phase == x`, `phase != x`."""
    name = node.right
    if not is_phase(scope, node.left):
        _report(scope, node.left, "the mission's phase stands on the left side of a comparison")
    elif node.operator not in ("==", "!="):
        scope.report.add(codes.PHASE_NAME, node.span, "the phases of a mission have no order", help=_HELP)
    elif not isinstance(name, Reference) or name.name in (PHASE, LOCAL_TIME) or "." in name.name:
        _report(scope, name, f"`{scope.report.text(name.span)}` is not the name of a phase")


def phase_in_range(scope: Scope, node: Within) -> None:
    """A phase is in no range."""
    _report(scope, node.range.low, "a phase is in no range: the phases of a mission have no order")


def _report(scope: Scope, node: Value, message: str) -> None:
    scope.report.add(codes.PHASE_NAME, node.span, message, help=_HELP)
