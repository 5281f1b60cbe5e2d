"""E1302: names are `lower_snake_case`, those of signals with dots between such parts.

Names that belong to something outside stay as they are: roles and proposers are those of keys, and the values of an
enumeration that mirrors one of MAVLink may be spelled as there.
"""

import re
from collections.abc import Iterator

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.ground.checker.context import Parametric
from rtshcua.ground.lint.subject import Subject
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.program import Unit

_PART = re.compile(r"(?!.*__)[a-z][a-z0-9_]*+(?<!_)")
_HUMP = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")


def check(subject: Subject) -> Iterator[Diagnostic]:
    """Report every name that is not written as names are."""
    for unit in subject.asked:
        for signal in unit.signals:
            if not all(_PART.fullmatch(part) for part in signal.name.text.split(".")):
                yield _found(signal.name, ".".join(map(_snake, signal.name.text.split("."))), "parts of `lower_case`")
        for name in _names(subject, unit):
            if not _PART.fullmatch(name.text):
                yield _found(name, _snake(name.text), "`lower_case`")


def _names(subject: Subject, unit: Unit) -> Iterator[Name]:
    """The names that a file gives, but for those of signals."""
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


def _found(name: Name, better: str, style: str) -> Diagnostic:
    help = f"write it as `{better}`" if all(map(_PART.fullmatch, better.split("."))) else None
    return Diagnostic(codes.NAMING, f"`{name.text}` is not written in {style}, as names are", name.span, help)


def _snake(text: str) -> str:
    return re.sub(r"_+", "_", _HUMP.sub("_", text)).strip("_").lower()
