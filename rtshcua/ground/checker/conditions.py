"""Conditions are well typed, all through, and what is observed over time can be."""

from rtshcua.ground.checker.comparisons import check_comparison, check_one_of, check_within
from rtshcua.ground.checker.knowing import check_known, check_unturned
from rtshcua.ground.checker.parts import Part, children, walk
from rtshcua.ground.checker.phases import is_about_phase
from rtshcua.ground.checker.places import check_inside
from rtshcua.ground.checker.scope import Scope
from rtshcua.ground.checker.temporal import check_observable, check_window
from rtshcua.model.ir.expression import (
    Comparison,
    Condition,
    Edge,
    ForLast,
    Inside,
    Junction,
    Known,
    Near,
    Not,
    OneOf,
    Reference,
    Within,
    WithinLast,
)


def check_condition(scope: Scope, node: Condition, *, observed: bool = False) -> None:
    """Report everything in a condition that has no meaning; `observed` where a temporal operator stands around it."""
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
    """All names that a condition refers to, in source order; the names of phases are none, nor is `phase`."""
    parts = tuple(walk(node))
    phases = {name for part in parts if is_about_phase(part) for name in children(part)}
    return [part for part in parts if isinstance(part, Reference) and part not in phases]
