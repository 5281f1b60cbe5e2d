"""The same declarations and findings, so many characters further on: what stands behind an edit is not parsed again."""

from dataclasses import replace
from functools import cache
from types import UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from msgspec.structs import astuple, force_setattr

from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Span
from rtshcua.model.ir.node import Node

N = TypeVar("N", bound=Node)

_make = tuple.__new__


def moved(node: N, by: int) -> N:
    """A node and all below it, `by` characters further on. It goes around the constructor: a long text has thousands of
    nodes, and a person waits.
    """
    made: N = node.__copy__()  # type: ignore[attr-defined]  # of msgspec.Struct, which does not tell
    file, start, end = node.span
    force_setattr(made, "span", _make(Span, (file, start + by, end + by)))
    for name in _inner_of(type(node)):
        value = getattr(node, name)
        if type(value) is tuple:
            if value:
                force_setattr(made, name, _all(value, by))
        elif isinstance(value, Node):
            force_setattr(made, name, moved(value, by))
    return made


def parts(node: Node) -> tuple[Any, ...]:
    """What a node is made of, its span too."""
    return astuple(node)


@cache
def _inner_of(kind: type[Node]) -> tuple[str, ...]:
    """The parts of a kind of node that may be nodes, or tuples of them."""
    return tuple(name for name, hint in get_type_hints(kind).items() if name != "span" and not _is_plain(hint))


def _is_plain(hint: Any) -> bool:
    if get_origin(hint) in (Union, UnionType):
        return all(map(_is_plain, get_args(hint)))
    return get_origin(hint) is Literal or (isinstance(hint, type) and not issubclass(hint, Node | tuple))


def moved_finding(found: Diagnostic, by: int, since: int = 0, file: str | None = None) -> Diagnostic:
    """A finding with all its places at or behind `since` moved, those in `file` if it is given."""

    def place(span: Span) -> Span:
        where, start, end = span
        if file is not None and where != file:
            return span
        behind = start >= since
        return Span(where, start + by if behind else start, end + by if behind or end > since else end)

    return replace(
        found,
        span=None if found.span is None else place(found.span),
        labels=tuple(replace(label, span=place(label.span)) for label in found.labels),
        fixes=tuple(replace(fix, span=place(fix.span)) for fix in found.fixes),
    )


def same(one: Any, other: Any) -> bool:
    """Whether two nodes, or tuples of them, say the same, wherever they stand."""
    if isinstance(one, Node):
        if type(one) is not type(other):
            return False
        own = zip(parts(one), parts(other), strict=True)
        return all(type(mine) is Span or same(mine, its) for mine, its in own)
    if type(one) is tuple:
        return type(other) is tuple and len(one) == len(other) and all(map(same, one, other))
    return bool(one == other)


def _all(values: tuple[Any, ...], by: int) -> tuple[Any, ...]:
    return tuple([moved(each, by) if isinstance(each, Node) else _inner(each, by) for each in values])


def _inner(value: Any, by: int) -> Any:
    return _all(value, by) if type(value) is tuple else value
