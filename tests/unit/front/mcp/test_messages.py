"""Messages of a host: each is read as JSON-RPC, or refused with its id if that is certain."""

import json
import random
from typing import Any

import pytest

from rtshcua.front.mcp.messages import (  # fmt: skip
    MOST_ID,
    MOST_OCTETS,
    MOST_VALUES,
    NO_JSON,
    NO_REQUEST,
    Wrong,
    line_of,
    read_message,
    writable,
)

MANY = b"[" + b"1," * MOST_VALUES + b"1]"


def asked(more: bytes = b"") -> bytes:
    return b'{"jsonrpc":"2.0","id":1,"method":"m","params":{' + more + b"}}"


#: a line, and the code and id of its refusal
REFUSED = {
    b'{"jsonrpc":"2.0","id":"\\ud800","method":"m"}': (NO_JSON, None),
    b'{"jsonrpc":"2.0","id":1,"method":"\\udfff\\ud800"}': (NO_JSON, 1),
    asked(b'"a":"\\ud800"'): (NO_JSON, 1),
    asked(b'"\\ud800":1'): (NO_JSON, 1),
    asked(b'"a":NaN'): (NO_JSON, 1),
    asked(b'"a":-Infinity'): (NO_JSON, 1),
    asked(b'"a":1e999'): (NO_JSON, 1),
    asked(b'"a":' + b"9" * 5_000): (NO_JSON, 1),
    asked(b'"a":1,"a":2'): (NO_JSON, 1),
    asked(b'"a":' + b"[" * 100 + b"]" * 100): (NO_JSON, 1),
    b"[" * 60_000: (NO_JSON, None),
    b'{"jsonrpc":"2.0","id":1,"id":2,"method":"m"}': (NO_JSON, None),
    b'{"jsonrpc":"2.0","id":"\xff","method":"m"}': (NO_JSON, None),
    b'{"jsonrpc":"2.0","id":"\xed\xa0\x80","method":"m"}': (NO_JSON, None),
    b'\xef\xbb\xbf{"jsonrpc":"2.0","id":1,"method":"m"}': (NO_JSON, None),
    b"\0": (NO_JSON, None),
    b"{": (NO_JSON, None),
    b'{"jsonrpc":"2.0","id":1.0,"method":"m"}': (NO_REQUEST, None),
    b'{"jsonrpc":"2.0","id":NaN,"method":"m"}': (NO_JSON, None),
    b'{"jsonrpc":"2.0","id":true,"method":"m"}': (NO_REQUEST, None),
    b'{"jsonrpc":"2.0","id":null,"method":"m"}': (NO_REQUEST, None),
    b'{"jsonrpc":"2.0","id":{"id":1},"method":"m"}': (NO_REQUEST, None),
    b'{"jsonrpc":"2.0","id":' + b"9" * 20 + b',"method":"m"}': (NO_REQUEST, None),
    b'{"jsonrpc":"2.0","id":' + b"9" * 2_000 + b',"method":"m"}': (NO_JSON, None),
    b'{"jsonrpc":"2.0","id":"' + b"x" * (MOST_ID + 1) + b'","method":"m"}': (NO_REQUEST, None),
    b"[" + asked() + b"," + asked() + b"]": (NO_REQUEST, None),
    b"null": (NO_REQUEST, None),
    b"{}": (NO_REQUEST, None),
    b'{"jsonrpc":"1.0","id":1,"method":"m"}': (NO_REQUEST, 1),
    b'{"jsonrpc":"2.0","id":1,"method":2}': (NO_REQUEST, 1),
    b'{"jsonrpc":"2.0","id":1,"method":"m","params":[]}': (NO_REQUEST, 1),
    b'{"jsonrpc":"2.0","id":1}': (NO_REQUEST, None),
    b'{"jsonrpc":"2.0","id":1,"result":{},"error":{}}': (NO_REQUEST, None),
    # too large: the id is known where it is the outermost object's, among its first members
    asked(b'"a":' + MANY): (NO_REQUEST, 1),
    b' { "method" : "m" , "id" : "a" ,"params":' + MANY: (NO_REQUEST, "a"),
    b'{"jsonrpc":"2.0","method":"m","params":{"id":7,"a":' + MANY + b'},"id":8}': (NO_REQUEST, 8),
    b'{"method":"m","params":{"a":' + MANY + b'},"jsonrpc":"2.0","id":9}\n': (NO_REQUEST, 9),
    b'{"method":"m","params":[' + MANY + b',{"jsonrpc":"2.0","id":9}]}': (NO_REQUEST, None),
    b'{"jsonrpc":"2.0","method":"\\"id\\":7","params":' + MANY: (NO_REQUEST, None),
    b'[{"jsonrpc":"2.0","id":1,"method":' + MANY: (NO_REQUEST, None),
    b'{"id":1.5,"params":' + MANY: (NO_REQUEST, None),
    b'{"id":-0,"params":' + MANY: (NO_REQUEST, None),
    b'{"id":"\xed\xa0\x80","params":' + MANY: (NO_REQUEST, None),
    b'{"id":"' + b"x" * (MOST_ID + 1) + b'","params":' + MANY: (NO_REQUEST, None),
    b'{"id":' + b" " * 2_000 + b'1,"params":' + MANY: (NO_REQUEST, None),
    b'{"id":1,"a":"' + b"x" * MOST_OCTETS + b'"}': (NO_REQUEST, 1),
}


