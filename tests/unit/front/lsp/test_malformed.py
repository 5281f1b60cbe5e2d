"""Malformed messages of an editor: every request is answered."""

import json
import logging
import sys
from typing import Any

import pytest

from virtual.rows import rows

pytest.importorskip("pygls")

from rtshcua.front.lsp.server import OneLine, make
from rtshcua.library import root

PLACE = {"line": 0, "character": 0}
TEXT = {"uri": "file:///a.rts"}


class _Sent:
    """The other end of the wire."""

    def __init__(self) -> None:
        self.answers: list[Any] = []

    def write(self, data: bytes) -> None:
        self.answers.append(json.loads(data.partition(b"\r\n\r\n")[2]))


def _said(message: dict[str, Any]) -> list[Any]:
    """The server's answer to a message as read by pygls."""
    server, session = make(str(root()))
    sent = _Sent()
    server.protocol.set_writer(sent)  # type: ignore[arg-type]  # it has what is used of one
    try:
        text = json.dumps({"jsonrpc": "2.0", **message})
        server.protocol.handle_message(json.loads(text, object_hook=server.protocol.structure_message))
    finally:
        session.end()
    return sent.answers


@rows(
    "params",
    [
        {},
        {"textDocument": TEXT},
        {"textDocument": TEXT, "position": {"line": -1, "character": 0}},
        {"textDocument": TEXT, "position": {"line": "x", "character": 0}},
        {"textDocument": TEXT, "position": {"line": 1 << 40, "character": 0}},
        {"textDocument": 5, "position": PLACE},
        [],
        "x",
        None,
    ],
)
@rows("number", [7, "seven"])
def test_a_request_is_answered(params: Any, number: int | str) -> None:
    (answer,) = _said({"id": number, "method": "textDocument/hover", "params": params})
    assert (answer["id"], answer["error"]["code"]) == (number, -32602)
    assert "`textDocument/hover`" in answer["error"]["message"]


def test_a_request_without_parameters_is_answered() -> None:
    (answer,) = _said({"id": 1, "method": "textDocument/rename"})
    assert answer["error"]["code"] == -32602


def test_a_request_that_is_well_formed_is_handled() -> None:
    (answer,) = _said({"id": 1, "method": "textDocument/nonsense", "params": {}})
    assert answer["error"]["code"] == -32601


@rows("debug", ["", "1"])
def test_unreadable_message_is_logged_on_one_line(debug: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RTSHCUA_DEBUG", debug)
    try:
        json.loads("[")
    except ValueError:
        fault = sys.exc_info()
    formatter = OneLine("%(levelname)s %(name)s: %(message)s")
    told = [
        formatter.format(logging.LogRecord("pygls", logging.ERROR, "", 0, "unread\n%s", ("Traceback",), each))
        for each in (None, fault)
    ]
    if debug:
        assert all("Traceback" in each for each in told)
    else:
        assert told[0] == "ERROR pygls: unread"
        assert told[1].startswith("ERROR pygls: unread: JSONDecodeError: Expecting value")
        assert len(told[1].splitlines()) == 1
