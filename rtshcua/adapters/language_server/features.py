"""The answers to an editor's questions about a place, in the terms of the protocol."""

from lsprotocol import types as lsp

from rtshcua.adapters.language_server import convert
from rtshcua.adapters.language_server.session import Session
from rtshcua.diagnostics.span import Span
from rtshcua.ground.editor import colours as coloured
from rtshcua.ground.editor import outline as outlined
from rtshcua.ground.editor.completion import complete
from rtshcua.ground.editor.hover import hover
from rtshcua.ground.editor.navigation import definitions, targets
from rtshcua.ground.editor.signatures import signature


def hovered(session: Session, params: lsp.HoverParams) -> lsp.Hover | None:
    """What stands at a place."""
    view, name = session.view(params.text_document.uri)
    lines = session.lines(name)
    if lines is None:
        return None
    found = hover(view, name, lines.offset(convert.place(params.position)), session.dialect)
    if found is None:
        return None
    text = lsp.MarkupContent(lsp.MarkupKind.Markdown, found.text)
    return lsp.Hover(text, convert.range_of(lines, found.span.start, found.span.end))


def defined(session: Session, params: lsp.DefinitionParams) -> list[lsp.Location]:
    """Where a name is given."""
    view, name = session.view(params.text_document.uri)
    offset = _offset(session, name, params.position)
    return _locations(session, definitions(view, name, offset))


def highlighted(session: Session, params: lsp.DocumentHighlightParams) -> list[lsp.DocumentHighlight]:
    """All places of the file that mean the same."""
    view, name = session.view(params.text_document.uri)
    lines = session.lines(name)
    if lines is None:
        return []
    wanted = set(targets(view, name, lines.offset(convert.place(params.position))))
    places = {each.span: each.declares for each in view.occurrences(name) if each.target in wanted}
    write, read = lsp.DocumentHighlightKind.Write, lsp.DocumentHighlightKind.Read
    return [lsp.DocumentHighlight(convert.range_of(lines, span.start, span.end), write if gives else read)
            for span, gives in places.items()]  # fmt: skip


def completed(session: Session, params: lsp.CompletionParams) -> lsp.CompletionList:
    """What may be written at a place."""
    view, name = session.view(params.text_document.uri)
    lines, cut = session.lines(name), session.cut(params.text_document.uri)
    if lines is None or cut is None:
        return lsp.CompletionList(is_incomplete=False, items=[])
    offset = lines.offset(convert.place(params.position))
    items = [
        lsp.CompletionItem(
            label=item.text.rstrip("( ="),
            kind=convert.ITEMS.get(item.kind, lsp.CompletionItemKind.Value),
            detail=item.detail or None,
            sort_text=f"{number:04}",
            filter_text=item.text,
            text_edit=lsp.TextEdit(convert.range_of(lines, item.start, offset), item.text),
        )
        for number, item in enumerate(complete(session.desk, view, cut, offset, session.dialect))
    ]
    return lsp.CompletionList(is_incomplete=False, items=items)


def signed(session: Session, params: lsp.SignatureHelpParams) -> lsp.SignatureHelp | None:
    """What the call that is being written takes."""
    view, name = session.view(params.text_document.uri)
    cut = session.cut(params.text_document.uri)
    found = None if cut is None else signature(view, cut, _offset(session, name, params.position))
    if found is None:
        return None
    parameters = [lsp.ParameterInformation(each) for each in found.parameters]
    note = lsp.MarkupContent(lsp.MarkupKind.Markdown, found.note) if found.note else None
    one = lsp.SignatureInformation(found.label, note, parameters, found.active)
    return lsp.SignatureHelp([one], 0, found.active)


def outline(session: Session, params: lsp.DocumentSymbolParams) -> list[lsp.DocumentSymbol]:
    """The declarations of a file."""
    cut = session.cut(params.text_document.uri)
    lines = session.lines("" if cut is None else cut.source.file)
    if cut is None or lines is None:
        return []

    def told(symbol: outlined.Symbol) -> lsp.DocumentSymbol:
        return lsp.DocumentSymbol(
            name=symbol.name,
            kind=convert.SYMBOLS.get(symbol.kind, lsp.SymbolKind.Object),
            range=convert.range_of(lines, symbol.whole.start, symbol.whole.end),
            selection_range=convert.range_of(lines, symbol.at.start, symbol.at.end),
            detail=symbol.kind,
            children=[told(each) for each in symbol.inner],
        )

    return [told(each) for each in outlined.outline(cut)]


def folded(session: Session, params: lsp.FoldingRangeParams) -> list[lsp.FoldingRange]:
    """What may be folded."""
    cut = session.cut(params.text_document.uri)
    lines = session.lines("" if cut is None else cut.source.file)
    if cut is None or lines is None:
        return []
    found: list[lsp.FoldingRange] = []
    for each in outlined.folds(cut):
        first, last = lines.place(each.start), lines.place(each.end)
        end = last.line if each.kind else max(first.line, last.line - 1)  # the bracket that closes stays to be seen
        if end > first.line:
            found.append(lsp.FoldingRange(first.line, end, kind=each.kind or None))
    return found


def coloured_all(session: Session, params: lsp.SemanticTokensParams) -> lsp.SemanticTokens:
    """What each name is, as the protocol packs it: relative to the one before."""
    view, name = session.view(params.text_document.uri)
    lines = session.lines(name)
    data: list[int] = []
    line = column = 0
    if lines is None:
        return lsp.SemanticTokens([])
    for each in coloured.colours(view, name):
        start, end = lines.place(each.start), lines.place(each.end)
        data += [start.line - line, start.column - (column if start.line == line else 0), end.column - start.column,
                 each.kind, int(each.declares)]  # fmt: skip
        line, column = start
    return lsp.SemanticTokens(data)


LEGEND = lsp.SemanticTokensLegend(list(coloured.KINDS), ["declaration"])


def _offset(session: Session, name: str, at: lsp.Position) -> int:
    lines = session.lines(name)
    return 0 if lines is None else lines.offset(convert.place(at))


def _locations(session: Session, spans: tuple[Span, ...] | list[Span]) -> list[lsp.Location]:
    return [at for span in spans if (at := session.locate(span)) is not None]
