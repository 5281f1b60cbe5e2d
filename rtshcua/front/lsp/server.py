"""The language server: its features, and the dispatch of messages to the session."""

import gc
import logging
import os
import socket
import sys
from collections.abc import Callable
from threading import Timer
from typing import Any, BinaryIO

from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcException, JsonRpcInvalidParams
from pygls.lsp.server import LanguageServer
from pygls.protocol import LanguageServerProtocol

from rtshcua import __version__
from rtshcua.front.lsp import features
from rtshcua.front.lsp.disk import path_of
from rtshcua.front.lsp.searching import Shown
from rtshcua.front.lsp.session import EditorSession
from rtshcua.front.lsp.texts import place
from rtshcua.ground.editor.positions import Encoding, TextChange

GRACE = 5.0
"""The longest time from the end of the editor's stream to the end of the process, in seconds."""
LARGEST = 64 << 20
"""The most bytes of a message: a source of 8 MiB has six times as many if each character is escaped."""
LONGEST = 64 << 10
"""The most bytes of a header line."""
_WATCHED = "**/*.{rts,geojson,json,toml}"


def _change(change: lsp.TextDocumentContentChangeEvent) -> TextChange:
    if isinstance(change, lsp.TextDocumentContentChangePartial):
        return TextChange(place(change.range.start), place(change.range.end), change.text)
    return TextChange(None, None, change.text)


#: the notifications of the editor, with their actions
_NOTICES: dict[str, Callable[[EditorSession, Any], None]] = {
    lsp.TEXT_DOCUMENT_DID_OPEN: lambda session, told: session.open(
        told.text_document.uri, told.text_document.version, told.text_document.text
    ),
    lsp.TEXT_DOCUMENT_DID_CHANGE: lambda session, told: session.change(
        told.text_document.uri, told.text_document.version, [_change(each) for each in told.content_changes]
    ),
    lsp.TEXT_DOCUMENT_DID_CLOSE: lambda session, told: session.close(told.text_document.uri),
    lsp.TEXT_DOCUMENT_DID_SAVE: lambda session, _: session.reread(),
    lsp.WORKSPACE_DID_CHANGE_WATCHED_FILES: lambda session, _: session.reread(),
    lsp.SHUTDOWN: lambda session, _: session.end(),
}
#: the requests of the editor: method, answer, and the options that the server registers
_QUESTIONS = (
    (lsp.TEXT_DOCUMENT_HOVER, features.hovered, None),
    (lsp.TEXT_DOCUMENT_DEFINITION, features.defined, None),
    (lsp.TEXT_DOCUMENT_DOCUMENT_HIGHLIGHT, features.highlighted, None),
    (lsp.TEXT_DOCUMENT_COMPLETION, features.completed, lsp.CompletionOptions(trigger_characters=[".", '"', "/", ":"])),
    (lsp.TEXT_DOCUMENT_SIGNATURE_HELP, features.signed, lsp.SignatureHelpOptions(trigger_characters=["(", ","])),
    (lsp.TEXT_DOCUMENT_DOCUMENT_SYMBOL, features.outline, None),
    (lsp.TEXT_DOCUMENT_FOLDING_RANGE, features.folded, None),
    (lsp.TEXT_DOCUMENT_SEMANTIC_TOKENS_FULL, features.coloured_all, features.LEGEND),
    (lsp.TEXT_DOCUMENT_PREPARE_RENAME, features.may_rename, None),
    (lsp.TEXT_DOCUMENT_FORMATTING, features.laid_out, None),
    (lsp.TEXT_DOCUMENT_CODE_ACTION, features.offered, lsp.CodeActionOptions(
        [lsp.CodeActionKind.QuickFix, lsp.CodeActionKind.SourceFixAll])),
)  # fmt: skip
#: the requests about the whole workspace, with a title for the progress
_SEARCHES = (
    (lsp.TEXT_DOCUMENT_REFERENCES, features.referred, "finding references",
     lsp.ReferenceOptions(work_done_progress=True)),
    (lsp.WORKSPACE_SYMBOL, features.symbols, "finding symbols", lsp.WorkspaceSymbolOptions(work_done_progress=True)),
    (lsp.TEXT_DOCUMENT_RENAME, features.renamed, "renaming", lsp.RenameOptions(True, work_done_progress=True)),
)  # fmt: skip


