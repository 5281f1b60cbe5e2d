"""E1301: what is declared, and used by nothing.

Parameters count where they stand: those of a template or a mission are read in it or nowhere, those of a skill also by
rules. Other declarations count only in a file that ends something, with a mission or a policy: any other is there to be
imported. What a policy offers to missions elsewhere is used: its zones and vehicles.
"""

from collections.abc import Iterator

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.ground.checker.context import Parametric
from rtshcua.ground.checker.symbols import WORDS, Declaration
from rtshcua.ground.checker.well_known import MEASURED, WELL_KNOWN
from rtshcua.ground.lint.mentions import mentions
from rtshcua.ground.lint.subject import Subject
from rtshcua.model.ir.program import Unit
from rtshcua.model.ir.skills import Parameter, SkillDecl

#: in the place of a skill's name: whichever
_ANY = "any"


def check(subject: Subject) -> Iterator[Diagnostic]:
    """Report parameters that nothing reads, and declarations that nothing uses."""
    used: dict[str, set[str]] = {}
    for name, declaration in subject.symbols.declared.items():
        for mention in mentions(declaration):
            used.setdefault(mention, set()).add(name)
    for unit in subject.asked:
        owners: list[Parametric] = [*unit.templates, *unit.missions]
        for owner in owners:
            yield from _parameters(owner, mentions(owner))
        if unit.missions or unit.policies:
            rules = _read_by_rules(subject) if unit.skills else {}
            for skill in unit.skills:
                of_rules = rules.get(skill.name.text, set()) | rules.get(_ANY, set())
                yield from _parameters(skill, mentions(skill) | of_rules)
            for declaration in _declared(subject, unit):
                if not used.get(declaration.name.text, set()) - {declaration.name.text}:
                    yield _unused(declaration)


def _declared(subject: Subject, unit: Unit) -> Iterator[Declaration]:
    """What a file declares for itself alone."""
    yield from unit.enums
    yield from (signal for signal in unit.signals if signal.name.text not in WELL_KNOWN.keys() | MEASURED.keys())
    yield from unit.templates
    if not subject.permits_any():
        yield from unit.skills
    if unit.missions:
        yield from unit.vehicles
        if not _any_zone(subject):
            yield from unit.zones


def _any_zone(subject: Subject) -> bool:
    """Whether a mission has a parameter whose value may be any zone, or the entry of any."""
    missions = subject.symbols.missions.values()
    return any(each.type.text in ("zone", "position") for mission in missions for each in mission.parameters)


def _read_by_rules(subject: Subject) -> dict[str, set[str]]:
    """By skill, the names that rules and delegations about it mention."""
    found: dict[str, set[str]] = {}
    for rule in subject.rules():
        read = mentions(rule.when)
        for skill in [name.text for name in rule.skills] or [_ANY]:
            found.setdefault(skill, set()).update(read)
    return found


def _parameters(owner: Parametric, read: frozenset[str]) -> Iterator[Diagnostic]:
    for parameter in owner.parameters:
        if parameter.name.text not in read:
            yield _unread(owner, parameter)


def _unread(owner: Parametric, parameter: Parameter) -> Diagnostic:
    by = "neither the skill nor a rule reads" if isinstance(owner, SkillDecl) else "nothing in it reads"
    return Diagnostic(
        codes.UNUSED,
        f"`{parameter.name.text}` is a parameter of `{owner.name.text}` that {by}",
        parameter.name.span,
        "remove it, or say what it is for",
    )


def _unused(declaration: Declaration) -> Diagnostic:
    return Diagnostic(
        codes.UNUSED,
        f"`{declaration.name.text}` is {WORDS[type(declaration)]} that nothing uses",
        declaration.name.span,
        "remove it; what is for others to import stands in a file without a mission or a policy",
    )
