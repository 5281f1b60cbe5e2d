"""Conditions as trees: always and never true, their atoms, the same with other atoms, their conjuncts and conflicts."""

from collections.abc import Callable, Iterator, Sequence
from typing import Final, TypeVar

from rtshcua.decision import tree
from rtshcua.model.ir.expression import Condition, Junction

#: the condition of a rule without one
ALWAYS: Final = tree.AtMost((), 0)
NEVER: Final = tree.AtMost((), -1)


def signed_atoms(node: tree.Node, positive: bool = True) -> Iterator[tuple[tree.Atom, bool]]:
    """The atoms of a condition, from left to right, and whether an even number of `not` stands before each."""
    match node:
        case tree.Both(left, right) | tree.Either(left, right):
            yield from signed_atoms(left, positive)
            yield from signed_atoms(right, positive)
        case tree.Negation(operand):
            yield from signed_atoms(operand, not positive)
        case _:
            yield node, positive


def replace_atoms(node: tree.Node, atom: Callable[[tree.Atom, bool], tree.Node], positive: bool = True) -> tree.Node:
    """The condition with what `atom` gives for each atom; it is told whether an even number of `not` stands before."""
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
    """In source order; a condition that is no `and` is its own and only conjunct."""
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
    """A subset of parts which are impossible together, such that without any one of them they are not proved to be.

    By deletion: each part is left out if the others are impossible without it.
    """
    kept = list(parts)
    for part in parts:
        without = [each for each in kept if each is not part]
        if without and impossible(without):
            kept = without
    return kept
