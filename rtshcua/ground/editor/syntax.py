"""The tokens and nodes at a place of a text, even if the text is incomplete."""

import re
from collections.abc import Iterator
from typing import Any, NamedTuple

from msgspec.structs import astuple

from rtshcua.ground.editor.occurrences import declarations
from rtshcua.model.ir.node import Node
from rtshcua.model.ir.program import Unit

_TOKEN = re.compile(
    r"""(?P<comment>//[^\n]*+|/\*(?s:.)*?(?:\*/|\Z)) | (?P<string>"[^"\\\n]*+(?:\\.[^"\\\n]*+){0,999}"?)
      | (?P<time>[0-9]{1,2}:[0-9]{2}(?![0-9])) | (?P<number>[0-9][0-9_]*+(?:\.[0-9][0-9_]*+){0,63})
      | (?P<word>[A-Za-z_][A-Za-z0-9_]*+(?:\.[A-Za-z_][A-Za-z0-9_]*+){0,63})
      | (?P<mark>[<>=!]=|\.\.|[^\sA-Za-z0-9_])""",
    re.VERBOSE,
)


class Token(NamedTuple):
    """A word, number, mark, text or comment; `kind` is the name of its group."""

    kind: str
    text: str
    start: int
    end: int


def tokens(text: str, start: int = 0, end: int | None = None) -> Iterator[Token]:
    """Yield all tokens that begin in a range, with comments. Unlike the parser's tokenizer, this one cannot fail."""
    for found in _TOKEN.finditer(text, start):
        if end is not None and found.start() >= end:
            return
        yield Token(found.lastgroup or "", found[0], found.start(), found.end())


def token_at(text: str, offset: int) -> Token | None:
    """The token at an offset, or directly before it."""
    line = text.rfind("\n", 0, offset) + 1
    found: Token | None = None
    for token in tokens(text, line, offset + 1):
        if token.start <= offset <= token.end and not (found is not None and token.kind == "mark"):
            found = token
    return found


def inside_comment_or_text(text: str, offset: int, since: int = 0) -> bool:
    """Whether an offset is in a comment or a string; `since` is an offset that is in neither."""
    for token in tokens(text, since, offset):
        if token.kind in ("comment", "string") and token.start < offset < token.end:
            return True
        if token.kind == "comment" and token.text.startswith("//") and token.end == offset:
            return True
    return False


def path_to(unit: Unit, offset: int) -> tuple[Node, ...]:
    """The nodes that contain an offset, from the declaration inwards."""
    for declaration in declarations(unit):
        if declaration.span.start <= offset <= declaration.span.end:
            return tuple(_path(declaration, offset))
    return ()


def _path(node: Node, offset: int) -> Iterator[Node]:
    yield node
    around = [each for each in _inner(astuple(node)) if each.span.start <= offset <= each.span.end]
    inner = next((each for each in around if offset < each.span.end), around[0] if around else None)
    if inner is not None:
        yield from _path(inner, offset)


def nodes_in(node: Node) -> Iterator[Node]:
    """A node and every node below it, in source order."""
    waiting = [node]
    while waiting:
        each = waiting.pop()
        yield each
        waiting += reversed([*_inner(astuple(each))])


def _inner(values: tuple[Any, ...]) -> Iterator[Node]:
    for value in values:
        if isinstance(value, Node):
            yield value
        elif type(value) is tuple:
            yield from _inner(value)


def note_before(text: str, start: int) -> str:
    """The line comments directly above a declaration, without `//`."""
    lines = text[:start].split("\n")
    if lines[-1].strip():
        return ""
    comment: list[str] = []
    for line in reversed(lines[:-1]):
        bare = line.strip()
        if not bare.startswith("//"):
            break
        comment.append(bare[2:].strip())
    return "\n".join(reversed(comment))
