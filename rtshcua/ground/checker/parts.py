"""What conditions and values are made of: one place that knows every node."""

from collections.abc import Iterator

from rtshcua.model.ir.expression import (
    Arithmetic,
    Comparison,
    Condition,
    Edge,
    ForLast,
    Function,
    Grow,
    Inside,
    Junction,
    Known,
    Near,
    Not,
    OneOf,
    Value,
    Within,
    WithinLast,
)

Part = Condition | Value | Grow


def children(node: Part) -> tuple[Part, ...]:
    """The conditions and values that a node consists of, in source order."""
    match node:
        case Arithmetic() | Comparison() | Near():
            return (node.left, node.right)
        case Function() | Junction():
            return node.operands
        case Within():
            return (node.subject, node.range.low, node.range.high)
        case OneOf() | Known():
            return (node.subject,)
        case Inside():
            return (node.subject, node.region)
        case Grow():
            return (node.zone, node.margin)
        case Not() | ForLast() | WithinLast() | Edge():
            return (node.operand,)
        case _:
            return ()


def walk(node: Part) -> Iterator[Part]:
    """A node and all that it consists of, at any depth, in source order."""
    stack = [node]
    while stack:
        part = stack.pop()
        yield part
        stack += reversed(children(part))
