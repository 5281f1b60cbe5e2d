"""The server: which features it has, and how messages of the editor reach the session."""

import gc
import logging
import socket
import sys
from collections.abc import Callable
from typing import Any

from lsprotocol import types as lsp
from pygls.lsp.server import LanguageServer

from rtshcua import __version__
from rtshcua.adapters.language_server import changes, convert, features, wide
from rtshcua.adapters.language_server.ending import Watched
from rtshcua.adapters.language_server.protocol import Protocol
from rtshcua.adapters.language_server.searching import Shown
from rtshcua.adapters.language_server.session import Session
from rtshcua.adapters.language_server.uris import path_of
from rtshcua.ground.editor.positions import Change, Encoding

_WATCHED = "**/*.{rts,geojson,json,toml}"
_QUESTIONS = (
    (lsp.TEXT_DOCUMENT_HOVER, features.hovered, None),
    (lsp.TEXT_DOCUMENT_DEFINITION, features.defined, None),
    (lsp.TEXT_DOCUMENT_DOCUMENT_HIGHLIGHT, features.highlighted, None),
    (lsp.TEXT_DOCUMENT_COMPLETION, features.completed, lsp.CompletionOptions(trigger_characters=[".", '"', "/", ":"])),
    (lsp.TEXT_DOCUMENT_SIGNATURE_HELP, features.signed, lsp.SignatureHelpOptions(trigger_characters=["(", ","])),
    (lsp.TEXT_DOCUMENT_DOCUMENT_SYMBOL, features.outline, None),
    (lsp.TEXT_DOCUMENT_FOLDING_RANGE, features.folded, None),
    (lsp.TEXT_DOCUMENT_SEMANTIC_TOKENS_FULL, features.coloured_all, features.LEGEND),
    (lsp.TEXT_DOCUMENT_PREPARE_RENAME, changes.may_rename, None),
    (lsp.TEXT_DOCUMENT_FORMATTING, changes.laid_out, None),
    (lsp.TEXT_DOCUMENT_CODE_ACTION, changes.offered, lsp.CodeActionOptions(
        [lsp.CodeActionKind.QuickFix, lsp.CodeActionKind.SourceFixAll])),
)  # fmt: skip
_SEARCHES = (
    (lsp.TEXT_DOCUMENT_REFERENCES, wide.referred, "looking for uses", lsp.ReferenceOptions(work_done_progress=True)),
    (lsp.WORKSPACE_SYMBOL, wide.symbols, "looking for names", lsp.WorkspaceSymbolOptions(work_done_progress=True)),
    (lsp.TEXT_DOCUMENT_RENAME, wide.renamed, "renaming", lsp.RenameOptions(True, work_done_progress=True)),
)  # fmt: skip


