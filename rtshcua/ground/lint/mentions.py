"""Which names a piece of a source mentions. It may say too many, never too few: what is mentioned counts as used."""

from collections.abc import Iterator
from functools import cache
from typing import Any

from rtshcua.model.ir.expression import Reference
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.places import ENTRY
from rtshcua.model.ir.program import Unit
from rtshcua.model.ir.skills import Parameter
from rtshcua.model.ir.tests import Named


def mentions(*nodes: Node | None) -> frozenset[str]:
    """The names that nodes mention, but for those that they give: to a declaration, a parameter, an argument.

    `bridge_a.entry` mentions `bridge_a` too. The type of a parameter is a word of the language.
    """
    found: set[str] = set()
    for node in nodes:
        _mentioned(node, found)
    return frozenset(found)


def mentioned_by(unit: Unit) -> frozenset[str]:
    """The names that the declarations of a file mention."""
    return mentions(*_declarations(unit))


def _declarations(unit: Unit) -> Iterator[Node]:
    yield from (*unit.enums, *unit.signals, *unit.zones, *unit.vehicles)
    yield from (*unit.skills, *unit.templates, *unit.policies, *unit.missions)
    yield from (*unit.nominals, *unit.tests, *unit.scenarios, *unit.sizes)


def _mentioned(node: Any, found: set[str]) -> None:
    kind = type(node)
    if kind is tuple:
        for part in node:
            _mentioned(part, found)
    elif kind is Reference:
        found.add(node.name)
        found.add(node.name.removesuffix(ENTRY))
    elif kind is Name:
        found.add(node.text)
    elif kind is Named:  # in a test: a signal, or a parameter of a skill
        found.add(node.name.text)
    elif isinstance(node, Node):
        for field in _fields(type(node)):
            _mentioned(getattr(node, field), found)


@cache
def _fields(kind: type[Node]) -> tuple[str, ...]:
    """The fields of a node that may mention something."""
    given = ("span", "name", "type") if issubclass(kind, Parameter) else ("span", "name")
    return tuple(field for field in kind.__struct_fields__ if field not in given)
