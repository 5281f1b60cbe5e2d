"""E1305: imports of which nothing is used.

An import is used where the importing file mentions something that the imported file itself declares. Otherwise it is
used for what it alone brings along, if anything that stays mentions that. A policy needs also what it does not mention:
its zones and its vehicle, the signals that every flight reads, and under `permit any` all skills. A file without a
mission or a policy may bring things along for those who import it, so of its imports only those count of which
everything comes along anyway; one that declares nothing is there to gather others, and all its imports are used.
"""

import re
from collections.abc import Iterable, Iterator

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Applicability, Diagnostic, Fix
from rtshcua.diagnostics.span import Span
from rtshcua.ground.compiler.closure import Imports
from rtshcua.ground.compiler.policy import WELL_KNOWN
from rtshcua.ground.lint.mentions import mentioned_by
from rtshcua.ground.lint.subject import Subject
from rtshcua.model.ir.program import Import, Unit

_REST = re.compile(r"[ \t\r]*(?://[^\n]*)?(?:\n|\Z)")


def check(subject: Subject) -> Iterator[Diagnostic]:
    """Report imports that may go, each given that those before it are gone."""
    needs = _Needs(subject)
    for unit in subject.asked:
        if needs.declared[unit.file]:
            for each in unit.imports:
                if needs.none_of(unit.file, each):
                    yield _found(subject, each)


class _Needs:
    """What the files of a program need, while imports are taken away."""

    def __init__(self, subject: Subject) -> None:
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
        imported = {self._imports.target(file, each) for file, unit in self._units.items() for each in unit.imports}
        self._roots = {unit.file for unit in subject.asked} | (self._units.keys() - imported)
        self._any = subject.permits_any()

    def none_of(self, file: str, gone: Import) -> bool:
        """Whether nothing of an import of `file` is needed; if so, it is taken away."""
        unit = self._units[file]
        left = unit.model_copy(update={"imports": tuple(each for each in unit.imports if each is not gone)})
        target = self._imports.target(file, gone)
        again = any(self._imports.target(file, each) == target for each in left.imports)
        if target is None or (not again and self._is_needed((unit,), frozenset({target}))):
            return False
        units = {**self._units, file: left}
        imports = Imports(tuple(units.values()), self._stable)
        lost = self._imports.closure(file) - imports.closure(file)
        if lost and not unit.policies and not unit.missions:
            return False
        if lost:
            left_over = frozenset[str]().union(*map(imports.closure, self._roots)) - lost
            if self._is_needed((units[name] for name in left_over), lost):
                return False
        self._units, self._imports = units, imports
        return True

    def _is_needed(self, by: Iterable[Unit], files: frozenset[str]) -> bool:
        """Whether a file of `by` needs what `files` declare."""
        names = {name for file in files for name in self.declared[file]}
        units = [self._units[file] for file in files]
        implied = bool(names & WELL_KNOWN.keys()) or any(
            each.zones or each.vehicles or (each.skills and self._any) for each in units
        )
        return any((implied and unit.policies) or names & self._mentioned[unit.file] for unit in by)


def _found(subject: Subject, each: Import) -> Diagnostic:
    fix = Fix(_line(subject, each.span), "", "delete the line", Applicability.SAFE)
    return Diagnostic(codes.UNUSED_IMPORT, f"nothing of `{each.path}` is used", each.span, fix.title, fixes=(fix,))


def _line(subject: Subject, span: Span) -> Span:
    """The whole line of an import that stands alone on it, with a comment behind it; else the import."""
    text = subject.program.sources[span.file].text
    start = text.rfind("\n", 0, span.start) + 1
    rest = _REST.match(text, span.end)
    if text[start : span.start].strip() or rest is None:
        return span
    return Span(span.file, start, rest.end())
