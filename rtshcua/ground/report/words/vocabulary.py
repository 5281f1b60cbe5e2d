"""What the names in a condition stand for, and how lists of words are joined."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final

#: what is closed in itself: a name, or brackets with none in them
_CLOSED: Final = re.compile(r"`[^`]*`|\([^()`]*\)")
_LISTS: Final = re.compile(r"[,;:]| and | or ")


@dataclass(frozen=True, slots=True)
class Vocabulary:
    """The names of signals and zones, and the arguments of what is being told of; `places` are those of them that are
    a place on the ground.
    """

    signals: frozenset[str] = frozenset()
    zones: frozenset[str] = frozenset()
    arguments: frozenset[str] = frozenset()
    places: frozenset[str] = frozenset()

    def asked(self, arguments: Iterable[str], places: Iterable[str] = ()) -> "Vocabulary":
        """The same, within something that has these arguments, of which some are places on the ground."""
        return replace(self, arguments=frozenset(arguments), places=frozenset(places))


def name(text: str) -> str:
    """A name of the sources."""
    return f"`{text}`"


def listed(words: Sequence[str], last: str = "and") -> str:
    """`a`, `a and b`, `a, b and c`."""
    return f"{', '.join(words[:-1])} {last} {words[-1]}" if len(words) > 1 else "".join(words)


def named(names: Iterable[str], last: str = "and") -> str:
    """Several names."""
    return listed([name(each) for each in names], last)


def bracketed(words: str) -> str:
    """Words that stand within others: in brackets where they list something, and could be read on into what follows."""
    left, before = _CLOSED.sub("", words), words
    while left != before:
        left, before = _CLOSED.sub("", left), left
    return f"({words})" if _LISTS.search(left) else words


def sentence(words: str) -> str:
    """A capital at the beginning and a full stop at the end; a name keeps its letters."""
    return f"{words[:1].upper()}{words[1:]}."