def serve(library: str, port: int | None = None, host: str = "127.0.0.1") -> None:
    """Serve one editor over the standard streams, or the first one that connects to a port, until it disconnects.

    Errors are written to the standard error, and only messages to the standard output.
    """
    logging.basicConfig(stream=sys.stderr, level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s")
    for each in logging.getLogger().handlers:
        each.setFormatter(OneLine("%(levelname)s %(name)s: %(message)s"))
    logging.getLogger("pygls.protocol.json_rpc").addFilter(_is_a_fault)
    gc.set_threshold(50_000, 20, 100)  # there are thousands of long-lived syntax trees
    server, session = make(library)
    try:
        if port is None:
            outgoing = sys.stdout.buffer
            sys.stdout = sys.stderr  # printed text must not reach the editor
            server.start_io(Watched(sys.stdin.buffer), outgoing)  # type: ignore[arg-type]
        else:
            _over(server, host, port)
    finally:
        session.end()


def _over(server: LanguageServer, host: str, port: int) -> None:
    """Serve the first editor that connects, until the connection ends."""
    with socket.create_server((host, port)) as listening:
        connection, _ = listening.accept()
    with connection, connection.makefile("rb") as incoming, connection.makefile("wb") as outgoing:
        try:
            server.start_io(Watched(incoming), outgoing)  # type: ignore[arg-type]
        except ConnectionError as error:
            logging.getLogger("rtshcua.lsp").warning("the editor is gone: %s", error)


class OneLine(logging.Formatter):
    """Formats an error as one line, because the editor's input caused it; with RTSHCUA_DEBUG=1 as a traceback."""

    def format(self, record: logging.LogRecord) -> str:
        """Format a log record."""
        if os.environ.get("RTSHCUA_DEBUG") == "1":
            return super().format(record)
        line = f"{record.levelname} {record.name}: {record.getMessage().partition(chr(10))[0]}"
        kind, error, _ = record.exc_info or (None, None, None)
        return line if kind is None else f"{line}: {kind.__name__}: {error}".partition("\n")[0]


def _is_a_fault(record: logging.LogRecord) -> bool:
    """Whether a log record reports an error of the server; a refused request is not one."""
    return not (record.exc_info and isinstance(record.exc_info[1], features.NotDone))


def make(library: str) -> tuple[LanguageServer, EditorSession]:
    """Create the server with all features, and its session. `library` is the folder for `lib:`."""
    server = LanguageServer("rtshcua", __version__, protocol_cls=Protocol)
    session = EditorSession(library, server.text_document_publish_diagnostics, _saying(server))
    _lifecycle(server, session)
    for notice, act in _NOTICES.items():
        server.feature(notice)(_asked(act, session))
    for method, answer, options in _QUESTIONS:
        server.feature(method, options)(_asked(answer, session))
    for method, search, title, told in _SEARCHES:
        server.feature(method, told)(_searched(server, search, session, title))
    return server, session


def _saying(server: LanguageServer) -> Callable[[str], None]:
    """A function that logs each text, and shows it once."""
    said: set[str] = set()

    def say(text: str) -> None:
        logging.getLogger("rtshcua.lsp").warning(text)
        if text not in said:
            said.add(text)
            server.window_show_message(lsp.ShowMessageParams(lsp.MessageType.Warning, text))

    return say


class Protocol(LanguageServerProtocol):
    """The protocol of pygls, with an answer (-32602, `Invalid params`) to malformed requests, which pygls only logs: an
    editor waits for each answer.
    """

    def structure_message(self, data: dict[str, Any]) -> Any:
        """The parsed message; None for a malformed request, which is answered here. Raises JsonRpcException."""
        try:
            return super().structure_message(data)
        except JsonRpcException as error:
            asked, number = data.get("method"), data.get("id")
            if not isinstance(asked, str) or not isinstance(number, int | str):
                raise
            why = f"invalid parameters of `{asked}`"
            self._send_response(number, error=JsonRpcInvalidParams(message=why, data=str(error)).to_response_error())
            return None

    def handle_message(self, message: Any) -> None:
        """Pass a message to its feature, unless it was already answered."""
        if message is not None:
            super().handle_message(message)


class Watched:
    """The editor's stream. When it ends, the process ends too, by force if needed, because a check cannot be
    interrupted.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream

    def readline(self) -> bytes:
        """Read a header line; at the end a part of one, or nothing. A line over `LONGEST` counts as the end."""
        data = self._stream.readline(LONGEST)
        return self._seen(data, ended=not data.endswith(b"\n"))

    def read(self, size: int) -> bytes:
        """Read `size` bytes; fewer at the end. A size over `LARGEST` counts as the end."""
        if size > LARGEST:
            logging.getLogger("rtshcua.lsp").warning("a message of %d bytes is not read", size)
        data = self._stream.read(size) if size <= LARGEST else b""
        return self._seen(data, ended=len(data) < size)

    def _seen(self, data: bytes, *, ended: bool) -> bytes:
        # A cut message is checked too: if its answer cannot be sent, nothing more is read.
        if ended:
            forced = Timer(GRACE, os._exit, (0,))
            forced.daemon = True
            forced.start()
        return data


def _asked(answer: Any, session: EditorSession) -> Any:
    """Wrap an answer as a handler, because pygls inspects the names of a handler's arguments."""

    def handler(params: Any) -> Any:
        return answer(session, params)

    return handler


def _searched(server: LanguageServer, search: Any, session: EditorSession, title: str) -> Any:
    """Wrap a search as a handler that runs it in the search thread, with progress."""

    async def handler(params: Any) -> Any:
        shown = Shown(server.progress, params.work_done_token, title)
        try:
            return await session.searching.answer(session, search, params, shown.tell)
        finally:
            shown.end()

    return handler


def _lifecycle(server: LanguageServer, session: EditorSession) -> None:
    def initialize(params: lsp.InitializeParams) -> None:
        session.encoding = Encoding(server.workspace.position_encoding or "utf-16")
        folders = [each.uri for each in params.workspace_folders or ()] or [params.root_uri or ""]
        session.look_in([path for uri in folders if (path := path_of(uri)) is not None])
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
        session.look_in([*(each for each in session.folders if each not in gone), *added])

    server.feature(lsp.INITIALIZE)(initialize)
    server.feature(lsp.INITIALIZED)(initialized)
    server.feature(lsp.WORKSPACE_DID_CHANGE_WORKSPACE_FOLDERS)(folders)
