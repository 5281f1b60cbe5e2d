"""What is known of a number, an enumeration or a time: one value, or a set of values.

The runtime knows points, the checker sets; every rule is written for sets, so that one rule serves both (design 4.2).
"""

from collections.abc import Iterable, Sequence
from typing import Final, NamedTuple, TypeAlias

#: A set of integers, `low`..`high`, both included. `gap` says whether it may be missing; `members` names the elements
#: when not every integer between the bounds is one (enumerations). A point has `low == high`.
Value: TypeAlias = tuple[int, int, int, frozenset[int] | None]

#: An interval of a time in us, both ends included.
Span: TypeAlias = tuple[int, int]

PRESENT: Final = 0  # surely there
MAYBE: Final = 1  # there or missing
ABSENT: Final = 2  # surely missing: `low` and `high` mean nothing

#: never received, stale, or a sentinel
MISSING: Final[Value] = (0, 0, ABSENT, None)


def point(value: int) -> Value:
    """Exactly this."""
    return (value, value, PRESENT, None)


def interval(low: int, high: int) -> Value:
    """Anything from `low` to `high`, which is not below `low`."""
    return (low, high, PRESENT, None)


def members(values: Iterable[int]) -> Value:
    """Any of these, of which there is at least one."""
    found = frozenset(values)
    return (min(found), max(found), PRESENT, found)


def maybe(value: Value) -> Value:
    """The same, but it may also be missing."""
    low, high, gap, elements = value
    return (low, high, gap or MAYBE, elements)


class Sets(NamedTuple):
    """A set of situations: one `Value` a state slot, the moments at which they may be met (see `Now`), and the truths
    that each temporal monitor may have (`decision.truth`; of another length than the policy's: any truths).

    A point of it is one choice from each, with every age fresh; a value that may be missing stands for stale ones too.
    """

    values: Sequence[Value]
    monotonic_us: Span
    utc_us: tuple[Span, ...]
    utc_error_us: Span
    monitors: Sequence[int] = ()