def test_invalid_message_is_refused_with_its_certain_id() -> None:
    wrong = {}
    for line, expected in REFUSED.items():
        read = read_message(line)
        if not isinstance(read, Wrong) or (read.code, read.id) != expected:
            wrong[line[:80]] = read
    assert not wrong


def test_truncated_message_is_refused_with_its_id() -> None:
    assert read_message(asked(), whole=False) == Wrong(
        NO_REQUEST, "the message is larger than 4 MiB or 65536 values", 1
    )
    last = read_message(b'{"method":"m","params":{"a":["xxx' + b'xxx"]},"jsonrpc":"2.0","id":9}', whole=False)
    assert isinstance(last, Wrong)
    assert last.id == 9


@pytest.mark.parametrize(
    "told",
    [
        {"id": 1, "method": "m"},
        {"id": "\0é\u2028𝄞", "method": "m", "params": {"a": [1.5, None, "\\ud800"]}},
        {"method": "m"},
        {"id": 1, "result": {}},
        {"id": "x", "error": {"code": 1}},
    ],
)
def test_valid_message_is_read(told: dict[str, Any]) -> None:
    told = {"jsonrpc": "2.0"} | told
    assert read_message(json.dumps(told).encode()) == told
    assert read_message(json.dumps(told, ensure_ascii=False).encode()) == told


def test_a_refusal_is_one_line_with_its_id_or_null() -> None:
    assert Wrong(NO_JSON, "a\nb").answer().count(b"\n") == 1
    assert json.loads(Wrong(NO_JSON, "a").answer()) == {
        "jsonrpc": "2.0", "id": None, "error": {"code": NO_JSON, "message": "a"},
    }  # fmt: skip
    assert json.loads(Wrong(NO_REQUEST, "a", "x").answer())["id"] == "x"


def test_any_external_text_can_be_serialised() -> None:
    told = {"\ud800": float("nan"), "b": ["\udfff\ud800", float("inf"), -float("inf"), 1.5, "é"], "c": "\ud834\udd1e"}
    mended = {"\ufffd": None, "b": ["\ufffd\ufffd", None, None, 1.5, "é"], "c": "\ufffd\ufffd"}
    assert writable(told)[0] == mended
    line = line_of(told)
    assert line.isascii()
    assert json.loads(line, parse_constant=pytest.fail) == mended
    assert writable({"a": 1}) == ({"a": 1}, '{"a": 1}')


def test_mutated_message_is_read_or_refused() -> None:
    chance = random.Random(1)
    lines = [asked(b'"a":{"b":["c",1.5,null]}'), b'{"jsonrpc":"2.0","id":"x","result":{"a":"\\u00e9"}}']
    parts = [b"\\ud800", b'"', b"{", b"]", b"\xff", b"\0", b"NaN", b",", b'"id":', b"1e999", b"9" * 30]
    for _ in range(3_000):
        line = bytearray(chance.choice(lines))
        for _ in range(chance.randrange(1, 4)):
            place = chance.randrange(len(line))
            line[place : place + chance.randrange(3)] = chance.choice(parts)
        read = read_message(bytes(line))
        answer = read.answer() if isinstance(read, Wrong) else line_of(read)
        told = json.loads(answer.decode("ascii"), parse_constant=pytest.fail)
        assert told.get("id") is None or f'"id":{json.dumps(told["id"])}'.encode() in line or b"\\u" in line
