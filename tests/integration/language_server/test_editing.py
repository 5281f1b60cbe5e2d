"""The language server as an editor has it: one process, over its standard streams, asked by pygls's own client."""

from pathlib import Path

import pytest
from lsprotocol import types as lsp
from pygls.exceptions import JsonRpcException

from rtshcua.front.lsp.disk import uri_of
from virtual.editor import HEAD, MISSION, Editor, at, document


@pytest.mark.slow
def test_findings_come_at_once_and_more_when_the_author_pauses(editor: Editor, folder: Path) -> None:
    uri = uri_of(str(folder / "pause.rts"))
    assert editor.open(uri, MISSION) == []
    found = editor.change(uri, 2, (3, 41, 3, 41, "0"))  # `takeoff(altitude = 200 m)`
    assert [each.code for each in found] == ["E0605"]
    assert found[0].range == lsp.Range(at(3, 39), at(3, 44))
    assert found[0].code_description is not None
    assert found[0].code_description.href.endswith("/docs/codes/E0605.md")
    assert found[0].related_information
    assert editor.change(uri, 3, (3, 41, 3, 42, "")) == []
    assert editor.change(uri, 4, (3, 39, 3, 41, "45")) == []  # it is permitted up to 40 m, which is a proof's to say
    found = editor.until(uri, lambda told: bool(told.diagnostics))
    assert "E0703" in {each.code for each in found}
    moved = editor.change(uri, 5, (0, 0, 0, 0, "// a comment: what was proved holds, further down\n"))
    assert [each.range.start.line for each in moved] == [each.range.start.line + 1 for each in found]
    editor.close(uri)


def test_syntax_errors_fixes_and_code_actions(editor: Editor, folder: Path) -> None:
    uri = uri_of(str(folder / "fix.rts"))
    (found,) = editor.open(uri, "zone a = circle(47.39 N, 8.54 E, 5 m) cieling 60 m\n")
    assert found.code == "E0101"
    asked = lsp.CodeActionParams(document(uri), found.range, lsp.CodeActionContext([found]))
    (action,) = editor.run(editor.client.text_document_code_action_async(asked))
    (edit,) = action.edit.document_changes
    assert (edit.text_document.version, edit.edits[0].new_text) == (1, "ceiling")
    assert editor.change(uri, 2, (0, 38, 0, 45, "ceiling")) == []
    editor.close(uri)


def test_columns_are_utf_16_and_lines_end_in_two_ways(editor: Editor, folder: Path) -> None:
    uri = uri_of(str(folder / "clef.rts"))
    text = "/* 𝄞 */ zone a = union(nothing_1)\r\n/* é */ zone b = union(nothing_2)\n// 𝄞\nzone c = union(nothing_3)\n"
    found = editor.open(uri, text)
    assert [(each.range.start.line, each.range.start.character) for each in found] == [(0, 24), (1, 23), (3, 15)]
    found = editor.change(uri, 2, (0, 3, 0, 5, "ab𝄞"), (0, 26, 0, 35, "b"))
    assert [(each.range.start.line, each.range.start.character) for each in found] == [(1, 23), (3, 15)]
    editor.close(uri)


def test_names_across_files_that_are_not_saved(editor: Editor, folder: Path) -> None:
    """One buffer imports another; neither is on the disk."""
    site, mission = (uri_of(str(folder / name)) for name in ("ours.rts", "flight.rts"))
    assert editor.open(site, HEAD + "zone pond = circle(47.3986 N, 8.5466 E, 10 m) ceiling 20 m\n") == []
    text = MISSION.replace(HEAD, 'import "ours.rts"\n').replace(
        "return_home() }", "return_home() { require position outside pond } }"
    )
    assert editor.open(mission, text) == []
    place = text.split("\n")[4].index("pond")
    client, here = editor.client, (document(mission), at(4, place))
    (where,) = editor.run(client.text_document_definition_async(lsp.DefinitionParams(*here)))
    assert (where.uri, where.range.start) == (site, at(1, 5))
    hover = editor.run(client.text_document_hover_async(lsp.HoverParams(*here)))
    assert "20 m × 20 m" in hover.contents.value
    asked = lsp.ReferenceParams(lsp.ReferenceContext(True), document(site), at(1, 6))
    assert {each.uri for each in editor.run(client.text_document_references_async(asked))} == {site, mission}
    edit = editor.run(client.text_document_rename_async(lsp.RenameParams(document(site), at(1, 6), "lake")))
    assert {each.text_document.uri: [one.new_text for one in each.edits] for each in edit.document_changes} == {
        site: ["lake"], mission: ["lake"],
    }  # fmt: skip
    with pytest.raises(JsonRpcException, match="already"):
        editor.run(client.text_document_rename_async(lsp.RenameParams(document(site), at(1, 6), "city")))
    found = editor.change(site, 2, (1, 5, 1, 9, "lake"))  # only here: the other text now means nothing by it
    assert found == []
    editor.until(mission, lambda told: "E0201" in {each.code for each in told.diagnostics})
    editor.close(site)
    editor.until(mission, lambda told: {each.code for each in told.diagnostics} == {"E0108"})
    editor.close(mission)


