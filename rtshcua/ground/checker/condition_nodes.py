"""The children of the nodes of conditions and values."""

from collections.abc import Callable, Iterator
from typing import Any

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


#: the fields with children, for each kind of node
_CHILDREN: dict[type, Callable[[Any], tuple[Part, ...]]] = {
    **dict.fromkeys((Arithmetic, Comparison, Near), lambda node: (node.left, node.right)),
    **dict.fromkeys((Function, Junction), lambda node: node.operands),
    Within: lambda node: (node.subject, node.range.low, node.range.high),
    **dict.fromkeys((OneOf, Known), lambda node: (node.subject,)),
    Inside: lambda node: (node.subject, node.region),
    Grow: lambda node: (node.zone, node.margin),
    **dict.fromkeys((Not, ForLast, WithinLast, Edge), lambda node: (node.operand,)),
}


def children(node: Part) -> tuple[Part, ...]:
    """The direct children of a node, in source order."""
    parts = _CHILDREN.get(type(node))
    return () if parts is None else parts(node)


def walk(node: Part) -> Iterator[Part]:
    """A node and all its descendants, in source order."""
    stack = [node]
    while stack:
        part = stack.pop()
        yield part
        stack += reversed(children(part))
