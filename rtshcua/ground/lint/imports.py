"""E1305: imports of which nothing is used.

An import is used where the importing file mentions something that the imported file itself declares. Otherwise it is
used for what it alone brings along, if anything that stays mentions that. A policy needs also what it does not mention:
its zones and its vehicle, the signals that every flight reads, and under `permit any` all skills. A file without a
mission or a policy may bring things along for those who import it, so of its imports only those count of which
everything comes along anyway; one that declares nothing is there to gather others, and all its imports are used.

Nobody knows who else imports a file: what an import alone brings along may be of use to somebody who was not asked for.
So to delete it is safe only where another import brings all of it too; else it is for a person to look at.
"""

from collections.abc import Iterable, Iterator

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Applicability, Diagnostic, Fix
from rtshcua.diagnostics.removal import whole_line
from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.well_known import WELL_KNOWN
from rtshcua.ground.lint.mentions import mentioned_by
from rtshcua.ground.lint.subject import Subject
from rtshcua.ground.pipeline.closure import Imports
from rtshcua.model.ir.program import Import, Unit


def check(subject: Subject) -> Iterator[Diagnostic]:
    """Report imports that may go, each given that those before it are gone."""
    needs = _Needs(subject)
    for unit in subject.asked:
        if needs.declared[unit.file]:
            for each in unit.imports:
                lost = needs.lost(unit.file, each)
                if lost is not None:
                    yield _found(subject, each, alone=bool(lost))


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
        for file, unit in self._units.items():
            self.declared[file] |= {name.text for declaration in unit.roles for name in declaration.names}
        imported = {self._imports.target(file, each) for file, unit in self._units.items() for each in unit.imports}
        self._roots = {unit.file for unit in subject.asked} | (self._units.keys() - imported)
        self._any = subject.permits_any()

    def lost(self, file: str, gone: Import) -> frozenset[str] | None:
        """The files that `file` no longer has without one of its imports, if nothing of that is needed; then it is
        taken away. None where something is.
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
        """Whether a file of `by` needs what `files` declare."""
        names = {name for file in files for name in self.declared[file]}
        units = [self._units[file] for file in files]
        implied = bool(names & WELL_KNOWN.keys()) or any(
            each.zones or each.vehicles or each.sizes or (each.skills and self._any) for each in units
        )
        return any((implied and unit.policies) or names & self._mentioned[unit.file] for unit in by)


def _found(subject: Subject, each: Import, *, alone: bool) -> Diagnostic:
    """The finding on an import; `alone` is whether no other brings along what it does.

    A comment on its line stays. It may then speak of something else, so that a person has to look.
    """
    text = subject.program.sources[each.span.file].text
    commented = _is_commented(text, each.span)
    title = "delete the import" if commented else "delete the line"
    help = f"{title}, if no file that imports this one needs it" if alone else title
    how = Applicability.SUGGESTED if alone or commented else Applicability.SAFE
    fix = Fix(each.span if commented else whole_line(text, each.span), "", title, how)
    return Diagnostic(codes.UNUSED_IMPORT, f"nothing of `{each.path}` is used", each.span, help, fixes=(fix,))


def _is_commented(text: str, span: Span) -> bool:
    """Whether a comment stands on the line of an import, or ends there."""
    start, end = text.rfind("\n", 0, span.start) + 1, text.find("\n", span.end)
    beside = text[start : span.start], text[span.end : end if end >= 0 else len(text)]
    return any(mark in part for part in beside for mark in ("//", "/*", "*/"))
