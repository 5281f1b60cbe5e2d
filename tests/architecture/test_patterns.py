"""No pattern repeats a group possessively: CPython before 3.11.5 then ends the match after a failed attempt, so that
`20_ m` was read as `20 m` (python/cpython#106052). Atomic groups and possessive repetitions of one character are safe.
"""

import ast
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rtshcua.ground.language.table import table

with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)
    from re import _constants, _parser  # type: ignore[attr-defined]

CHECKOUT = Path(__file__).resolve().parents[2]
FOLDERS = ("rtshcua", "grammar", "examples", "skills", "editors", ".make", "bench", "tests")
#: `)*+`, `)++`, `)?+`, `){2,3}+` with an unescaped bracket
WRITTEN = re.compile(r"(?<!\\)(?:\\\\)*\)(?:[*+?]|\{[0-9,]+\})\+")

#: endings of possessive repetitions; constants that Python joins are separate in the file
POSSESSIVE = re.compile(r"[*+?}]\+")


def repeated_groups(pattern: str | bytes) -> bool:
    """Return whether a pattern has a possessive repetition of more than one character."""
    return any(_repeated(_parser.parse(pattern)))


def _repeated(parsed: Any) -> Iterator[bool]:
    if isinstance(parsed, _parser.SubPattern | list | tuple):
        items = list(parsed)
        if items and items[0] is _constants.POSSESSIVE_REPEAT:
            body = items[1][2]
            yield len(body) != 1 or body[0][0] not in (
                _constants.LITERAL,
                _constants.NOT_LITERAL,
                _constants.ANY,
                _constants.IN,
            )
        for each in items:
            yield from _repeated(each)


def test_scan_finds_exactly_repeated_groups() -> None:
    seen = (r"(?:ab)*+", r"(a|b)++", r"x(?:_[0-9]++)?+", r"(?:ab){1,3}+", r"(?>(?:ab)*+)", r"[(](?:ab)*+")
    unseen = (r"(?:ab)*", r"(?>(?:ab)*)", r"[ab]*+", r"a++", r"\)*+", r".?+", r"(?:a++b)*", r"\d{2}+")
    assert [each for each in seen if not WRITTEN.search(each)] == []
    assert [each for each in seen if not repeated_groups(each)] == []
    assert [each for each in unseen if WRITTEN.search(each)] == []
    assert [each for each in unseen if repeated_groups(each)] == []


def _files() -> Iterator[Path]:
    for folder in FOLDERS:
        for path in sorted((CHECKOUT / folder).rglob("*")):
            if path.is_file() and (path.suffix in (".py", ".lark") or path.name == "table.json" or folder == ".make"):
                yield path


def test_no_file_repeats_a_group_possessively() -> None:
    files = [path for path in _files() if path != Path(__file__)]
    assert len(files) > 1000
    found = []
    for path in files:
        text = path.read_bytes().decode("utf-8", "replace")
        found += [f"{path}: {match[0]}" for match in WRITTEN.finditer(text)]
    assert found == []


def test_no_pattern_given_to_re_repeats_a_group_possessively() -> None:
    """Check groups that are composed of parts in one call, which the source text does not show."""
    count, found = 0, []
    for path in _files():
        if path.suffix != ".py" or path == Path(__file__):
            continue
        text = path.read_text(encoding="utf-8")
        if not POSSESSIVE.search(text):  # parsing all files takes seconds
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Constant) and isinstance(node.value, str | bytes) and _of_re(node.value):
                count += 1
                if repeated_groups(node.value):
                    found.append(f"{path}:{node.lineno}")
    assert found == []
    assert count > 5


def _of_re(value: str | bytes) -> bool:
    """Return whether a text is a pattern with a possessive repetition."""
    if not POSSESSIVE.search(value if isinstance(value, str) else value.decode("latin-1")):
        return False
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            _parser.parse(value)
    except re.error:
        return False
    return True


def test_no_lexer_repeats_a_group_possessively() -> None:
    made = table()
    kinds = made.lexers.any.kinds
    pattern = made.lexers.any.match.__self__  # type: ignore[attr-defined]
    assert len(kinds) > 10
    assert not repeated_groups(pattern.pattern)
    assert not repeated_groups(made.skip.pattern)
