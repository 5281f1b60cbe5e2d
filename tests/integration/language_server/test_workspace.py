"""What the server is asked about more than one text, what a project says, and how it ends."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from time import monotonic, sleep
from typing import TypeVar

import pytest
from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcException

from rtshcua.front.lsp.disk import uri_of
from virtual.editor import HEAD, PATIENCE, Editor, at, document

T = TypeVar("T")


@pytest.mark.slow
def test_references_list_the_imports_of_a_file(editor: Editor, folder: Path) -> None:
    one, other = (uri_of(str(folder / name)) for name in ("near.rts", "far.rts"))
    editor.open(one, HEAD)
    editor.open(
        other, '// the same, also by another path\nimport "lib:skills/../policies/bridge_inspection.rts"\n' + HEAD
    )
    asked = lsp.ReferenceParams(lsp.ReferenceContext(True), document(one), at(0, 12))
    found = editor.run(editor.client.text_document_references_async(asked))
    mine = [(each.uri, each.range.start.line) for each in found if each.uri in (one, other)]
    assert mine == [(other, 1), (other, 2), (one, 0)]
    for uri in (one, other):
        editor.close(uri)


def test_search_reports_progress_without_delaying_findings(editor: Editor, folder: Path) -> None:
    many = folder / "many"
    many.mkdir()
    for n in range(30):
        (many / f"{n}.rts").write_text(f"{HEAD}zone field_{n} = union(bridge_a)\n")
    uri = uri_of(str(many / "0.rts"))
    editor.open(uri, HEAD + "zone field_0 = union(bridge_a)\n")
    editor.progress.clear()
    asked = lsp.ReferenceParams(lsp.ReferenceContext(False), document(uri), at(1, 22), work_done_token="t")
    answer = editor.client.text_document_references_async(asked)
    found, first = editor.run(editor.first_of(answer, uri, HEAD + "zone field_0 = union(nothing)\n", 2))
    assert first == "findings"
    assert len([each for each in found if each.uri.startswith(uri_of(str(many)))]) == 30  # of the text as it was
    kinds = [each.value["kind"] for each in editor.progress if each.token == "t"]
    assert (kinds[0], kinds[-1], set(kinds[1:-1])) == ("begin", "end", {"report"})
    editor.close(uri)


def test_a_search_is_taken_back(editor: Editor, folder: Path) -> None:
    uri = uri_of(str(folder / "back.rts"))
    editor.open(uri, HEAD)

    async def taking_back(name: str) -> None:
        asked = editor.client.protocol.send_request_async(lsp.WORKSPACE_SYMBOL, lsp.WorkspaceSymbolParams(""), name)
        editor.client.cancel_request(lsp.CancelParams(name))
        await asked

    def is_taken_back(name: str) -> bool:
        try:
            editor.run(taking_back(name))
        except JsonRpcException as error:
            return "cancel" in str(error).lower()
        return False  # it was answered before

    assert any(is_taken_back(f"s{number}") for number in range(20))
    found = editor.run(editor.client.workspace_symbol_async(lsp.WorkspaceSymbolParams("bridge_insp")))
    assert [each.name for each in found] == ["bridge_inspection"]
    editor.close(uri)


def test_formatting_is_as_wide_as_the_project_says(editor: Editor, folder: Path) -> None:
    (folder / "narrow").mkdir()
    (folder / "narrow" / "rtshcua.toml").write_text('[format]\nwidth = 60\nexclude = ["as_it_is.rts"]\n')
    text = "zone far_away = polygon(47.1 N, 8.1 E, 47.2 N, 8.1 E, 47.2 N, 8.2 E, 47.1 N, 8.2 E)  ceiling 60 m\n"
    made = {}
    for name in ("narrow/a.rts", "narrow/as_it_is.rts", "wide.rts"):
        uri = uri_of(str(folder / name))
        editor.open(uri, text)
        asked = lsp.DocumentFormattingParams(document(uri), lsp.FormattingOptions(2, True))
        edits = editor.run(editor.client.text_document_formatting_async(asked))
        made[name] = "".join(each.new_text for each in edits or ())
        editor.close(uri)
    assert "\n" in made["narrow/a.rts"]
    assert made["narrow/as_it_is.rts"] == made["wide.rts"] == ""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="looks for processes in /proc")
def test_server_exits_when_the_editor_dies(tmp_path: Path) -> None:
    """Without a word, in the middle of a message; and so does the process that proves."""
    command = [sys.executable, "-P", "-m", "rtshcua", "lsp"]
    server = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=tmp_path)
    assert server.stdin is not None
    assert server.stdout is not None
    try:
        for body in (
            b'{"jsonrpc": "2.0", "id": 1, "method": "initialize", "params": {"capabilities": {}}}',
            b'{"jsonrpc": "2.0", "method": "initialized", "params": {}}',
            b'{"jsonrpc": "2.0", "method": "textDocument/didOpen", "params": {"textDocument": {"uri": "file:///a.rts",'
            b' "languageId": "rtshcua", "version": 1, "text": "import \\"lib:missions/extended.rts\\"\\n"}}}',
        ):
            server.stdin.write(b"Content-Length: %d\r\n\r\n%b" % (len(body), body))
        server.stdin.write(b'Content-Length: 999\r\n\r\n{"jsonrpc')
        server.stdin.flush()
        children = Path(f"/proc/{server.pid}/task/{server.pid}/children")
        proving = until(lambda: children.read_text().split())
        server.stdin.close()
        server.stdout.close()
        assert server.wait(PATIENCE) == 0
        until(lambda: not any(is_running(pid) for pid in proving))
    finally:
        server.kill()
        server.wait()


def until(true: Callable[[], T]) -> T:
    """What is asked for, as soon as it is so."""
    last = monotonic() + PATIENCE
    while not (found := true()):
        assert monotonic() < last
        sleep(0.02)
    return found


def is_running(pid: str) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
