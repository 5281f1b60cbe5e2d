"""What changes texts: renaming, formatting, and what may be done about a finding."""

from collections.abc import Iterable, Mapping

from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcException

from rtshcua.adapters.language_server import convert
from rtshcua.adapters.language_server.session import Session
from rtshcua.adapters.language_server.texts import Texts
from rtshcua.diagnostics.diagnostic import Fix
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.editor.actions import actions, all_safe
from rtshcua.ground.editor.positions import Lines, difference
from rtshcua.ground.editor.rename import renamable
from rtshcua.ground.format.format import formatted

REQUEST_FAILED = -32803  # LSPErrorCodes.RequestFailed


class NotDone(JsonRpcException):
    """A request that is well-formed and is refused; the text is for a person."""

    CODE = REQUEST_FAILED

    def __init__(self, why: str) -> None:
        super().__init__(message=why, code=REQUEST_FAILED)


def may_rename(session: Session, params: lsp.PrepareRenameParams) -> lsp.PrepareRenamePlaceholder:
    """The name that would be changed. Raises NotDone with the reason why it may not."""
    view, name = session.view(params.text_document.uri)
    lines = session.lines(name)
    if lines is None:
        raise NotDone("this text is not open")
    found = renamable(session.desk, view, name, lines.offset(convert.place(params.position)))
    if isinstance(found, Refusal):
        raise NotDone(found.text)
    return lsp.PrepareRenamePlaceholder(convert.range_of(lines, found.start, found.end), view.slice(found))


def laid_out(session: Session, params: lsp.DocumentFormattingParams) -> list[lsp.TextEdit]:
    """The change that puts a text into the one style, as wide as its project says: from the first character that
    differs to the last. Nothing where the text has errors, which are told of anyway, or the project leaves it out.
    """
    cut = session.cut(params.text_document.uri)
    lines = session.lines("" if cut is None else cut.source.file)
    if cut is None or lines is None:
        return []
    text = cut.source.text
    settings = session.layout(cut.source.file)
    made = None if settings is None else formatted(Source(cut.source.file, text), settings.width).text
    if made is None or made == text:
        return []
    start, end, length = difference(text, made)
    return [lsp.TextEdit(convert.range_of(lines, start, end), made[start : start + length])]


def offered(session: Session, params: lsp.CodeActionParams) -> list[lsp.CodeAction]:
    """What may be done about the findings in a range, and about all of them where that is safe."""
    _, name = session.view(params.text_document.uri)
    lines = session.lines(name)
    if lines is None:
        return []
    wanted = params.context.only
    found = session.findings(name)
    start, end = (lines.offset(convert.place(at)) for at in (params.range.start, params.range.end))
    offers: list[lsp.CodeAction] = []
    for each in actions(found, name, start, end, lines.text):
        kind = lsp.CodeActionKind.QuickFix if each.found is not None else lsp.CodeActionKind.SourceFixAll
        about = None if each.found is None else [
            convert.diagnostic(each.found, lines, session.locate, session.page)
        ]  # fmt: skip
        edit = workspace_edit(session, {name: _written(each.fixes)})
        offers.append(lsp.CodeAction(each.title, kind, about, is_preferred=each.safe or None, edit=edit))
    if wanted is not None:
        offers = [each for each in offers if each.kind is not None and any(_is_of(each.kind, one) for one in wanted)]
        if any(_is_of(lsp.CodeActionKind.SourceFixAll, one) for one in wanted) and not any(
            each.kind == lsp.CodeActionKind.SourceFixAll for each in offers
        ):
            safe = all_safe(found, name)
            edit = workspace_edit(session, {name: _written(safe)})
            if safe:
                title = "correct everything that is safe to correct"
                offers.append(lsp.CodeAction(title, lsp.CodeActionKind.SourceFixAll, edit=edit))
    return offers


def _is_of(kind: str, wanted: str) -> bool:
    return kind == wanted or kind.startswith(f"{wanted}.")


def _written(fixes: Iterable[Fix]) -> list[tuple[Span, str]]:
    return [(fix.span, fix.replacement) for fix in fixes]


def workspace_edit(texts: Texts, changes: Mapping[str, list[tuple[Span, str]]]) -> lsp.WorkspaceEdit:
    """Changes by file; with the version of a text that is open, so that no editor applies them to another."""
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


def _text_edit(lines: Lines, span: Span, text: str) -> lsp.TextEdit:
    return lsp.TextEdit(convert.range_of(lines, span.start, span.end), text)
