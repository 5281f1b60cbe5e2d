"""Helpers for trees of conditions: constants, atoms, conjuncts and minimal conflicts."""

from collections.abc import Callable, Iterator, Sequence
from typing import Final, TypeVar

from rtshcua.decision import tree
from rtshcua.model.ir.expression import Condition, Junction

#: the condition of a rule without one
ALWAYS: Final = tree.AtMost((), 0)
NEVER: Final = tree.AtMost((), -1)


def signed_atoms(node: tree.Node, positive: bool = True) -> Iterator[tuple[tree.Atom, bool]]:
    """Yield the atoms of a condition from left to right, each with whether it is under an even number of `not`."""
    match node:
        case tree.Both(left, right) | tree.Either(left, right):
            yield from signed_atoms(left, positive)
            yield from signed_atoms(right, positive)
        case tree.Negation(operand):
            yield from signed_atoms(operand, not positive)
        case _:
            yield node, positive


def replace_atoms(node: tree.Node, atom: Callable[[tree.Atom, bool], tree.Node], positive: bool = True) -> tree.Node:
    """Replace each atom by `atom(node, positive)`; `positive` is whether it is under an even number of `not`."""
    match node:
        case tree.Both(left, right):
            return tree.Both(replace_atoms(left, atom, positive), replace_atoms(right, atom, positive))
        case tree.Either(left, right):
            return tree.Either(replace_atoms(left, atom, positive), replace_atoms(right, atom, positive))
        case tree.Negation(operand):
            return tree.Negation(replace_atoms(operand, atom, not positive))
        case _:
            return atom(node, positive)


def conjuncts(condition: Condition, node: tree.Node) -> Iterator[tuple[Condition, tree.Node]]:
    """Yield the conjuncts in source order. A condition without `and` is its own only conjunct."""
    operands = condition.operands if isinstance(condition, Junction) and condition.operator == "and" else ()
    nodes: list[tree.Node] = []
    rest = node
    while len(nodes) + 1 < len(operands) and isinstance(rest, tree.Both):
        nodes.append(rest.right)
        rest = rest.left
    if not operands or len(nodes) + 1 < len(operands):
        yield condition, node
        return
    for operand, part in zip(operands, [rest, *reversed(nodes)], strict=True):
        yield from conjuncts(operand, part)


_T = TypeVar("_T")


def minimal_conflict(parts: Sequence[_T], impossible: Callable[[list[_T]], bool]) -> list[_T]:
    """Return a minimal subset of parts that are impossible together.

    A part is deleted if the others are impossible without it.
    """
    kept = list(parts)
    for part in parts:
        without = [each for each in kept if each is not part]
        if without and impossible(without):
            kept = without
    return kept
