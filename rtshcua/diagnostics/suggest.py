"""Suggestions for misspelt names ("did you mean"): for the compiler, the agent interface and the command line."""

import re
from collections.abc import Iterable
from difflib import SequenceMatcher, get_close_matches
from functools import lru_cache

#: names at least this similar differ by a typing error
TYPO = 0.85
#: a shorter part of a name (the `a` of `bridge_a`) is not enough for a suggestion
TELLING = 3
#: how many names a help lists
LISTED = 12


def nearest(word: str, known: Iterable[str], about: str = "") -> str | None:
    """Return the known name nearest to `word`, or None if no name is near enough.

    A similar spelling comes first, then a name with the same parts (`battery_remaining` for `remaining`); of those, the
    one that shares most parts with `about`, the surrounding text.
    """
    return _nearest(word, frozenset(known), about)


@lru_cache(maxsize=512)
def _nearest(word: str, known: frozenset[str], about: str) -> str | None:
    """Cached: one misspelt declaration makes the same name unknown in many places."""
    folded = {name.casefold(): name for name in sorted(known)}
    wanted = word.casefold()
    alike = get_close_matches(wanted, list(folded), n=1, cutoff=0.6)
    if alike and likeness(wanted, alike[0]) >= TYPO:
        return folded[alike[0]]
    own, around = _parts(wanted), _parts(about.casefold())
    if any(len(part) >= TELLING for part in own):
        longer = [name for name in folded if own <= _parts(name)]
        if longer:
            return folded[max(longer, key=lambda name: (len(_parts(name) & around), likeness(wanted, name)))]
    if alike:
        return folded[alike[0]]
    shorter = [name for name in folded if len(name) >= TELLING and _parts(name) <= own]
    return folded[max(shorter, key=len)] if shorter else None


def listed(names: Iterable[str]) -> str:
    """Names for a sentence, in backticks: at most `LISTED`, then the number of further names."""
    known = list(names)
    shown = ", ".join(f"`{name}`" for name in known[:LISTED])
    return shown if len(known) <= LISTED else f"{shown} and {len(known) - LISTED} more"


def likeness(one: str, other: str) -> float:
    """The similarity of two words, from 0 to 1."""
    return SequenceMatcher(None, one, other).ratio()


def _parts(name: str) -> set[str]:
    """The words that a name is made of."""
    return set(re.findall(r"[a-z0-9]+", name))
