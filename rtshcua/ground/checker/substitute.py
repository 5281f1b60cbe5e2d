"""The values of parameters in the place of their names."""

from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

from rtshcua.model.ir.expression import Reference, Value
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.places import ENTRY
from rtshcua.model.ir.policies import Rule

N = TypeVar("N", bound=Node)


def substitute(node: N, values: Mapping[str, Value]) -> N:
    """The node with the value in the place of every reference to a name of `values`.

    What is put in carries the span of the reference, so that a finding underlines what stands in the text. `area.entry`
    becomes the entry of the zone that `area` stands for. A node without such a reference is given back as it is.
    """
    return _substituted(node, values) if values else node


def substitute_roles(rule: Rule, roles: Mapping[str, str]) -> Rule:
    """The rule with the roles that the names of `roles` stand for."""
    changes: dict[str, Any] = {"roles": tuple(_role(name, roles) for name in rule.roles)}
    if rule.approver is not None:
        changes["approver"] = _role(rule.approver, roles)
    if rule.another is not None:
        changes["another"] = _role(rule.another, roles)
    return rule.copied(**changes)


def names_in(node: Node) -> frozenset[str]:
    """All names that a node refers to."""
    return frozenset(_names_in(node))


def _names_in(node: Any) -> Iterator[str]:
    if isinstance(node, Reference):
        yield node.name
        yield node.name.removesuffix(ENTRY)
    elif isinstance(node, Node):
        for name in type(node).__struct_fields__:
            yield from _names_in(getattr(node, name))
    elif type(node) is tuple:
        for part in node:
            yield from _names_in(part)


def _role(name: Name, roles: Mapping[str, str]) -> Name:
    role = roles.get(name.text)
    return name if role is None else Name(span=name.span, text=role)


def _substituted(node: Any, values: Mapping[str, Value]) -> Any:
    if isinstance(node, Reference):
        return _reference(node, values)
    if isinstance(node, Node):
        changes: dict[str, Any] = {}
        for name in type(node).__struct_fields__:
            old = getattr(node, name)
            new = _substituted(old, values)
            if new is not old:
                changes[name] = new
        return node.copied(**changes) if changes else node
    if type(node) is tuple:
        parts = tuple(_substituted(each, values) for each in node)
        return node if all(new is old for new, old in zip(parts, node, strict=True)) else parts
    return node


def _reference(node: Reference, values: Mapping[str, Value]) -> Value:
    value = values.get(node.name)
    if value is not None:
        return value.copied(span=node.span)
    if node.name.endswith(ENTRY):
        zone = values.get(node.name.removesuffix(ENTRY))
        if isinstance(zone, Reference):
            return Reference(span=node.span, name=zone.name + ENTRY)
    return node
