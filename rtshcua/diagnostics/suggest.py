"""The one place that answers "did you mean": used by the compiler, the agent interface and the command line."""

from collections.abc import Iterable
from difflib import get_close_matches


def nearest(word: str, known: Iterable[str]) -> str | None:
    """The known name nearest to `word`, or None when none is near enough to be worth a suggestion."""
    folded = {name.casefold(): name for name in sorted(known)}
    found = get_close_matches(word.casefold(), list(folded), n=1, cutoff=0.6)
    return folded[found[0]] if found else None
