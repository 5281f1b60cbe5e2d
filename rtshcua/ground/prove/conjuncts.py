"""The conjuncts of a condition, each with what it was lowered to, and which conjuncts contradict each other."""

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from rtshcua.decision import tree
from rtshcua.model.ir.expression import Condition, Junction


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
