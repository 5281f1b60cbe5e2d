"""A JSON reader (RFC 8259) that keeps the place of every value, and JSON Pointers (RFC 6901) to these places.

The reader is strict: it refuses duplicate keys, NaN and fractions. It limits depth and size before it builds anything,
so that hostile input costs little.
"""

import json
import re
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from json.decoder import JSONDecodeError, scanstring  # type: ignore[attr-defined]  # typeshed has no `scanstring`
from typing import Any, Final

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.codes import Code
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.language.size_limits import without_texts

MAX_BYTES: Final = 1 << 20
MAX_DEPTH: Final = 16
MAX_DIGITS: Final = 18
#: objects, arrays, strings and numbers: enough for about 4,000 steps
MAX_VALUES: Final = 1 << 15

_SPACE = re.compile(r"[ \t\n\r]*")
_NUMBER = re.compile(r"(-?(?:0|[1-9][0-9]*))(\.[0-9]+)?([eE][-+]?[0-9]+)?")
#: the marks that models put around code
_FENCED = re.compile(r"```[A-Za-z0-9]*[ \t]*\r?\n(.*)\n[ \t]*```", re.DOTALL)
_LITERALS = {"true": True, "false": False, "null": None}

#: the keys and indexes that lead to a value
Path = tuple[str | int, ...]


@dataclass(frozen=True, slots=True)
class JsonTree:
    """A JSON value with the `spans` of its parts and of the `keys` of its objects, by path."""

    value: Any
    spans: dict[Path, Span]
    keys: dict[Path, Span]


class _Unreadable(Exception):
    """The text is not JSON, or too large, so reading stops."""

    def __init__(self, code: Code, message: str, start: int, end: int, help: str | None = None) -> None:
        super().__init__(message)
        self.code, self.message, self.start, self.end, self.help = code, message, start, end, help


def read_json(file: str, data: bytes) -> tuple[Source, JsonTree | None, tuple[Diagnostic, ...]]:
    """Return the source text, its tree (None if it is not JSON), and the findings."""
    if len(data) > MAX_BYTES:
        message = f"the specification is {len(data)} bytes; the limit is {MAX_BYTES}"
        return Source(file, ""), None, (Diagnostic(codes.SPECIFICATION_SIZE, message, Span(file, 0, 0)),)
    try:
        source = Source(file, data.decode("utf-8"))
    except UnicodeDecodeError as error:
        source = Source(file, data.decode("utf-8", "replace"))
        at = source.text.find("\ufffd")
        message = f"byte {error.start} (0x{data[error.start]:02x}) is not UTF-8"
        return source, None, (Diagnostic(codes.NOT_JSON, message, Span(file, at, at + 1)),)
    if without_texts(data, MAX_VALUES) is None:
        message = f"the specification has too many values; the limit is {MAX_VALUES}"
        return source, None, (Diagnostic(codes.SPECIFICATION_SIZE, message, Span(file, 0, 0)),)
    reader = _Reader(source)
    try:
        value = reader.document()
    except _Unreadable as stop:
        span = Span(file, stop.start, stop.end)
        found = Diagnostic(stop.code, stop.message, span, stop.help)
        return source, None, (*reader.found, found)
    return source, JsonTree(value, reader.spans, reader.keys), tuple(reader.found)


def read_json_text(text: str, again: bool = True, explained: bool = True) -> tuple[Any, str]:
    """The JSON value that a text holds and nothing else, also between the marks that models put around code, or in a
    text once more; or None, and what is wrong. Numbers may have decimals: whoever reads the value refuses them.
    Not `explained`: without the place of the error, which takes a second for the longest text.
    """
    if len(text) > MAX_BYTES:
        return None, f"the text has {len(text)} characters; the limit is {MAX_BYTES}"
    plain = text.strip("\ufeff \t\r\n")
    fenced = _FENCED.fullmatch(plain)
    plain = plain if fenced is None else fenced[1]
    try:
        value = json.loads(plain, object_pairs_hook=_once)
    except (ValueError, RecursionError):
        source, _, found = read_json("", plain.encode("utf-8", "surrogatepass") if explained else b"")
        if not explained or not found or found[0].span is None:
            return None, "the text is not JSON"
        at = source.position(found[0].span.start)
        return None, f"line {at.line}, column {at.column} of the JSON: {found[0].message}"
    return read_json_text(value, again=False) if again and isinstance(value, str) else (value, "")


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    if len(made) < len(pairs):
        raise ValueError("a key is written twice")
    return made


