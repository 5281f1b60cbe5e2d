"""Which names a piece of a source mentions. It may say too many, never too few: what is mentioned counts as used."""

from collections.abc import Iterator
from typing import Any

from rtshcua.ground.checker.scope import ENTRY
from rtshcua.model.ir.expression import Reference
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.program import Unit
from rtshcua.model.ir.skills import Parameter
from rtshcua.model.ir.tests import Named


def mentions(*nodes: Node | None) -> frozenset[str]:
    """The names that nodes mention, but for those that they give: to a declaration, a parameter, an argument.

    `bridge_a.entry` mentions `bridge_a` too. The type of a parameter is a word of the language.
    """
    return frozenset(name for node in nodes for name in _mentioned(node))


def mentioned_by(unit: Unit) -> frozenset[str]:
    """The names that the declarations of a file mention."""
    return mentions(*_declarations(unit))


def _declarations(unit: Unit) -> Iterator[Node]:
    yield from (*unit.enums, *unit.signals, *unit.zones, *unit.vehicles)
    yield from (*unit.skills, *unit.templates, *unit.policies, *unit.missions, *unit.nominals, *unit.tests)


def _mentioned(node: Any) -> Iterator[str]:
    if isinstance(node, Reference):
        yield node.name
        yield node.name.removesuffix(ENTRY)
    elif isinstance(node, Name):
        yield node.text
    elif isinstance(node, Named):  # in a test: a signal, or a parameter of a skill
        yield node.name.text
    elif isinstance(node, Node):
        for field in type(node).__struct_fields__:
            if field not in ("span", "name") and not (field == "type" and isinstance(node, Parameter)):
                yield from _mentioned(getattr(node, field))
    elif type(node) is tuple:
        for part in node:
            yield from _mentioned(part)
