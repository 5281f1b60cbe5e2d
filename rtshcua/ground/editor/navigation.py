"""Navigation: the target of a name, its definitions, and all references to it, also in other programs."""

from collections.abc import Iterable

from rtshcua.diagnostics.span import Span
from rtshcua.ground.editor.occurrences import NameKind, NameTarget, at, spans
from rtshcua.ground.editor.syntax import token_at
from rtshcua.ground.editor.workspace import ProgramView


def targets(view: ProgramView, file: str, offset: int) -> tuple[NameTarget, ...]:
    """The targets of the name at an offset. In text with syntax errors, a word that is declared somewhere."""
    found = tuple(dict.fromkeys(each.target for each in at(view.occurrences(file), offset)))
    if found:
        return found
    token = token_at(view.text(file), offset)
    if token is None or token.kind != "word":
        return ()
    for name in (token.text, token.text.partition(".")[0]):
        if name in view.symbols.declared:
            return (NameTarget(NameKind.DECLARED, name),)
    return ()


def definitions(view: ProgramView, file: str, offset: int) -> tuple[Span, ...]:
    """The definitions of the name at an offset; for an import, the beginning of the file."""
    found: list[Span] = []
    for target in targets(view, file, offset):
        if target.kind is not NameKind.IMPORT:
            found += declared_at(view, target)
    imported = imported_at(view, file, offset)
    if imported is not None:
        found.append(Span(imported, 0, 0))
    return tuple(dict.fromkeys(found))


def imported_at(view: ProgramView, file: str, offset: int) -> str | None:
    """The file of the import at an offset; None if there is none."""
    unit = view.units.get(file)
    imports = () if unit is None else unit.imports
    return next((view.imports.target(file, each) for each in imports if each.span.start <= offset <= each.span.end),
                None)  # fmt: skip


def importers(views: Iterable[ProgramView], file: str) -> tuple[Span, ...]:
    """The imports of a file in these programs."""
    found = (each.span for view in views for unit in view.units.values() for each in unit.imports
             if view.imports.target(unit.file, each) == file)  # fmt: skip
    return tuple(sorted(set(found)))


def declared_at(view: ProgramView, target: NameTarget) -> list[Span]:
    """The places that declare a name."""
    if target.kind is NameKind.DECLARED:
        declared = view.symbols.declared.get(target.name)
        return [] if declared is None else [declared.name.span]
    owner = view.symbols.declared.get(target.owner.partition(".")[0])
    files = view.units if owner is None else (owner.span.file,)
    return [
        each.span for file in files for each in view.occurrences(file) if each.declares and each.target == target
    ]  # fmt: skip


def references(views: Iterable[ProgramView], view: ProgramView, target: NameTarget) -> dict[Span, bool]:
    """Return all places in these programs that refer to `target`, and whether each declares it.

    Several files may declare one name if no program contains them together, so only programs count in which the name is
    declared at the same place as in `view`.
    """
    home = declared_at(view, target)
    places: dict[Span, bool] = {}
    for each in (view, *views):
        if declared_at(each, target) == home:
            for file in each.units:
                if target.name not in each.text(file):
                    continue  # finding the occurrences of a file is slow
                places.update(spans(each.occurrences(file), [target]))
    return places
