"""Abstract truth: a non-empty subset of {true, false, unknown}, as a bit mask.

A point has exactly one of the three; a set of points has every truth that one of its points may have. The connectives
are Kleene's strong ones, lifted to subsets: `AND[a][b]` holds `x and y` for every x in a and y in b. That is exact when
the two sides are independent, and sound (never too small) when they are not.
"""

from typing import TypeAlias

Truth: TypeAlias = int

TRUE: Truth = 1
FALSE: Truth = 2
UNKNOWN: Truth = 4

Table: TypeAlias = tuple[tuple[Truth, ...], ...]


def _both(a: Truth, b: Truth) -> Truth:
    """Kleene's `and` of two single truths."""
    if FALSE in (a, b):
        return FALSE
    return UNKNOWN if UNKNOWN in (a, b) else TRUE


def _either(a: Truth, b: Truth) -> Truth:
    """Kleene's `or` of two single truths."""
    if TRUE in (a, b):
        return TRUE
    return UNKNOWN if UNKNOWN in (a, b) else FALSE


def members(truth: Truth) -> tuple[Truth, ...]:
    """The single truths in an abstract one."""
    return tuple(single for single in (TRUE, FALSE, UNKNOWN) if truth & single)


def _lifted(left: Truth, right: Truth, conjunction: bool) -> Truth:
    combine = _both if conjunction else _either
    mask = 0
    for a in members(left):
        for b in members(right):
            mask |= combine(a, b)
    return mask


#: tables indexed by two abstract truths; row and column 0 (the empty set, which no rule makes) are 0
AND: Table = tuple(tuple(_lifted(a, b, True) for b in range(8)) for a in range(8))
OR: Table = tuple(tuple(_lifted(a, b, False) for b in range(8)) for a in range(8))
#: swaps true and false
NOT: tuple[Truth, ...] = tuple((a & UNKNOWN) | (a & TRUE) << 1 | (a & FALSE) >> 1 for a in range(8))
#: what a condition over every point of one volume amounts to: false if false anywhere, else unknown if unknown anywhere
EVERYWHERE: tuple[Truth, ...] = tuple(FALSE if a & FALSE else UNKNOWN if a & UNKNOWN else a for a in range(8))
