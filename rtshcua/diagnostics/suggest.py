"""The one place that answers "did you mean": used by the compiler, the agent interface and the command line."""

import re
from collections.abc import Iterable
from difflib import SequenceMatcher, get_close_matches
from functools import lru_cache

#: from this likeness on a name differs from a word by a slip of the finger
TYPO = 0.85
#: how long a part of a name must be to tell something alone: not the `a` of `bridge_a`
TELLING = 3
#: how many names a help lists
LISTED = 12


def nearest(word: str, known: Iterable[str], about: str = "") -> str | None:
    """The known name nearest to `word`, or None when none is near enough to be worth a suggestion.

    A name that is spelt alike goes first, then one with the same parts (`battery_remaining` for `remaining`), of those
    the one that shares most with `about`, the words that stand around.
    """
    return _nearest(word, frozenset(known), about)


@lru_cache(maxsize=512)
def _nearest(word: str, known: frozenset[str], about: str) -> str | None:
    """Remembered, for what one misspelt declaration leaves behind is the same unknown name in many places."""
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
    """Names for a sentence, in backticks; of many the first ones, and how many more there are."""
    known = list(names)
    shown = ", ".join(f"`{name}`" for name in known[:LISTED])
    return shown if len(known) <= LISTED else f"{shown} and {len(known) - LISTED} more"


def likeness(one: str, other: str) -> float:
    """How much of two words is alike, from 0 to 1."""
    return SequenceMatcher(None, one, other).ratio()


def _parts(name: str) -> set[str]:
    """The words that a name is made of."""
    return set(re.findall(r"[a-z0-9]+", name))
