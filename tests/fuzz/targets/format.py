"""Source text, formatted: the result is stable and has the same code and comments, by an independent oracle."""

import re
from collections.abc import Iterable
from random import Random
from zlib import crc32

from fuzz import corpus, world
from fuzz.mutation.blanks import joined, sprinkled
from fuzz.mutation.sentences import mutated as near
from fuzz.mutation.sentences import sentence
from rtshcua.diagnostics.codes import UNSAFE_FORMAT
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.format.format import formatted
from rtshcua.ground.language.parse import parse
from rtshcua.model.ir.node import Node

MAX_LENGTH = 8_000
WIDTHS = (120, 120, 100, 80, 60, 40, 20, 1)
_PIECE = re.compile(r'(?P<comment>//[^\n]*|/\*.*?\*/)|"(?:[^"\\\n]|\\.)*"|\s+|.', re.DOTALL)


def seeds() -> Iterable[bytes]:
    return corpus.sources()


def one(data: bytes) -> None:
    text = data.decode("utf-8", errors="replace")
    check(text, WIDTHS[crc32(data) % len(WIDTHS)])


def mutated(data: bytes, of: Random) -> bytes:
    text = data.decode("utf-8", errors="replace")
    chance = of.random()
    if chance < 0.15:
        text = sentence(of)
    elif chance < 0.3:
        text = near(data, of).decode("utf-8", errors="replace")
    if of.random() < 0.5:
        text = joined(text, of)
    if of.random() < 0.8:
        text = sprinkled(text, of)
    return text.encode(errors="replace")


def check(text: str, width: int) -> str | None:
    """Return the formatted text, if any, after checking its properties."""
    source = Source(world.PROBE, text)
    made = formatted(source, width)
    assert all(found.code is not UNSAFE_FORMAT for found in made.diagnostics), made.diagnostics
    before = parse(source)
    if made.text is None:
        assert before.diagnostics
        assert made.diagnostics == before.diagnostics
        return None
    again = formatted(Source(world.PROBE, made.text), width)
    assert again.text == made.text
    assert pieces(made.text) == pieces(text)
    after = parse(Source(world.PROBE, made.text))
    assert without_spans(after.unit) == without_spans(before.unit)
    assert [found.code for found in after.diagnostics] == [found.code for found in before.diagnostics]
    tidy(made.text)
    return made.text


def pieces(text: str) -> list[str]:
    """Comments, and the code between them without blanks and without commas that end a list; also of each `//` whether
    the code before it stands on its line.
    """
    found, code, blank = [], "", ""
    for piece in _PIECE.finditer(text.removeprefix("\ufeff")):
        if piece["comment"]:
            told = "\n".join(each.rstrip(" \t\r\f") for each in piece[0].split("\n"))
            if told.startswith("//") and code:
                told += " <- alone" if "\n" in blank else " <- code"
            found += [code, told]
            code = blank = ""
        elif piece[0].isspace():
            blank += piece[0]
        else:
            code += piece[0]
            blank = ""
    found.append(code)
    for number in range(0, len(found), 2):
        after = next((each[0] for each in found[number + 2 :: 2] if each), "")
        found[number] = re.sub(r",(?=[)}])", "", found[number] + after)
        if after:
            found[number] = found[number][: -len(after)]
    return found


def without_spans(value: object) -> object:
    if isinstance(value, Node):
        fields = [field for field in type(value).__struct_fields__ if field != "span"]
        return (type(value).__name__, *(without_spans(getattr(value, field)) for field in fields))
    if isinstance(value, tuple) and not isinstance(value, Span):
        return tuple(map(without_spans, value))
    return value


def tidy(text: str) -> None:
    """Check the layout rules, except within comments of several lines."""
    assert not text or (text.endswith("\n") and not text.endswith("\n\n"))
    if "/*" not in text:
        lines = text.split("\n")
        assert all(line == line.rstrip(" \t\r\f") for line in lines)
        assert "\n\n\n" not in text
        assert "\r" not in text
        assert not text.startswith(("\n", " ", "\ufeff"))
