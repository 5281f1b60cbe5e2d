"""Substitute values for names: parameters of a template or a mission, and sizes of a skill.

The sizes of `sizes goto(highest = 120 m)` are substituted when the symbol table is made, so later stages see no sizes.
A size is a number with its unit; a check compares it with the range of the size.
"""

from collections.abc import Iterator, Mapping
from typing import Any, TypeVar

from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.report import Report
from rtshcua.model.ir.expression import Arithmetic, Quantity, Reference, Value
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.places import ENTRY
from rtshcua.model.ir.policies import RuleDecl
from rtshcua.model.ir.skills import PicturesDecl, SizesDecl, SkillDecl

N = TypeVar("N", bound=Node)


def substitute(node: N, values: Mapping[str, Value]) -> N:
    """Return the node with values substituted for references to the names of `values`.

    A substituted value has the span of the reference, so that findings underline the source text. `area.entry` becomes
    the entry of the zone that replaces `area`. A node without such a reference is returned unchanged.
    """
    return _substituted(node, values) if values else node


def substitute_roles(rule: RuleDecl, roles: Mapping[str, str]) -> RuleDecl:
    """Return the rule with roles substituted for the names of `roles`."""
    changes: dict[str, Any] = {"roles": tuple(_role(name, roles) for name in rule.roles)}
    if rule.approver is not None:
        changes["approver"] = _role(rule.approver, roles)
    if rule.another is not None:
        changes["another"] = _role(rule.another, roles)
    return rule.copied(**changes)


def names_in(node: Node) -> frozenset[str]:
    """Return all names that a node refers to."""
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


def sized(skill: SkillDecl, given: SizesDecl | None) -> SkillDecl:
    """Return the skill with the values of its sizes: those of the program, else the defaults.

    Its `sizes` stay as declared; `sized` keeps parts that name a size without a value.
    """
    if not skill.sizes and not skill.sized:
        return skill
    values = sizes_of(skill, given)
    plain: SkillDecl = _summed(substitute(skill.copied(sizes=(), sized=()), values))
    named = {
        each.part: values[each.size.name].copied(span=each.size.span)
        for each in skill.sized
        if each.size.name in values
    }
    rest = tuple(each for each in skill.sized if each.part not in named)
    if plain.pictures is not None:
        shown = {part: named.pop(part) for part in PicturesDecl.__struct_fields__ if part in named}
        plain = plain.copied(pictures=plain.pictures.copied(**shown))
    return plain.copied(sizes=skill.sizes, sized=rest, **named)


def _summed(node: Any) -> Any:
    """A node with constant sums and differences computed, so that messages show a size as one number."""
    if isinstance(node, Node):
        parts = {name: getattr(node, name) for name in type(node).__struct_fields__}
        changes = {name: new for name, old in parts.items() if (new := _summed(old)) is not old}
        node = node.copied(**changes) if changes else node
        if isinstance(node, Arithmetic) and node.operator in ("+", "-"):
            left, right = node.left, node.right
            if isinstance(left, Quantity) and isinstance(right, Quantity) and _of_a_kind(left, right):
                value = left.value + (right.value if node.operator == "+" else -right.value)
                return left.copied(value=value, span=node.span)
    elif type(node) is tuple:
        items = tuple(map(_summed, node))
        return node if all(new is old for new, old in zip(items, node, strict=True)) else items
    return node


def _of_a_kind(left: Quantity, right: Quantity) -> bool:
    return left.dimension is right.dimension and right.datum is None


def named_at(report: Report, skill: SkillDecl, span: Span) -> str | None:
    """Return the name of the size at a span of a skill; None if there is none."""
    text = report.raw(span)
    return text if any(size.name.text == text for size in skill.sizes) else None


def sizes_of(skill: SkillDecl, given: SizesDecl | None) -> dict[str, Value]:
    """Return the values of the sizes of a skill, where known."""
    values: dict[str, Value] = {}
    written = {} if given is None else {each.name.text: each.value for each in reversed(given.given)}
    for size in skill.sizes:
        default, value = size.default, written.get(size.name.text)
        if isinstance(default, Quantity):
            fits = value is not None and value.dimension is default.dimension
            values.setdefault(size.name.text, value if value is not None and fits else default)
    return values
