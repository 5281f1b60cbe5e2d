"""The conjuncts of a condition as they are written, each with what it was lowered to."""

from collections.abc import Iterator

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
