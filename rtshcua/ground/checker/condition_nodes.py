"""What conditions and values are made of: one place that knows every node."""

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


#: of each kind of node that consists of others, which
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
    """The conditions and values that a node consists of, in source order."""
    parts = _CHILDREN.get(type(node))
    return () if parts is None else parts(node)


def walk(node: Part) -> Iterator[Part]:
    """A node and all that it consists of, at any depth, in source order."""
    stack = [node]
    while stack:
        part = stack.pop()
        yield part
        stack += reversed(children(part))
