"""One finding for one missing name, however often it is named: for a person, who mends it in one place."""

from collections.abc import Iterable
from dataclasses import replace

from rtshcua.diagnostics.codes import UNKNOWN_NAME, UNKNOWN_ROLE
from rtshcua.diagnostics.diagnostic import Diagnostic, Label

#: how many of the other places are shown
MOST_PLACES = 3
_FOLDED = (UNKNOWN_NAME, UNKNOWN_ROLE)


def folded(found: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """The findings, with those that tell of one missing name in one, where the first of them stands, with a count.

    Findings on a specification stay apart, for each has its own pointer.
    """
    kept: list[Diagnostic] = []
    at: dict[tuple[str, str], int] = {}
    others: dict[int, list[Diagnostic]] = {}
    for each in found:
        key = (each.code.id, each.message)
        if each.code not in _FOLDED or each.span is None or each.pointer is not None:
            kept.append(each)
        elif key in at:
            others.setdefault(at[key], []).append(each)
        else:
            at[key] = len(kept)
            kept.append(each)
    for place, more in others.items():
        labels = tuple(Label(each.span, "here too") for each in more[:MOST_PLACES] if each.span is not None)
        message = f"{kept[place].message}; it is named in {len(more) + 1} places"
        kept[place] = replace(kept[place], message=message, labels=(*kept[place].labels, *labels))
    return tuple(kept)
