"""Unused declarations and parameters (E1301), unused imports (E1305), and pictures that nobody takes (E1314).

E1301: a template or a mission must read its parameters. A parameter of a skill must be read by the skill or by a rule.
Other declarations are reported only in a file with a mission or a policy, since any other file may exist to be
imported. Zones and vehicles are not reported in a file with a policy, since missions in other files use them.

E1305: an import is used if the importing file mentions a declaration of the imported file, or if a remaining file
mentions a declaration that only this import provides. A policy also uses, without mention, its zones, its vehicle, the
signals that every flight reads, and under `permit any` all skills. A file without a mission or a policy may import for
the files that import it. There an import is unused only if other imports provide all of its files. All imports of a
file without declarations are used. Other projects may import a file, so a deletion is safe only if another import
provides everything that the deleted one does.

E1314: a skill states how often pictures are taken, and commands no camera to take them.
"""

from collections.abc import Iterable, Iterator
from functools import cache
from typing import Any

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Applicability, Diagnostic, Fix
from rtshcua.diagnostics.removal import whole_line
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.context import Parametric
from rtshcua.ground.checker.symbols import WORDS, Declaration
from rtshcua.ground.checker.well_known import MEASURED, WELL_KNOWN
from rtshcua.ground.lint.lint_input import LintInput
from rtshcua.ground.pipeline.closure import Imports
from rtshcua.ground.prove.commanded_pictures import takes_pictures
from rtshcua.model.ir.expression import Reference
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.places import ENTRY
from rtshcua.model.ir.program import Import, Unit
from rtshcua.model.ir.skills import ParameterDecl, SkillDecl
from rtshcua.model.ir.tests import Named


def untaken_pictures(subject: LintInput) -> Iterator[Diagnostic]:
    """Report pictures with a spacing that no command of their skill takes (E1314)."""
    for skill in (each for unit in subject.requested for each in unit.skills):
        pictures = skill.pictures
        spaced = pictures is not None and (pictures.every or any(each.part == "every" for each in skill.sized))
        if pictures is not None and spaced and not takes_pictures(skill):
            yield Diagnostic(
                codes.UNTAKEN_PICTURES,
                f"`{skill.name.text}` states pictures, but commands no camera to take them",
                pictures.span,
                help="add `emits MAV_CMD_IMAGE_START_CAPTURE to camera with param3 = 1 every ...`; if the camera "
                "triggers itself, ignore this with that reason",
            )


def mentions(*nodes: Node | None) -> frozenset[str]:
    """Return the names that nodes refer to. Names of declarations, parameters and arguments are not references.

    `bridge_a.entry` mentions `bridge_a` too. The type of a parameter is a keyword, not a name.
    """
    found: set[str] = set()
    for node in nodes:
        _mentioned(node, found)
    return frozenset(found)


def mentioned_by(unit: Unit) -> frozenset[str]:
    """Return the names that the declarations of a file mention."""
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
    """Return the fields of a node that may mention a name."""
    declaring = ("span", "name", "type") if issubclass(kind, ParameterDecl) else ("span", "name")
    return tuple(field for field in kind.__struct_fields__ if field not in declaring)


#: key for rules about every skill
_ANY = "any"


def unused_declarations(subject: LintInput) -> Iterator[Diagnostic]:
    """Report unused parameters and declarations (E1301)."""
    used: dict[str, set[str]] = {}
    for name, declaration in subject.symbols.declared.items():
        for mention in mentions(declaration):
            used.setdefault(mention, set()).add(name)
    for unit in subject.requested:
        owners: list[Parametric] = [*unit.templates, *unit.missions]
        for owner in owners:
            yield from _unread_parameters(owner, mentions(owner))
        if unit.missions or unit.policies:
            rules = _read_by_rules(subject) if unit.skills else {}
            for skill in unit.skills:
                of_rules = rules.get(skill.name.text, set()) | rules.get(_ANY, set())
                yield from _unread_parameters(skill, mentions(skill) | of_rules)
            for declaration in _private_declarations(subject, unit):
                if not used.get(declaration.name.text, set()) - {declaration.name.text}:
                    yield _unused_declaration(declaration)


def _private_declarations(subject: LintInput, unit: Unit) -> Iterator[Declaration]:
    """Yield the declarations of a file that other files are not expected to use."""
    yield from unit.enums
    yield from (signal for signal in unit.signals if signal.name.text not in WELL_KNOWN.keys() | MEASURED.keys())
    yield from unit.templates
    if not subject.permits_any():
        yield from unit.skills
    if unit.missions:
        yield from unit.vehicles
        if not _any_zone(subject):
            yield from unit.zones


def _any_zone(subject: LintInput) -> bool:
    """Whether a mission has a parameter that may be any zone, or the entry point of any zone."""
    missions = subject.symbols.missions.values()
    return any(each.type.text in ("zone", "position") for mission in missions for each in mission.parameters)


def _read_by_rules(subject: LintInput) -> dict[str, set[str]]:
    """Return for each skill the names that the rules and delegations about it mention."""
    found: dict[str, set[str]] = {}
    for rule in subject.rules():
        read = mentions(rule.when)
        for skill in [name.text for name in rule.skills] or [_ANY]:
            found.setdefault(skill, set()).update(read)
    return found


