"""An oracle for ignored findings: a naive, independent reading of docs/linting.md, character by character."""

from collections.abc import Iterable
from typing import NamedTuple

from rtshcua.diagnostics.codes import REGISTRY, Severity
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source

#: findings about ignores are not ignored
ABOUT = {"E1309", "E1310", "E1311"}


class Remark(NamedTuple):
    """A comment: its text, the lines of its ends (from 0), whether these lines only have comments, the
    next line with other text, and whether it is before any declaration.
    """

    text: str
    first: int
    last: int
    alone: bool
    next: int
    at_top: bool


def remarks(text: str) -> list[Remark]:
    """Return the comments of a text."""
    found: list[tuple[int, int]] = []
    other: list[int] = []
    at = 0
    while at < len(text):
        if text.startswith("//", at):
            end = at
            while end < len(text) and text[end] != "\n":
                end += 1
            found.append((at, end))
        elif text.startswith("/*", at):
            end = text.find("*/", at + 2)
            end = len(text) if end < 0 else end + 2
            found.append((at, end))
        elif text[at] == '"':
            end = at + 1
            while end < len(text) and text[end] not in '"\n':
                end += 2 if text[end] == "\\" and text[end + 1 : end + 2] not in ("", "\n") else 1
                if end <= len(text) and text[end - 1] == "\\" and (end == len(text) or text[end] == "\n"):
                    break
            end = min(end + 1 if text[end : end + 1] == '"' else end, len(text))
            other.append(at)
        else:
            end = at + 1
            if not text[at].isspace():
                other.append(at)
        at = max(end, at + 1)
    return [_remark(text, start, end, other) for start, end in found]


def _remark(text: str, start: int, end: int, other: list[int]) -> Remark:
    written = text[start + 2 : end]
    if text.startswith("/*", start) and end - start >= 4 and text[end - 2 : end] == "*/":
        written = text[start + 2 : end - 2]
    first, last = text[:start].count("\n"), text[:end].count("\n")
    busy = {text[:place].count("\n") for place in other}
    alone = not any(line in busy for line in range(first, last + 1))
    following = min((line for line in busy if line > last), default=last + 1)
    return Remark(written, first, last, alone, following, not any(place < start for place in other))


def ignored(source: Source, found: Iterable[Diagnostic]) -> set[Diagnostic]:
    """Return the findings that the comments of a text ignore."""
    whole: set[str] = set()
    lines: dict[int, set[str]] = {}
    for remark in remarks(source.text):
        words = remark.text.replace(",", " ").split()
        if not words or not words[0].startswith("rtshcua:"):
            continue
        words = [word for word in [words[0].removeprefix("rtshcua:"), *words[1:]] if word]
        if not words or words[0] not in ("ignore", "ignore-file") or "because" not in words[1:]:
            continue
        named = words[1 : words.index("because", 1)]
        reason = " ".join(remark.text.split("because", 1)[1].split()) if named else ""
        ids = {each for each in map(_id, named) if each}
        letters = [each for each in reason if each.isalpha()]
        if not letters or len(letters) + len([each for each in reason if each.isnumeric()]) < 3:
            continue
        if words[0] == "ignore-file":
            whole |= ids if remark.at_top else set()
            continue
        line = remark.next if remark.alone else remark.first
        lines.setdefault(line, set()).update(ids)
    taken = set()
    for each in found:
        if each.span is not None and each.span.file == source.file and _id(each.code.id):
            line = source.text[: each.span.start].count("\n")
            if each.code.id in whole or each.code.id in lines.get(line, ()):
                taken.add(each)
    return taken


def _id(name: str) -> str | None:
    """The id of a code that may be ignored, by its id or slug."""
    for code in REGISTRY.values():
        if name in (code.id, code.slug):
            return None if code.severity is Severity.ERROR or code.id in ABOUT else code.id
    return None