def test_completion_and_signature_help_follow_the_text(editor: Editor, folder: Path) -> None:
    uri = uri_of(str(folder / "writing.rts"))
    editor.open(uri, MISSION.replace("return_home() }", "takeoff( }"))
    client = editor.client
    place = (document(uri), at(4, 28))
    items = editor.run(client.text_document_completion_async(lsp.CompletionParams(*place))).items
    assert "altitude" in {each.label for each in items}
    signed = editor.run(client.text_document_signature_help_async(lsp.SignatureHelpParams(*place)))
    assert signed.signatures[0].label.startswith("takeoff(altitude: altitude")
    outline = editor.run(client.text_document_document_symbol_async(lsp.DocumentSymbolParams(document(uri))))
    assert outline == []  # the one declaration is not whole
    editor.change(uri, 2, MISSION)
    (outline,) = editor.run(client.text_document_document_symbol_async(lsp.DocumentSymbolParams(document(uri))))
    assert [outline.name, *(each.name for each in outline.children)] == ["m", "departure", "recovery"]
    folds = editor.run(client.text_document_folding_range_async(lsp.FoldingRangeParams(document(uri))))
    assert [(each.start_line, each.end_line) for each in folds] == [(1, 4)]
    tokens = editor.run(client.text_document_semantic_tokens_full_async(lsp.SemanticTokensParams(document(uri))))
    assert len(tokens.data) % 5 == 0
    assert len(tokens.data) > 20
    options = lsp.FormattingOptions(2, True)
    editor.change(uri, 3, MISSION.replace("mission m ", "mission   m   "))
    asked = lsp.DocumentFormattingParams(document(uri), options)
    edits = editor.run(client.text_document_formatting_async(asked))
    assert len(edits) == 1
    found = editor.run(client.workspace_symbol_async(lsp.WorkspaceSymbolParams("bridge_insp")))
    assert [each.name for each in found] == ["bridge_inspection"]
    lit = lsp.DocumentHighlightParams(document(uri), at(1, 10))
    lights = editor.run(client.text_document_document_highlight_async(lit))
    assert len(lights) == 1
    editor.close(uri)


@pytest.mark.parametrize(
    "uri", ["untitled:Untitled-1", "file:///c%3A/work/odd%20name.rts", "vscode-vfs://host/a/b.rts"]
)
def test_documents_without_a_local_file_are_checked(editor: Editor, uri: str) -> None:
    assert [each.code for each in editor.open(uri, "zone a = union(nothing)\n")] == ["E0201"]
    assert editor.change(uri, 2, HEAD) == []
    editor.close(uri)


def test_odd_texts_and_questions_out_of_place(editor: Editor, folder: Path) -> None:
    uri = uri_of(str(folder / "odd.rts"))
    assert [each.code for each in editor.open(uri, "zone a = \0")] == ["E0103"]
    assert [each.code for each in editor.change(uri, 2, "// " + "x" * (8 << 20))] == ["E0104"]
    far = lsp.HoverParams(document(uri), at(99_999, 99_999))
    assert editor.run(editor.client.text_document_hover_async(far)) is None
    editor.change(uri, 3, "")
    nowhere = lsp.HoverParams(document(uri_of(str(folder / "none.rts"))), at(0, 0))
    assert editor.run(editor.client.text_document_hover_async(nowhere)) is None
    for body in (b"{", b"[]", b'{"jsonrpc": "2.0", "id": 7, "method": "textDocument/hover", "params": {"x": 1}}',
                 b'{"jsonrpc": "2.0", "method": "textDocument/didChange", "params": {}}',
                 b'{"jsonrpc": "2.0", "id": 8, "method": "rtshcua/nothing", "params": {}}',
                 b'{"jsonrpc": "2.0", "method": "$/cancelRequest", "params": {"id": 99}}'):  # fmt: skip
        editor.client.protocol.writer.write(b"Content-Length: %d\r\n\r\n%b" % (len(body), body))
    editor.close(uri)
    assert editor.open(uri, "") == []  # and it still answers
    editor.close(uri)
    editor.shown.clear()