def _unread_parameters(owner: Parametric, read: frozenset[str]) -> Iterator[Diagnostic]:
    for parameter in owner.parameters:
        if parameter.name.text not in read:
            yield _unread_parameter(owner, parameter)


def _unread_parameter(owner: Parametric, parameter: ParameterDecl) -> Diagnostic:
    also = ", and no rule about it reads it either" if isinstance(owner, SkillDecl) else ""
    message = f"`{owner.name.text}` does not read its parameter `{parameter.name.text}`{also}"
    return Diagnostic(codes.UNUSED, message, parameter.name.span, "remove it, or use it")


def _unused_declaration(declaration: Declaration) -> Diagnostic:
    return Diagnostic(
        codes.UNUSED,
        f"`{declaration.name.text}` is {WORDS[type(declaration)]} that is never used",
        declaration.name.span,
        "remove it, or move it to a file without a mission or a policy if other files are to import it",
    )


def unused_imports(subject: LintInput) -> Iterator[Diagnostic]:
    """Report unused imports (E1305). Each is checked with the unused imports before it removed."""
    needs = _ImportNeeds(subject)
    for unit in subject.requested:
        if needs.declared[unit.file]:
            for each in unit.imports:
                lost = needs.lost(unit.file, each)
                if lost is not None:
                    yield _unused_import(subject, each, alone=bool(lost))


class _ImportNeeds:
    """The declarations that the files of a program need while unused imports are removed."""

    def __init__(self, subject: LintInput) -> None:
        symbols = subject.symbols
        self._stable = subject.program.stable
        self._units = {unit.file: unit for unit in subject.program.units}
        self._imports = subject.imports
        self._mentioned = {file: mentioned_by(unit) for file, unit in self._units.items()}
        self.declared: dict[str, set[str]] = {file: set() for file in self._units}
        for name, declaration in symbols.declared.items():
            self.declared[declaration.span.file].add(name)
        for enum in symbols.enums.values():
            self.declared[enum.span.file] |= {member.name.text for member in enum.members}
        for file, unit in self._units.items():
            self.declared[file] |= {name.text for declaration in unit.roles for name in declaration.names}
        imported = {self._imports.target(file, each) for file, unit in self._units.items() for each in unit.imports}
        self._roots = {unit.file for unit in subject.requested} | (self._units.keys() - imported)
        self._any = subject.permits_any()

    def lost(self, file: str, gone: Import) -> frozenset[str] | None:
        """Remove an import of `file` if nothing in it is needed, and return the files that `file` then no longer has.

        Returns None, and keeps the import, if something in it is needed.
        """
        unit = self._units[file]
        left = unit.copied(imports=tuple(each for each in unit.imports if each is not gone))
        target = self._imports.target(file, gone)
        again = any(self._imports.target(file, each) == target for each in left.imports)
        if target is None or (not again and self._is_needed((unit,), frozenset({target}))):
            return None
        units = {**self._units, file: left}
        imports = Imports(tuple(units.values()), self._stable)
        lost = self._imports.closure(file) - imports.closure(file)
        if lost and not unit.policies and not unit.missions:
            return None
        if lost:
            left_over = frozenset[str]().union(*map(imports.closure, self._roots)) - lost
            if self._is_needed((units[name] for name in left_over), lost):
                return None
        self._units, self._imports = units, imports
        return lost

    def _is_needed(self, by: Iterable[Unit], files: frozenset[str]) -> bool:
        """Whether a file of `by` needs a declaration of `files`."""
        names = {name for file in files for name in self.declared[file]}
        units = [self._units[file] for file in files]
        implied = bool(names & WELL_KNOWN.keys()) or any(
            each.zones or each.vehicles or each.sizes or (each.skills and self._any) for each in units
        )
        return any((implied and unit.policies) or names & self._mentioned[unit.file] for unit in by)


def _unused_import(subject: LintInput, each: Import, *, alone: bool) -> Diagnostic:
    """The finding about an unused import; `alone` means that no other import provides its files.

    The fix keeps a comment on the same line. A person must then check the comment, so the fix is not safe.
    """
    text = subject.program.sources[each.span.file].text
    commented = _is_commented(text, each.span)
    title = "delete the import" if commented else "delete the line"
    help = f"{title}, if no file that imports this one needs it" if alone else title
    how = Applicability.SUGGESTED if alone or commented else Applicability.SAFE
    fix = Fix(each.span if commented else whole_line(text, each.span), "", title, how)
    return Diagnostic(codes.UNUSED_IMPORT, f"`{each.path}` is imported but not used", each.span, help, fixes=(fix,))


def _is_commented(text: str, span: Span) -> bool:
    """Whether a comment is on the line of an import, or ends there."""
    start, end = text.rfind("\n", 0, span.start) + 1, text.find("\n", span.end)
    rest = text[start : span.start], text[span.end : end if end >= 0 else len(text)]
    return any(mark in part for part in rest for mark in ("//", "/*", "*/"))