class _Reader:
    """A recursive descent reader of one text."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.text = source.text
        self.spans: dict[Path, Span] = {}
        self.keys: dict[Path, Span] = {}
        self.found: list[Diagnostic] = []

    def document(self) -> Any:
        """Return the value of the whole text."""
        value, at = self._value(self._skip(0), ())
        at = self._skip(at)
        if at < len(self.text):
            raise self._unexpected(at, "the end of the text")
        return value

    def _skip(self, at: int) -> int:
        matched = _SPACE.match(self.text, at)
        assert matched is not None
        return matched.end()

    def _value(self, at: int, path: Path) -> tuple[Any, int]:
        if len(path) > MAX_DEPTH:
            message = f"the specification is nested too deeply; the limit is {MAX_DEPTH} levels"
            raise _Unreadable(codes.SPECIFICATION_SIZE, message, at, at + 1)
        first = self.text[at : at + 1]
        value: Any
        if first == "{":
            value, end = self._object(at, path)
        elif first == "[":
            value, end = self._array(at, path)
        elif first == '"':
            value, end = self._string(at)
        else:
            value, end = self._scalar(at)
        self.spans[path] = Span(self.source.file, at, end)
        return value, end

    def _object(self, start: int, path: Path) -> tuple[dict[str, Any], int]:
        value: dict[str, Any] = {}

        def member(at: int) -> int:
            if self.text[at : at + 1] != '"':
                raise self._unexpected(at, "a key in double quotes")
            key, end = self._string(at)
            here = (*path, key)
            span = Span(self.source.file, at, end)
            if key in value:
                first = Label(self.keys[here], "first written here")
                self.found.append(
                    Diagnostic(codes.DUPLICATE_KEY, f"the key `{key}` is written twice", span, labels=(first,))
                )
            else:
                self.keys[here] = span
            end = self._skip(end)
            if self.text[end : end + 1] != ":":
                raise self._unexpected(end, "`:`")
            value[key], end = self._value(self._skip(end + 1), here)
            return end

        return value, self._items(start, "}", member)

    def _array(self, start: int, path: Path) -> tuple[list[Any], int]:
        value: list[Any] = []

        def item(at: int) -> int:
            element, end = self._value(at, (*path, len(value)))
            value.append(element)
            return end

        return value, self._items(start, "]", item)

    def _items(self, start: int, closing: str, item: Callable[[int], int]) -> int:
        """Read items separated by commas up to the closing bracket; return the offset after it."""
        at = self._skip(start + 1)
        if self.text[at : at + 1] == closing:
            return at + 1
        while True:
            at = self._skip(item(at))
            following = self.text[at : at + 1]
            if following == closing:
                return at + 1
            if following != ",":
                raise self._unexpected(at, f"`,` or `{closing}`")
            at = self._skip(at + 1)

    def _string(self, at: int) -> tuple[str, int]:
        try:
            value, end = scanstring(self.text, at + 1, True)
        except JSONDecodeError as error:
            raise _Unreadable(codes.NOT_JSON, error.msg[0].lower() + error.msg[1:], error.pos, error.pos + 1) from error
        if any("\ud800" <= character <= "\udfff" for character in value):
            raise _Unreadable(codes.NOT_JSON, "the text has half of a surrogate pair", at, end)
        return value, end

    def _scalar(self, at: int) -> tuple[Any, int]:
        for word, value in _LITERALS.items():
            if self.text.startswith(word, at):
                return value, at + len(word)
        matched = _NUMBER.match(self.text, at)
        if matched is None:
            raise self._unexpected(at, "a value")
        if matched[2] or matched[3]:
            help = 'write a quantity as a string with its unit, such as "12.5 m"'
            raise _Unreadable(codes.NOT_JSON, f"`{matched[0][:40]}` is not a whole number", *matched.span(), help)
        if len(matched[0].lstrip("-")) > MAX_DIGITS:
            message = f"the number has too many digits; the limit is {MAX_DIGITS}"
            raise _Unreadable(codes.SPECIFICATION_SIZE, message, *matched.span())
        return int(matched[0]), matched.end()

    def _unexpected(self, at: int, expected: str) -> _Unreadable:
        found = self.text[at : at + 1]
        if not found:
            message = f"expected {expected}; found the end of the text"
            return _Unreadable(codes.NOT_JSON, message, len(self.text), len(self.text))
        return _Unreadable(codes.NOT_JSON, f"expected {expected}; found `{found}`", at, at + 1)


def pointer(path: Path) -> str:
    """The JSON Pointer to a path; empty for the whole document."""
    return "".join("/" + str(part).replace("~", "~0").replace("/", "~1") for part in path)


class JsonPlaces:
    """An index of the values and keys of a tree by their spans."""

    def __init__(self, tree: JsonTree) -> None:
        found = [
            (place.start, -place.end, path) for places in (tree.spans, tree.keys) for path, place in places.items()
        ]
        found.sort(key=lambda each: each[:2])
        self._starts = [start for start, _, _ in found]
        self._ends = [-end for _, end, _ in found]
        self._paths = [path for _, _, path in found]
        self._around: list[int] = []  # for each place the index of the enclosing place, -1 for the whole document
        open_places: list[int] = []
        for number, end in enumerate(self._ends):
            while open_places and self._ends[open_places[-1]] < end:
                open_places.pop()
            self._around.append(open_places[-1] if open_places else -1)
            open_places.append(number)

    def innermost(self, span: Span) -> Path:
        """Return the path of the smallest value, or of the member with the key, that contains a span."""
        at = bisect_right(self._starts, span.start) - 1
        while at >= 0 and self._ends[at] < span.end:
            at = self._around[at]
        return () if at < 0 else self._paths[at]
