"""JSON-RPC messages of a host, from octets and to octets: what is no message is refused, with its id if that is known.

The SDK reads more than the protocol has (an id that is no number is taken for none, half a surrogate pair for a
character) and cannot write all that it read. Sources: JSON-RPC 2.0, sections 4 and 5; MCP 2026-07-28, transports;
RFC 7493 (I-JSON): no lone surrogates, and no key twice in an object.
"""

import json
import re
from math import isfinite
from typing import Any, Final, NamedTuple

from rtshcua.ground.language.size_limits import bare_of, values_of

#: octets and values (`without_texts`) of one message: the largest mission that a flight takes has 250 KB. Python needs
#: many times the octets, where one character of a text is beyond U+FFFF
MOST_OCTETS: Final = 4 << 20
MOST_VALUES: Final = 1 << 16
#: objects and lists in one another: a mission has 16, and its message 4 around it
MOST_DEPTH: Final = 64
#: an id: characters of a text, bits of a number
MOST_ID: Final = 256
MOST_ID_BITS: Final = 63
#: digits of a whole number
MOST_DIGITS: Final = 1_000
#: error codes of JSON-RPC 2.0, section 5.1
NO_JSON: Final = -32700
NO_REQUEST: Final = -32600
NO_METHOD: Final = -32601
#: among so many octets at its beginning or end an id is known of a message that is too large
ENDS: Final = 1_024

_TOO_LARGE: Final = f"the message is larger than {MOST_OCTETS >> 20} MiB or {MOST_VALUES} values"
#: the outermost id, where nothing stands before it but members that are texts without escapes
_ID: Final = re.compile(
    rb'[ \t\r]*\{(?:[ \t\r]*"(?:jsonrpc|method)"[ \t\r]*:[ \t\r]*"[^"\\]*"[ \t\r]*,)*'
    rb'[ \t\r]*"id"[ \t\r]*:[ \t\r]*(-?[1-9][0-9]{0,17}|0|"[^"\\\x00-\x1f]*")[ \t\r]*[,}]'
)
#: the same at the end, as clients write it whose parameters come first: nothing but the outermost object ends there
_ID_LAST: Final = re.compile(
    rb',[ \t\r]*"id"[ \t\r]*:[ \t\r]*(-?[1-9][0-9]{0,17}|0|"[^"\\\x00-\x1f]*")[ \t\r]*'
    rb'(?:,[ \t\r]*"jsonrpc"[ \t\r]*:[ \t\r]*"2\.0"[ \t\r]*)?\}[ \t\r\n]*\Z'
)
_BRACKETS: Final = re.compile(rb"[\[\]{}]")
_SURROGATE: Final = re.compile("[\ud800-\udfff]")


class Wrong(NamedTuple):
    """What is no message: the code of JSON-RPC, what is wrong, and the request's id; None where that is not known."""

    code: int
    text: str
    id: int | str | None = None

    def answer(self) -> bytes:
        """The answer to it, a line."""
        return line_of({"jsonrpc": "2.0", "id": self.id, "error": {"code": self.code, "message": self.text}})


