"""Names that violate the naming convention (E1302), and repeated numbers (E1304).

E1302: names are `lower_snake_case`. The name of a signal consists of such parts with dots between them. Roles and
proposers keep the names of their keys. Members of an enumeration that mirrors a MAVLink enumeration may keep its
spelling.

E1304: several conditions compare one quantity with the same number. A later edit may miss one of them.
"""

import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple, TypeAlias

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.condition_nodes import walk
from rtshcua.ground.checker.context import Parametric
from rtshcua.ground.lint.lint_input import LintInput
from rtshcua.model.ir.expression import Comparison, Condition, Grow, Quantity, Reference, Value, Within
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.policies import PolicyDecl, TemplateDecl
from rtshcua.model.ir.program import Unit
from rtshcua.model.ir.skills import SkillDecl
from rtshcua.model.quantity import Datum, Dimension

_PART = re.compile(r"(?!.*__)[a-z][a-z0-9_]*+(?<!_)")
_HUMP = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")


def misnamed_declarations(subject: LintInput) -> Iterator[Diagnostic]:
    """Report every name that violates the naming convention (E1302)."""
    for unit in subject.requested:
        for signal in unit.signals:
            if not all(_PART.fullmatch(part) for part in signal.name.text.split(".")):
                yield _misnamed(
                    signal.name, ".".join(map(_snake, signal.name.text.split("."))), "parts of `lower_case`"
                )
        for name in _names(subject, unit):
            if not _PART.fullmatch(name.text):
                yield _misnamed(name, _snake(name.text), "`lower_case`")


def _names(subject: LintInput, unit: Unit) -> Iterator[Name]:
    """Yield the names that a file declares, except those of signals."""
    for declarations in (
        unit.enums, unit.zones, unit.vehicles, unit.skills, unit.templates, unit.policies, unit.missions
    ):  # fmt: skip
        for declaration in declarations:
            yield declaration.name
    for enum in unit.enums:
        for member in enum.members:
            if enum.dialect is None or not member.name.text.isupper():
                yield member.name
    owners: list[Parametric] = [*unit.skills, *unit.templates, *unit.missions]
    for owner in owners:
        for parameter in owner.parameters:
            yield parameter.name
            yield from (choice for choice in parameter.choices if choice.text not in subject.symbols.declared)
    for skill in unit.skills:
        yield from (size.name for size in skill.sizes)
    for mission in unit.missions:
        yield from (phase.name for phase in mission.phases)


def _misnamed(name: Name, better: str, style: str) -> Diagnostic:
    help = f"write it as `{better}`" if all(map(_PART.fullmatch, better.split("."))) else None
    return Diagnostic(codes.NAMING, f"`{name.text}` violates the naming convention: {style}", name.span, help)


def _snake(text: str) -> str:
    return re.sub(r"_+", "_", _HUMP.sub("_", text)).strip("_").lower()


NumberOwner: TypeAlias = PolicyDecl | TemplateDecl | SkillDecl

#: the number of conditions from which a repeated number is reported
MIN_REPEATS = 3


class NumberUse(NamedTuple):
    """A quantity as written in the source, and the number with which it is compared."""

    quantity: str
    value: int
    dimension: Dimension
    datum: Datum | None


def repeated_numbers(subject: LintInput) -> Iterator[Diagnostic]:
    """Report each number that several conditions of one declaration compare with the same quantity (E1304)."""
    for unit in subject.requested:
        owners: list[NumberOwner] = [*unit.policies, *unit.templates, *unit.skills]
        for owner in owners:
            yield from _repeated(subject, owner)


def _repeated(subject: LintInput, owner: NumberOwner) -> Iterator[Diagnostic]:
    found: dict[NumberUse, list[Span]] = {}
    for condition in _conditions(owner):
        here: dict[NumberUse, Span] = {}
        for other, number in _numbers(condition):
            key = NumberUse(_written(subject, other), number.value, number.dimension, number.datum)
            here.setdefault(key, number.span)
        for key, span in here.items():
            found.setdefault(key, []).append(span)
    for key, spans in found.items():
        if len(spans) >= MIN_REPEATS:
            written = _written(subject, spans[0])
            yield Diagnostic(
                codes.REPEATED_NUMBER,
                f"{len(spans)} conditions compare `{key.quantity}` with `{written}`",
                spans[0],
                _help(owner, written),
                tuple(Label(span, "again here") for span in spans[1:]),
            )


def _help(owner: NumberOwner, number: str) -> str:
    if isinstance(owner, PolicyDecl):
        return "write the number once: merge the rules, or use a template with a parameter"
    kind = "template" if isinstance(owner, TemplateDecl) else "skill"
    return f"write the number once: give the {kind} a parameter with `{number}` as its default"


def _conditions(owner: NumberOwner) -> Iterable[Condition]:
    if isinstance(owner, SkillDecl):
        return [clause.condition for clause in (*owner.require, *owner.assume, *owner.maintain)]
    found = [rule.when for rule in owner.rules]
    found += [each.when for each in owner.delegations] if isinstance(owner, PolicyDecl) else []
    return [condition for condition in found if condition is not None]


def _numbers(condition: Condition) -> Iterator[tuple[Span, Quantity]]:
    """Yield the numbers of a condition except zero, each with the span of the value with which it is compared."""
    for part in walk(condition):
        pairs: list[tuple[Value | Reference, Value]] = []
        match part:
            case Comparison():
                pairs = [(part.left, part.right), (part.right, part.left)]
            case Within():
                pairs = [(part.subject, part.range.low), (part.subject, part.range.high)]
            case Grow():
                pairs = [(part.zone, part.margin)]
        for other, number in pairs:
            if isinstance(number, Quantity) and number.value != 0 and not isinstance(other, Quantity):
                yield other.span, number


def _written(subject: LintInput, span: Span) -> str:
    return " ".join(subject.program.sources[span.file].slice(span).split())
