"""Abstract values: truths, numbers, enumerations and times, each a single value or a set of values.

The runtime computes with points, the checker with sets; every rule is written for sets, so that one rule serves
both (design 4.2).

Abstract truth is a non-empty subset of {true, false, unknown}, as a bit mask. A point has exactly one of the
three; a set of points has every truth that one of its points may have. The connectives are Kleene's strong ones,
lifted to subsets: `AND[a][b]` holds `x and y` for every x in a and y in b. That is exact when the two sides are
independent, and sound (never too small) when they are not.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Final, NamedTuple, TypeAlias

Truth: TypeAlias = int

TRUE: Truth = 1
FALSE: Truth = 2
UNKNOWN: Truth = 4

Table: TypeAlias = tuple[tuple[Truth, ...], ...]


def singles(truth: Truth) -> tuple[Truth, ...]:
    """The single truths in an abstract one, in Kleene's order: `and` is the minimum of two, `or` the maximum."""
    return tuple(single for single in (FALSE, UNKNOWN, TRUE) if truth & single)


def _lifted(pick: Callable[..., Truth]) -> Table:
    """The table of the minimum or the maximum of two single truths, for every pair of abstract ones."""
    rank = (FALSE, UNKNOWN, TRUE).index
    return tuple(
        tuple(sum({pick(x, y, key=rank) for x in singles(a) for y in singles(b)}) for b in range(8)) for a in range(8)
    )


#: tables indexed by two abstract truths; row and column 0 (the empty set, which no rule makes) are 0
AND, OR = _lifted(min), _lifted(max)
#: swaps true and false
NOT: tuple[Truth, ...] = tuple((a & UNKNOWN) | (a & TRUE) << 1 | (a & FALSE) >> 1 for a in range(8))
#: the truth of a condition at every point of one volume: false if false anywhere, else unknown if unknown anywhere
EVERYWHERE: tuple[Truth, ...] = tuple(FALSE if a & FALSE else UNKNOWN if a & UNKNOWN else a for a in range(8))


#: A set of integers, `low`..`high`, both included. `gap` says whether it may be missing; `members` names the elements
#: when not every integer between the bounds is one (enumerations). A point has `low == high`.
Value: TypeAlias = tuple[int, int, int, frozenset[int] | None]

#: An interval of a time in us, both ends included.
Span: TypeAlias = tuple[int, int]

PRESENT: Final = 0  # certainly present
MAYBE: Final = 1  # present or missing
ABSENT: Final = 2  # certainly missing: `low` and `high` mean nothing

#: never received, stale, or a sentinel
MISSING: Final[Value] = (0, 0, ABSENT, None)


def point(value: int) -> Value:
    """The set that holds exactly this value."""
    return (value, value, PRESENT, None)


def interval(low: int, high: int) -> Value:
    """Anything from `low` to `high`, which is not below `low`."""
    return (low, high, PRESENT, None)


def members(values: Iterable[int]) -> Value:
    """Any of these, of which there is at least one."""
    found = frozenset(values)
    return (min(found), max(found), PRESENT, found)


def maybe(value: Value) -> Value:
    """The same values, or missing."""
    low, high, gap, elements = value
    return (low, high, gap or MAYBE, elements)


class Sets(NamedTuple):
    """A set of situations: one `Value` for each state slot, the possible moments (see `Now`), and the possible truths
    of each temporal monitor (`Truth`; any truths if the length differs from the policy's).

    A point of it is one choice from each, with every age fresh; a value that may be missing stands for stale ones
    too.
    """

    values: Sequence[Value]
    monotonic_us: Span
    utc_us: tuple[Span, ...]
    utc_error_us: Span
    monitors: Sequence[int] = ()
