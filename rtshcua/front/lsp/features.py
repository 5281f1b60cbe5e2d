"""The answers to an editor's requests, in the types of the protocol: about a position, about changes to texts
(renaming, formatting, code actions), and about the whole workspace (in steps, see `searching`).
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence

from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcException

from rtshcua.diagnostics.diagnostic import Fix
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.span import Source, Span
from rtshcua.front.lsp.disk import name_of
from rtshcua.front.lsp.searching import Search
from rtshcua.front.lsp.session import EditorSession
from rtshcua.front.lsp.texts import ITEMS, SYMBOLS, Spot, Texts, diagnostic, place, range_of
from rtshcua.ground.editor import document_structure as coloured
from rtshcua.ground.editor import document_structure as outlined
from rtshcua.ground.editor.code_actions import actions, all_safe
from rtshcua.ground.editor.code_completion import complete, signature
from rtshcua.ground.editor.hover import hover
from rtshcua.ground.editor.navigation import definitions, imported_at, importers, references, targets
from rtshcua.ground.editor.positions import LineIndex, difference
from rtshcua.ground.editor.rename import renamable, rename
from rtshcua.ground.editor.workspace import ProgramView
from rtshcua.ground.format.format import formatted

LEGEND = lsp.SemanticTokensLegend(list(coloured.TOKEN_KINDS), ["declaration"])
_MOST = 500
"""The most symbols of a workspace that are listed."""


class NotDone(JsonRpcException):
    """A well-formed request that is refused; the text is shown to the user."""

    CODE = -32803  # LSPErrorCodes.RequestFailed


# ------------------------------------------------------------------------------------------ about a place


def hovered(session: EditorSession, params: lsp.HoverParams) -> lsp.Hover | None:
    """The hover text at a position."""
    spot = session.spot(params.text_document.uri, params.position)
    found = spot and hover(spot.view, spot.name, spot.offset, session.dialect)
    if spot is None or found is None:
        return None
    text = lsp.MarkupContent(lsp.MarkupKind.Markdown, found.text)
    return lsp.Hover(text, range_of(spot.lines, found.span.start, found.span.end))


def defined(session: EditorSession, params: lsp.DefinitionParams) -> list[lsp.Location]:
    """The definitions of the name at a position."""
    spot = session.spot(params.text_document.uri, params.position)
    return [] if spot is None else _locations(session, definitions(spot.view, spot.name, spot.offset))


def highlighted(session: EditorSession, params: lsp.DocumentHighlightParams) -> list[lsp.DocumentHighlight]:
    """All occurrences in the file of the symbol at a position."""
    spot = session.spot(params.text_document.uri, params.position)
    if spot is None:
        return []
    wanted = set(targets(spot.view, spot.name, spot.offset))
    places = {each.span: each.declares for each in spot.view.occurrences(spot.name) if each.target in wanted}
    write, read = lsp.DocumentHighlightKind.Write, lsp.DocumentHighlightKind.Read
    return [lsp.DocumentHighlight(range_of(spot.lines, span.start, span.end), write if gives else read)
            for span, gives in places.items()]  # fmt: skip


def completed(session: EditorSession, params: lsp.CompletionParams) -> lsp.CompletionList:
    """The completions at a position."""
    spot, opened = session.spot(params.text_document.uri, params.position), session.cut(params.text_document.uri)
    if spot is None or opened is None:
        return lsp.CompletionList(is_incomplete=False, items=[])
    items = [
        lsp.CompletionItem(
            label=item.text.rstrip("( ="),
            kind=ITEMS.get(item.kind, lsp.CompletionItemKind.Value),
            detail=item.detail or None,
            sort_text=f"{number:04}",
            filter_text=item.text,
            text_edit=lsp.TextEdit(range_of(spot.lines, item.start, spot.offset), item.text),
        )
        for number, item in enumerate(complete(session.desk, spot.view, opened[0], spot.offset, session.dialect))
    ]
    return lsp.CompletionList(is_incomplete=False, items=items)


def signed(session: EditorSession, params: lsp.SignatureHelpParams) -> lsp.SignatureHelp | None:
    """The signature of the call at a position."""
    spot, opened = session.spot(params.text_document.uri, params.position), session.cut(params.text_document.uri)
    found = None if spot is None or opened is None else signature(spot.view, opened[0], spot.offset)
    if found is None:
        return None
    parameters = [lsp.ParameterInformation(each) for each in found.parameters]
    note = lsp.MarkupContent(lsp.MarkupKind.Markdown, found.note) if found.note else None
    one = lsp.SignatureInformation(found.label, note, parameters, found.active)
    return lsp.SignatureHelp([one], 0, found.active)


def outline(session: EditorSession, params: lsp.DocumentSymbolParams) -> list[lsp.DocumentSymbol]:
    """The declarations of a file."""
    opened = session.cut(params.text_document.uri)
    if opened is None:
        return []
    cut, lines = opened

    def converted(symbol: outlined.OutlineSymbol) -> lsp.DocumentSymbol:
        return lsp.DocumentSymbol(
            name=symbol.name,
            kind=SYMBOLS.get(symbol.kind, lsp.SymbolKind.Object),
            range=range_of(lines, symbol.whole.start, symbol.whole.end),
            selection_range=range_of(lines, symbol.at.start, symbol.at.end),
            detail=symbol.kind,
            children=[converted(each) for each in symbol.inner],
        )

    return [converted(each) for each in outlined.outline(cut)]


def folded(session: EditorSession, params: lsp.FoldingRangeParams) -> list[lsp.FoldingRange]:
    """The foldable ranges of a file."""
    opened = session.cut(params.text_document.uri)
    if opened is None:
        return []
    cut, lines = opened
    found: list[lsp.FoldingRange] = []
    for each in outlined.folds(cut):
        first, last = lines.place(each.start), lines.place(each.end)
        end = last.line if each.kind else max(first.line, last.line - 1)  # the closing bracket stays visible
        if end > first.line:
            found.append(lsp.FoldingRange(first.line, end, kind=each.kind or None))
    return found


def coloured_all(session: EditorSession, params: lsp.SemanticTokensParams) -> lsp.SemanticTokens:
    """The semantic tokens of a file, each relative to the previous one, as the protocol encodes them."""
    name = name_of(params.text_document.uri)
    lines = session.lines(name)
    if lines is None:
        return lsp.SemanticTokens([])
    data: list[int] = []
    line = column = 0
    for each in coloured.semantic_tokens(session.desk.view(name), name):
        start, end = lines.place(each.start), lines.place(each.end)
        data += [start.line - line, start.column - (column if start.line == line else 0), end.column - start.column,
                 each.kind, int(each.declares)]  # fmt: skip
        line, column = start
    return lsp.SemanticTokens(data)


# ------------------------------------------------------------------------------------------ about changes


def may_rename(session: EditorSession, params: lsp.PrepareRenameParams) -> lsp.PrepareRenamePlaceholder:
    """The name at a position that can be renamed. Raises NotDone with the reason if it cannot."""
    view, name, lines, offset = _renaming(session, params)
    found = renamable(session.desk, view, name, offset)
    if isinstance(found, Refusal):
        raise NotDone(found.text)
    return lsp.PrepareRenamePlaceholder(range_of(lines, found.start, found.end), view.slice(found))


def renamed(texts: Texts, search: Search, params: lsp.RenameParams) -> lsp.WorkspaceEdit:
    """The changes of a renaming. Raises NotDone with the reason if it is refused."""
    view, name, _, offset = _renaming(texts, params)

    def steps(each: Sequence[ProgramView]) -> Iterator[ProgramView]:
        return search.steps(each, told=False)

    files = search.steps(_names(texts))
    found = rename(texts.desk, files, view, name, offset, params.new_name, texts.dialect, steps)
    if isinstance(found, Refusal):
        raise NotDone(found.text)
    return _workspace_edit(texts, {
        file: [(span, found.name) for span in spans] for file, spans in found.places.items()
    })  # fmt: skip


def _renaming(texts: Texts, params: lsp.PrepareRenameParams | lsp.RenameParams) -> Spot:
    spot = texts.spot(params.text_document.uri, params.position)
    if spot is None:
        raise NotDone("this text is not open")
    return spot


def laid_out(session: EditorSession, params: lsp.DocumentFormattingParams) -> list[lsp.TextEdit]:
    """The change that formats a text, from the first character that differs to the last, with the line width of its
    project. Nothing if the text has errors, which are reported anyway, or the project excludes it.
    """
    opened = session.cut(params.text_document.uri)
    if opened is None:
        return []
    cut, lines = opened
    text = cut.source.text
    settings = session.layout(cut.source.file)
    made = None if settings is None else formatted(Source(cut.source.file, text), settings.width).text
    if made is None or made == text:
        return []
    start, end, length = difference(text, made)
    return [lsp.TextEdit(range_of(lines, start, end), made[start : start + length])]


def offered(session: EditorSession, params: lsp.CodeActionParams) -> list[lsp.CodeAction]:
    """The code actions for the findings in a range, and the safe fix of all findings."""
    name = name_of(params.text_document.uri)
    lines = session.lines(name)
    if lines is None:
        return []
    found = session.findings(name)
    start, end = (lines.offset(place(at)) for at in (params.range.start, params.range.end))
    offers: list[lsp.CodeAction] = []
    for each in actions(found, name, start, end, lines.text):
        kind = lsp.CodeActionKind.QuickFix if each.found is not None else lsp.CodeActionKind.SourceFixAll
        about = None if each.found is None else [
            diagnostic(each.found, lines, session.locate, session.page)
        ]  # fmt: skip
        edit = _corrected(session, name, each.fixes)
        offers.append(lsp.CodeAction(each.title, kind, about, is_preferred=each.safe or None, edit=edit))
    wanted = params.context.only
    if wanted is None:
        return offers
    everything = lsp.CodeActionKind.SourceFixAll
    offers = [each for each in offers if each.kind is not None and _is_of(each.kind, wanted)]
    safe = all_safe(found, name)
    if safe and _is_of(everything, wanted) and all(each.kind != everything for each in offers):
        title = "apply all safe fixes"
        offers.append(lsp.CodeAction(title, everything, edit=_corrected(session, name, safe)))
    return offers


def _is_of(kind: str, wanted: Iterable[str]) -> bool:
    return any(kind == one or kind.startswith(f"{one}.") for one in wanted)


def _corrected(texts: Texts, name: str, fixes: Iterable[Fix]) -> lsp.WorkspaceEdit:
    return _workspace_edit(texts, {name: [(fix.span, fix.replacement) for fix in fixes]})


def _workspace_edit(texts: Texts, changes: Mapping[str, list[tuple[Span, str]]]) -> lsp.WorkspaceEdit:
    """Changes by file, with the version of each open text, so that an editor does not apply them to another version."""
    edits: list[lsp.TextDocumentEdit | lsp.CreateFile | lsp.RenameFile | lsp.DeleteFile] = []
    plain: dict[str, list[lsp.TextEdit]] = {}
    for name, places in changes.items():
        lines = texts.lines(name)
        if lines is None:
            continue
        opened = texts.opened.get(name)
        made = [_text_edit(lines, span, text) for span, text in sorted(places)]
        document = lsp.OptionalVersionedTextDocumentIdentifier(
            texts.uri(name), None if opened is None else opened.version
        )
        edits.append(lsp.TextDocumentEdit(document, list(made)))
        plain[texts.uri(name)] = made
    return lsp.WorkspaceEdit(document_changes=edits) if texts.versioned else lsp.WorkspaceEdit(changes=plain)


def _text_edit(lines: LineIndex, span: Span, text: str) -> lsp.TextEdit:
    return lsp.TextEdit(range_of(lines, span.start, span.end), text)


# ------------------------------------------------------------------------------------------ about the workspace


def referred(texts: Texts, search: Search, params: lsp.ReferenceParams) -> list[lsp.Location]:
    """All references in the workspace to the symbol at a position; for an import, all imports of the same file."""
    spot = texts.spot(params.text_document.uri, params.position)
    if spot is None:
        return []
    view, name, _, offset = spot
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
    return _locations(texts, places)


def symbols(texts: Texts, search: Search, params: lsp.WorkspaceSymbolParams) -> list[lsp.WorkspaceSymbol]:
    """The declarations of the workspace and of imported files whose names contain the query."""
    wanted = params.query.casefold()
    imported = (file for name in texts.opened for file in texts.desk.view(name).program.sources)
    found: list[lsp.WorkspaceSymbol] = []
    for name in search.steps(dict.fromkeys((*imported, *texts.workspace()))):
        cut = texts.desk.cut(name)
        lines = texts.lines(name)
        if cut is None or lines is None:
            continue
        for each in outlined.outline(cut):
            if wanted in each.name.casefold() and each.at.start < each.at.end:
                at = lsp.Location(texts.uri(name), range_of(lines, each.at.start, each.at.end))
                found.append(lsp.WorkspaceSymbol(at, each.name, SYMBOLS[each.kind]))
                if len(found) == _MOST:
                    return found
    return found


def _names(texts: Texts) -> tuple[str, ...]:
    return tuple(dict.fromkeys((*texts.opened, *texts.workspace())))


def _locations(texts: Texts, spans: Iterable[Span]) -> list[lsp.Location]:
    return [at for span in spans if (at := texts.locate(span)) is not None]
