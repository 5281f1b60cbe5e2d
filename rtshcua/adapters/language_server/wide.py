"""The answers to an editor's questions about the whole workspace, in steps: see `searching`."""

from collections.abc import Iterator, Sequence

from lsprotocol import types as lsp

from rtshcua.adapters.language_server import convert
from rtshcua.adapters.language_server.changes import NotDone, workspace_edit
from rtshcua.adapters.language_server.searching import Search
from rtshcua.adapters.language_server.texts import Texts
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.span import Span
from rtshcua.ground.editor.desk import View
from rtshcua.ground.editor.navigation import imported_at, importers, references, targets
from rtshcua.ground.editor.outline import outline
from rtshcua.ground.editor.rename import rename

_MOST = 500
"""Symbols of a workspace that are listed."""


def referred(texts: Texts, search: Search, params: lsp.ReferenceParams) -> list[lsp.Location]:
    """All places of the workspace that mean the same; of an import all that import the same file."""
    view, name = texts.view(params.text_document.uri)
    lines = texts.lines(name)
    offset = 0 if lines is None else lines.offset(convert.place(params.position))
    meant = targets(view, name, offset)
    file = imported_at(view, name, offset)
    found: dict[Span, bool] = {}
    views = [texts.desk.view(each) for each in search.steps(_names(texts))]
    if file is not None:
        found = dict.fromkeys(importers(views, file), False)
    else:
        for target in meant:
            found |= references(search.steps(views, told=False), view, target)
    own = params.context.include_declaration
    places = [span for span, declares in sorted(found.items()) if own or not declares]
    return [at for span in places if (at := texts.locate(span)) is not None]


def symbols(texts: Texts, search: Search, params: lsp.WorkspaceSymbolParams) -> list[lsp.WorkspaceSymbol]:
    """The declarations of the workspace, and of what the open texts import, whose names hold what is asked for."""
    wanted = params.query.casefold()
    imported = (file for name in texts.opened for file in texts.desk.view(name).program.sources)
    found: list[lsp.WorkspaceSymbol] = []
    for name in search.steps(dict.fromkeys((*imported, *texts.workspace()))):
        cut = texts.desk.cut(name)
        lines = texts.lines(name)
        if cut is None or lines is None:
            continue
        for each in outline(cut):
            if wanted in each.name.casefold() and each.at.start < each.at.end:
                at = lsp.Location(texts.uri(name), convert.range_of(lines, each.at.start, each.at.end))
                found.append(lsp.WorkspaceSymbol(at, each.name, convert.SYMBOLS[each.kind]))
                if len(found) == _MOST:
                    return found
    return found


def renamed(texts: Texts, search: Search, params: lsp.RenameParams) -> lsp.WorkspaceEdit:
    """The changes that give a thing another name. Raises NotDone with the reason why not."""
    view, name = texts.view(params.text_document.uri)
    lines = texts.lines(name)
    if lines is None:
        raise NotDone("this text is not open")
    offset = lines.offset(convert.place(params.position))

    def steps(each: Sequence[View]) -> Iterator[View]:
        return search.steps(each, told=False)

    files = search.steps(_names(texts))
    found = rename(texts.desk, files, view, name, offset, params.new_name, texts.dialect, steps)
    if isinstance(found, Refusal):
        raise NotDone(found.text)
    return workspace_edit(texts, {file: [(span, found.name) for span in spans] for file, spans in found.places.items()})


def _names(texts: Texts) -> tuple[str, ...]:
    return tuple(dict.fromkeys((*texts.opened, *texts.workspace())))
