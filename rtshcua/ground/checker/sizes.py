"""`sizes goto(highest = 120 m)`: the sizes of a skill in the places where its contract names them.

It is done wherever the names of a program are gathered, so that nothing after it knows of sizes, and needs no more than
what is written: a size is a number with its unit. Whether it is one that the skill may have, a check says.
"""

from typing import Any

from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.report import Report
from rtshcua.ground.checker.substitute import substitute
from rtshcua.model.ir.expression import Arithmetic, Quantity, Value
from rtshcua.model.ir.node import Node
from rtshcua.model.ir.skills import SizesDecl, SkillDecl


def sized(skill: SkillDecl, given: SizesDecl | None) -> SkillDecl:
    """The skill with what the program gives for its sizes, and else their defaults. Its `sizes` stay as they are
    declared; `sized` keeps what names no size that has a value.
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
    return plain.copied(sizes=skill.sizes, sized=rest, **named)


def _summed(node: Any) -> Any:
    """A node with the numbers that its sums and differences of numbers come to: a size is told as one number."""
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
    """The size of a skill that stands at a place; None where something else does."""
    text = report.raw(span)
    return text if any(size.name.text == text for size in skill.sizes) else None


def sizes_of(skill: SkillDecl, given: SizesDecl | None) -> dict[str, Value]:
    """The value of each size of a skill that has one."""
    values: dict[str, Value] = {}
    written = {} if given is None else {each.name.text: each.value for each in reversed(given.given)}
    for size in skill.sizes:
        default, value = size.default, written.get(size.name.text)
        if isinstance(default, Quantity):
            fits = value is not None and value.dimension is default.dimension
            values.setdefault(size.name.text, value if value is not None and fits else default)
    return values