class _Reading:
    """What is wrong with JSON that Python reads all the same, and whether the latest object has a key twice: the
    outermost is the last.
    """

    def __init__(self) -> None:
        self.wrong = ""
        self.twice = False

    def once(self, pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        made = dict(pairs)
        self.twice = len(made) < len(pairs)
        if self.twice:
            self.wrong = "the message has a key twice in one object"
        return made

    def constant(self, name: str) -> None:
        self.wrong = f"the message has {name}, which is not a number in JSON"

    def whole(self, text: str) -> int | None:
        if len(text) <= MOST_DIGITS:
            return int(text)
        self.wrong = f"the message has a number of more than {MOST_DIGITS} digits"
        return None

    def broken(self, text: str) -> float:
        number = float(text)
        if not isfinite(number):
            self.wrong = "the message has a number that is too large"
        return number


def read_message(line: bytes, *, whole: bool = True) -> dict[str, Any] | Wrong:
    """A request, notification or response of a host; `Wrong` where it is none. `whole`: False where no more is left of
    it than `ENDS` octets of its beginning and as many of its end.
    """
    bare = bare_of(line, MOST_VALUES) if whole and len(line) <= MOST_OCTETS else None
    if bare is None or values_of(bare) > MOST_VALUES:
        return Wrong(NO_REQUEST, _TOO_LARGE, _id_of_large(line))
    if _depth(bare) > MOST_DEPTH:
        deep = f"the message is nested more than {MOST_DEPTH} deep"
        return Wrong(NO_JSON, deep, _id_of_large(line))
    reading = _Reading()
    try:
        text = line.decode()
        told = json.loads(
            text, object_pairs_hook=reading.once, parse_constant=reading.constant, parse_int=reading.whole,
            parse_float=reading.broken,
        )  # fmt: skip
    except UnicodeDecodeError:
        return Wrong(NO_JSON, "the message is not UTF-8")
    except (ValueError, RecursionError):
        return Wrong(NO_JSON, "the message is not JSON")
    wrong = reading.wrong
    if "\\u" in text and _SURROGATE.search(json.dumps(told, ensure_ascii=False)):
        wrong = "the message has a lone surrogate, which is not a character"
    checked = _checked(told)
    if not wrong:
        return checked
    known = checked.id if isinstance(checked, Wrong) else checked.get("id")
    return Wrong(NO_JSON, wrong, None if reading.twice else known)


def line_of(told: Any) -> bytes:
    """A message as a line, in ASCII: what JSON cannot say (half a surrogate pair, no number) is U+FFFD or null."""
    return writable(told)[1].encode() + b"\n"


def writable(told: Any) -> tuple[Any, str]:
    """What JSON can say of `told`, and its text: words of others may have half a surrogate pair, or NaN."""
    try:
        text = json.dumps(told, ensure_ascii=False, allow_nan=False)
    except ValueError:
        told = json.loads(json.dumps(told, ensure_ascii=False), parse_constant=lambda _: None)
        text = json.dumps(told, ensure_ascii=False)
    if _SURROGATE.search(text):
        told = json.loads(_SURROGATE.sub("\ufffd", text))
    return told, json.dumps(told)


def _checked(told: Any) -> dict[str, Any] | Wrong:
    if isinstance(told, list):
        return Wrong(NO_REQUEST, "batches are not supported: send one message a line")
    if not isinstance(told, dict):
        return Wrong(NO_REQUEST, "a message must be an object")
    known = told.get("id")
    wrong = _wrong_id(known) if "id" in told else ""
    if wrong:
        return Wrong(NO_REQUEST, wrong)
    asked = known if "method" in told else None  # else it is the number of a request of ours
    if told.get("jsonrpc") != "2.0":
        return Wrong(NO_REQUEST, '`jsonrpc` must be "2.0"', asked)
    if not isinstance(told.get("params", {}), dict):
        return Wrong(NO_REQUEST, "`params` must be an object", asked)
    if "method" in told:
        return told if isinstance(told["method"], str) else Wrong(NO_REQUEST, "`method` must be a text", asked)
    if known is None or ("result" in told) == ("error" in told):
        return Wrong(NO_REQUEST, "a message must have a `method`, or be the answer to a request")
    return told


def _wrong_id(known: Any) -> str:
    """What is wrong with an id; nothing where it can stand in an answer."""
    if isinstance(known, str):
        if _SURROGATE.search(known):
            return "`id` has a lone surrogate, which is not a character"
        return f"`id` has {len(known)} characters; the limit is {MOST_ID}" if len(known) > MOST_ID else ""
    if not isinstance(known, int) or isinstance(known, bool):
        return "`id` must be a whole number or a text"
    return f"`id` has more than {MOST_ID_BITS} bits" if known.bit_length() > MOST_ID_BITS else ""


def _id_of_large(line: bytes) -> int | str | None:
    """The id of a message that is not read; None where it is not among its first octets or its last ones, or is not
    certainly its own.
    """
    found = _ID.match(line[:ENDS]) or _ID_LAST.search(line[-ENDS:])
    if found is None:
        return None
    try:
        known: int | str = json.loads(found[1].decode())
    except ValueError:
        return None
    return known if isinstance(known, int) or len(known) <= MOST_ID else None


def _depth(bare: bytes) -> int:
    """How deep objects and lists stand in one another, at least."""
    now = most = 0
    for each in _BRACKETS.finditer(bare):
        now += 1 if each[0] in b"[{" else -1
        most = max(most, now)
    return most


#: a name of a method that is told again is no longer than this
_MOST_TOLD: Final = 100

METHODS: Final = frozenset({
    "ping", "initialize", "completion/complete", "logging/setLevel", "prompts/get", "prompts/list", "resources/list",
    "resources/templates/list", "resources/read", "resources/subscribe", "resources/unsubscribe", "server/discover",
    "subscriptions/listen", "tools/call", "tools/list",
})  # fmt: skip


def unknown_method(request: dict[str, Any]) -> Wrong | None:
    """The answer to a request whose method the protocol does not have (JSON-RPC 2.0, section 5.1); None for others."""
    method = request.get("method")
    if "id" not in request or not isinstance(method, str) or method in METHODS:
        return None
    return Wrong(NO_METHOD, f"there is no method `{method[:_MOST_TOLD]}`", request["id"])