def serve(library: str, port: int | None = None, host: str = "127.0.0.1") -> None:
    """Serves one editor over the standard streams, or the first that connects to a port; ends with it.

    What goes wrong is written to the standard error, nothing but messages to the standard output.
    """
    logging.basicConfig(stream=sys.stderr, level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s")
    logging.getLogger("pygls.protocol.json_rpc").addFilter(_is_a_fault)
    gc.set_threshold(50_000, 20, 100)  # syntax trees come by thousands, and live long
    server, session = make(library)
    try:
        if port is None:
            outgoing = sys.stdout.buffer
            sys.stdout = sys.stderr  # whatever prints must not reach the editor
            server.start_io(Watched(sys.stdin.buffer), outgoing)  # type: ignore[arg-type]
        else:
            _over(server, host, port)
    finally:
        session.end()


def _over(server: LanguageServer, host: str, port: int) -> None:
    """Serves the first editor that connects, and ends with the connection, however that ends."""
    with socket.create_server((host, port)) as listening:
        connection, _ = listening.accept()
    with connection, connection.makefile("rb") as incoming, connection.makefile("wb") as outgoing:
        try:
            server.start_io(Watched(incoming), outgoing)  # type: ignore[arg-type]
        except ConnectionError as error:
            logging.getLogger("rtshcua.lsp").warning("the editor is gone: %s", error)


def _is_a_fault(record: logging.LogRecord) -> bool:
    """A request that is refused with a reason is no fault of the server's, so nothing is logged of it."""
    return not (record.exc_info and isinstance(record.exc_info[1], changes.NotDone))


def make(library: str) -> tuple[LanguageServer, Session]:
    """The server with all its features, and its session. `library` is the folder that `lib:` stands for."""
    server = LanguageServer("rtshcua", __version__, protocol_cls=Protocol)
    session = Session(library, server.text_document_publish_diagnostics, _saying(server))
    _lifecycle(server, session)
    _documents(server, session)
    for method, answer, options in _QUESTIONS:
        server.feature(method, options)(_asked(answer, session))
    for method, search, title, told in _SEARCHES:
        server.feature(method, told)(_searched(server, search, session, title))
    return server, session


def _saying(server: LanguageServer) -> Callable[[str], None]:
    """Shows each thing once, and logs it every time."""
    said: set[str] = set()

    def say(text: str) -> None:
        logging.getLogger("rtshcua.lsp").warning(text)
        if text not in said:
            said.add(text)
            server.window_show_message(lsp.ShowMessageParams(lsp.MessageType.Warning, text))

    return say


def _asked(answer: Any, session: Session) -> Any:
    """The answer as a handler of its own: pygls looks at the names of a handler's arguments."""

    def handler(params: Any) -> Any:
        return answer(session, params)

    return handler


def _searched(server: LanguageServer, search: Any, session: Session, title: str) -> Any:
    """The answer from the thread that searches, with its progress where the editor wants to show it."""

    async def handler(params: Any) -> Any:
        shown = Shown(server.progress, params.work_done_token, title)
        try:
            return await session.searching.answer(session, search, params, shown.tell)
        finally:
            shown.end()

    return handler


def _lifecycle(server: LanguageServer, session: Session) -> None:
    def initialize(params: lsp.InitializeParams) -> None:
        session.encoding = Encoding(server.workspace.position_encoding or "utf-16")
        folders = [each.uri for each in params.workspace_folders or ()] or [params.root_uri or ""]
        session.folders = [path for uri in folders if (path := path_of(uri)) is not None]
        edit = params.capabilities.workspace and params.capabilities.workspace.workspace_edit
        session.versioned = bool(edit and edit.document_changes)

    async def initialized(_params: lsp.InitializedParams) -> None:
        workspace = server.client_capabilities.workspace
        watching = workspace and workspace.did_change_watched_files
        if watching and watching.dynamic_registration:
            options = lsp.DidChangeWatchedFilesRegistrationOptions([lsp.FileSystemWatcher(_WATCHED)])
            one = lsp.Registration("watching", lsp.WORKSPACE_DID_CHANGE_WATCHED_FILES, options)
            await server.client_register_capability_async(lsp.RegistrationParams([one]))

    def folders(params: lsp.DidChangeWorkspaceFoldersParams) -> None:
        gone = {path_of(each.uri) for each in params.event.removed}
        added = [path for each in params.event.added if (path := path_of(each.uri)) is not None]
        session.folders = [*(each for each in session.folders if each not in gone), *added]

    def shutdown(_params: None) -> None:
        session.end()

    server.feature(lsp.INITIALIZE)(initialize)
    server.feature(lsp.INITIALIZED)(initialized)
    server.feature(lsp.WORKSPACE_DID_CHANGE_WORKSPACE_FOLDERS)(folders)
    server.feature(lsp.SHUTDOWN)(shutdown)


def _documents(server: LanguageServer, session: Session) -> None:
    def opened(params: lsp.DidOpenTextDocumentParams) -> None:
        document = params.text_document
        session.open(document.uri, document.version, document.text)

    def changed(params: lsp.DidChangeTextDocumentParams) -> None:
        made = [_change(each) for each in params.content_changes]
        session.change(params.text_document.uri, params.text_document.version, made)

    def closed(params: lsp.DidCloseTextDocumentParams) -> None:
        session.close(params.text_document.uri)

    def saved(_params: lsp.DidSaveTextDocumentParams) -> None:
        session.reread()

    def watched(_params: lsp.DidChangeWatchedFilesParams) -> None:
        session.reread()

    server.feature(lsp.TEXT_DOCUMENT_DID_OPEN)(opened)
    server.feature(lsp.TEXT_DOCUMENT_DID_CHANGE)(changed)
    server.feature(lsp.TEXT_DOCUMENT_DID_CLOSE)(closed)
    server.feature(lsp.TEXT_DOCUMENT_DID_SAVE)(saved)
    server.feature(lsp.WORKSPACE_DID_CHANGE_WATCHED_FILES)(watched)


def _change(change: lsp.TextDocumentContentChangeEvent) -> Change:
    if isinstance(change, lsp.TextDocumentContentChangePartial):
        return Change(convert.place(change.range.start), convert.place(change.range.end), change.text)
    return Change(None, None, change.text)
