"""Navigation: the meaning of a place, its definitions, and all places with the same meaning, also in other programs."""

from collections.abc import Iterable

from rtshcua.diagnostics.span import Span
from rtshcua.ground.editor.occurrences import NameKind, NameTarget, at, spans
from rtshcua.ground.editor.syntax import token_at
from rtshcua.ground.editor.workspace import ProgramView


def targets(view: ProgramView, file: str, offset: int) -> tuple[NameTarget, ...]:
    """What a place means. Within what could not be parsed, a word that is declared somewhere."""
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
    """Where the name at a place is given; of an import, the beginning of the file."""
    found: list[Span] = []
    for target in targets(view, file, offset):
        if target.sort is not NameKind.IMPORT:
            found += declared_at(view, target)
    imported = imported_at(view, file, offset)
    if imported is not None:
        found.append(Span(imported, 0, 0))
    return tuple(dict.fromkeys(found))


def imported_at(view: ProgramView, file: str, offset: int) -> str | None:
    """The file that the import at a place means; None where there is none."""
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
    """The places that give a name."""
    if target.sort is NameKind.DECLARED:
        declared = view.symbols.declared.get(target.name)
        return [] if declared is None else [declared.name.span]
    owner = view.symbols.declared.get(target.owner.partition(".")[0])
    files = view.units if owner is None else (owner.span.file,)
    return [
        each.span for file in files for each in view.occurrences(file) if each.declares and each.target == target
    ]  # fmt: skip


def references(views: Iterable[ProgramView], view: ProgramView, target: NameTarget) -> dict[Span, bool]:
    """All places that mean `target`, as `view` understands it, in these programs; whether each gives the name.

    One name may be declared in several files that no program has together: only programs in which it is declared at
    the same place count.
    """
    home = declared_at(view, target)
    places: dict[Span, bool] = {}
    for each in (view, *views):
        if declared_at(each, target) == home:
            for file in each.units:
                if target.name not in each.text(file):
                    continue  # the places of a file are dear
                places.update(spans(each.occurrences(file), [target]))
    return places
