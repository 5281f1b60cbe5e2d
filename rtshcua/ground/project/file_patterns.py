"""File patterns in the style of `.gitignore`, relative to the folder of the configuration.

`*` and `?` match within one part of a path, `**` matches any number of parts. A pattern also matches everything below
the paths that it matches, so `drafts` matches a folder. A pattern without `/` matches in any folder; one with `/` is
relative to the configuration's folder. The separator is `/` on every platform.

A configuration may come from an untrusted source, so matching takes quadratic time at most: the first match of the text
before a star is as good as any later one, so the matcher only backtracks to the last star.
"""

import re
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import TypeVar

T = TypeVar("T")

_ANY = "**"


def matches(pattern: str, path: str) -> bool:
    """Whether a pattern matches the file at `path`, which is relative to the configuration's folder."""
    parts = _parts(pattern)
    return bool(parts) and _fits(parts, path.split("/"), _ANY, _part_fits)


@lru_cache(maxsize=256)
def _parts(pattern: str) -> tuple[str, ...]:
    """The parts of a pattern for a whole path, without adjacent stars; empty if the pattern has no parts."""
    written = pattern.removeprefix("./")
    found = [part if part == _ANY else re.sub(r"\*+", "*", part) for part in written.split("/") if part]
    if not found:
        return ()
    if found[-1] == _ANY:
        found[-1] = "*"  # at least one part
    if "/" not in written.rstrip("/"):
        found.insert(0, _ANY)
    found.append(_ANY)
    return tuple(part for number, part in enumerate(found) if part != _ANY or found[number - 1 : number] != [_ANY])


def _part_fits(pattern: str, name: str) -> bool:
    return _fits(pattern, name, "*", _character_fits)


def _character_fits(pattern: str, character: str) -> bool:
    return pattern in (character, "?")


def _fits(pattern: Sequence[T], whole: Sequence[T], star: T, fits: Callable[[T, T], bool]) -> bool:
    """Whether the pattern matches all of `whole`; `star` matches any number of elements."""
    if len(pattern) > 2 * len(whole) + 1:  # every second part matches at least one element
        return False
    at = place = 0
    last, gone = -1, 0  # the last star, and the end of the elements that it matches
    while place < len(whole):
        if at < len(pattern) and pattern[at] == star:
            last, gone = at, place
            at += 1
        elif at < len(pattern) and fits(pattern[at], whole[place]):
            at, place = at + 1, place + 1
        elif last >= 0:
            gone += 1
            at, place = last + 1, gone
        else:
            return False
    return all(each == star for each in pattern[at:])
