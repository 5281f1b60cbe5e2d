"""An editor for the language server: pygls's client, which stores the received diagnostics."""

import asyncio
import sys
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

from lsprotocol import types as lsp
from pygls.lsp.client import LanguageClient

from rtshcua.front.lsp.disk import uri_of

PATIENCE = 60  # seconds, enough for a busy machine
HEAD = 'import "lib:policies/bridge_inspection.rts"\n'
MISSION = (
    HEAD
    + """mission m under bridge_inspection@7 on quad {
  proposed by agent openclaw for role operator
  phase departure { takeoff(altitude = 20 m) }
  phase recovery  { return_home() }
}
"""
)


class Editor:
    """An editor that stores the diagnostics of each text and can wait for them."""

    def __init__(self) -> None:
        self.loop = asyncio.new_event_loop()
        self.client = LanguageClient("test", "1")
        self.told: dict[str, list[lsp.PublishDiagnosticsParams]] = {}
        self.shown: list[str] = []
        self.progress: list[lsp.ProgressParams] = []
        self._news = asyncio.Event()

        @self.client.feature(lsp.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)
        def _told(params: lsp.PublishDiagnosticsParams) -> None:
            self.told.setdefault(params.uri, []).append(params)
            self._news.set()

        @self.client.feature(lsp.WINDOW_SHOW_MESSAGE)
        def _shown(params: lsp.ShowMessageParams) -> None:
            self.shown.append(params.message)

        @self.client.feature(lsp.PROGRESS)
        def _progress(params: lsp.ProgressParams) -> None:
            self.progress.append(params)

        @self.client.feature(lsp.CLIENT_REGISTER_CAPABILITY)
        def _registered(_params: lsp.RegistrationParams) -> None:
            return None

    def run(self, work: Coroutine[Any, Any, Any]) -> Any:
        return self.loop.run_until_complete(asyncio.wait_for(work, PATIENCE))

    async def start(self, folder: Path) -> lsp.InitializeResult:
        await self.client.start_io(sys.executable, "-P", "-m", "rtshcua", "lsp", cwd=str(folder))
        capabilities = lsp.ClientCapabilities(
            general=lsp.GeneralClientCapabilities(position_encodings=["utf-16"]),
            workspace=lsp.WorkspaceClientCapabilities(
                workspace_edit=lsp.WorkspaceEditClientCapabilities(document_changes=True)
            ),
        )
        folders = [lsp.WorkspaceFolder(uri_of(str(folder)), "work")]
        made = lsp.InitializeParams(capabilities, workspace_folders=folders)
        found = await self.client.initialize_async(made)
        self.client.initialized(lsp.InitializedParams())
        return found

    def open(self, uri: str, text: str) -> list[lsp.Diagnostic]:
        """Open a text and return its first diagnostics."""
        self.told.pop(uri, None)
        self.client.text_document_did_open(lsp.DidOpenTextDocumentParams(lsp.TextDocumentItem(uri, "rtshcua", 1, text)))
        return self.until(uri, lambda told: told.version == 1)

    def change(self, uri: str, version: int, *changes: tuple[int, int, int, int, str] | str) -> list[lsp.Diagnostic]:
        """Change a text, by ranges or as a whole, and return its first diagnostics."""
        made: list[Any] = []
        for each in changes:
            if isinstance(each, str):
                made.append(lsp.TextDocumentContentChangeWholeDocument(each))
            else:
                line, column, end_line, end_column, text = each
                span = lsp.Range(lsp.Position(line, column), lsp.Position(end_line, end_column))
                made.append(lsp.TextDocumentContentChangePartial(span, text))
        self.client.text_document_did_change(
            lsp.DidChangeTextDocumentParams(lsp.VersionedTextDocumentIdentifier(version, uri), made)
        )
        return self.until(uri, lambda told: told.version == version)

    def until(self, uri: str, fits: Callable[[lsp.PublishDiagnosticsParams], bool]) -> list[lsp.Diagnostic]:
        """Wait for diagnostics of a text that satisfy a condition, and return them."""

        async def waiting() -> list[lsp.Diagnostic]:
            while not (self.told.get(uri) and fits(self.told[uri][-1])):
                self._news.clear()
                await self._news.wait()
            return list(self.told[uri][-1].diagnostics)

        found: list[lsp.Diagnostic] = self.run(waiting())
        return found

    async def first_of(self, answer: Any, uri: str, text: str, version: int) -> tuple[Any, str]:
        """Change a text during a request; return the answer, and whether it or the diagnostics came first."""
        answered = asyncio.ensure_future(answer)
        await asyncio.sleep(0)
        self.client.text_document_did_change(
            lsp.DidChangeTextDocumentParams(
                lsp.VersionedTextDocumentIdentifier(version, uri), [lsp.TextDocumentContentChangeWholeDocument(text)]
            )
        )
        while not (self.told.get(uri) and self.told[uri][-1].version == version):
            self._news.clear()
            await self._news.wait()
        first = "answer" if answered.done() else "findings"
        return await answered, first

    def close(self, uri: str) -> None:
        self.client.text_document_did_close(lsp.DidCloseTextDocumentParams(lsp.TextDocumentIdentifier(uri)))

    def end(self) -> int | None:
        async def ending() -> int | None:
            await self.client.shutdown_async(None)
            self.client.exit(None)
            process = self.client._server
            assert process is not None
            code: int | None = await process.wait()
            await self.client.stop()
            return code

        code: int | None = self.run(ending())
        self.loop.close()
        return code


def at(line: int, column: int) -> lsp.Position:
    return lsp.Position(line, column)


def document(uri: str) -> lsp.TextDocumentIdentifier:
    return lsp.TextDocumentIdentifier(uri)
