"""Patterns for files, as people know them from `.gitignore`, relative to the folder of the configuration.

`*` and `?` stay within one part of a path, `**` stands for any number of parts. A pattern also means everything below
what it matches, so that `drafts` means the folder. Without a `/` it may match in any folder; with one, it begins at the
configuration's folder. `/` separates on every platform.

A configuration may be anybody's, so no pattern takes long: for parts as for characters, of what stands before a star
the first place where it fits is as good as any other, so only the last star is ever gone back to.
"""

import re
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import TypeVar

T = TypeVar("T")

_ANY = "**"


def matches(pattern: str, path: str) -> bool:
    """Whether a pattern means the file at `path`, which is relative to the configuration's folder."""
    parts = _parts(pattern)
    return bool(parts) and _fits(parts, path.split("/"), _ANY, _part_fits)


@lru_cache(maxsize=256)
def _parts(pattern: str) -> tuple[str, ...]:
    """The parts of a pattern for a whole path, in which no two stars stand side by side; none of one without parts."""
    written = pattern.removeprefix("./")
    found = [part if part == _ANY else re.sub(r"\*+", "*", part) for part in written.split("/") if part]
    if not found:
        return ()
    if found[-1] == _ANY:
        found[-1] = "*"  # at least one part, and what is below
    if "/" not in written.rstrip("/"):
        found.insert(0, _ANY)
    found.append(_ANY)
    return tuple(part for number, part in enumerate(found) if part != _ANY or found[number - 1 : number] != [_ANY])


def _part_fits(pattern: str, name: str) -> bool:
    return _fits(pattern, name, "*", _character_fits)


def _character_fits(pattern: str, character: str) -> bool:
    return pattern in (character, "?")


def _fits(pattern: Sequence[T], whole: Sequence[T], star: T, fits: Callable[[T, T], bool]) -> bool:
    """Whether all of `whole` is as the pattern says, in which `star` stands for any number of anything."""
    if len(pattern) > 2 * len(whole) + 1:  # more than can stand for something
        return False
    at = place = 0
    last, gone = -1, 0  # the last star, and up to where it stands for what was passed
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
