"""The smallest change of values that makes a condition true, or false: read off the condition itself."""

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

from rtshcua.decision import tree
from rtshcua.decision.evaluate import Environment, Tables, build, total
from rtshcua.decision.truth import FALSE, TRUE
from rtshcua.decision.values import Value, point
from rtshcua.model.flat.limits import DAY, MAX_VALUE


class Change(NamedTuple):
    """An argument cell or a state slot (None: the local time) should be in `low`..`high`, or one of `choices`."""

    argument: bool
    at: int | None
    low: int
    high: int
    choices: frozenset[int] | None

    @property
    def subject(self) -> "Subject":
        """What changes."""
        return (self.argument, self.at)

    def allows(self, value: int) -> bool:
        """Whether a value satisfies it."""
        return self.low <= value <= self.high if self.choices is None else value in self.choices


Subject: TypeAlias = tuple[bool, int | None]
#: the value that each subject is given
Made: TypeAlias = dict[Subject, int]


class Changes:
    """Looks for changes to what an environment knows. None means that no change of a value helps, or none is known.

    What a temporal monitor says, no value of this moment changes; and an invocation stays in its phase. With
    `signals_only` the arguments stay as they are too, where a comparison has both.
    """

    def __init__(self, at: Environment, tables: Tables, *, signals_only: bool = False) -> None:
        self._at, self._tables, self._signals_only = at, tables, signals_only

    def find(self, node: tree.Node, goal: bool) -> tuple[Change, ...] | None:
        """Changes which, made together, give the condition the truth `goal`; as few as possible."""
        if build(node, self._tables)(self._at) == (TRUE if goal else FALSE):
            return ()
        match node:
            case tree.Not(operand):
                return self.find(operand, not goal)
            case tree.Both(left, right):
                return self._all(left, right, goal) if goal else self._any(left, right, goal)
            case tree.Either(left, right):
                return self._any(left, right, goal) if goal else self._all(left, right, goal)
            case tree.AtMost(terms, bound):
                return self._bound(terms, bound if goal else bound + 1, upper=goal)
            case tree.Equal(terms, value) if goal:
                return self._exactly(terms, value)
            case tree.Member(argument, at, members):
                chosen = self._tables.sets[members]
                return (Change(argument, at, 0, 0, chosen),) if goal else None
            case tree.InWindow(start, end) if goal:
                return (Change(False, None, start, min(end, DAY - 1), None),)
            case _:
                return None

    def help(self, node: tree.Node, goal: bool, made: Made) -> bool:
        """Whether the condition has the truth `goal` once subjects have the values given.

        A time of day is the next one there is, for zones may exist on some days only, and the clock is then exact.
        """
        here = self._at
        slots, arguments, utc, error = list(here.slots), list(here.arguments), here.utc, here.error
        for (argument, at), value in made.items():
            if at is None:
                first = utc[0][0]
                utc, error = ((first + (value - first - self._tables.utc_offset_us) % DAY,) * 2,), (0, 0)
            else:
                (arguments if argument else slots)[at] = point(value)
        changed = Environment(slots, arguments, utc, error, here.place, here.monitors, here.phase, here.through)
        return build(node, self._tables)(changed) == (TRUE if goal else FALSE)

    def _all(self, left: tree.Node, right: tree.Node, goal: bool) -> tuple[Change, ...] | None:
        first, second = self.find(left, goal), self.find(right, goal)
        return None if first is None or second is None else _merged((*first, *second))

    def _any(self, left: tree.Node, right: tree.Node, goal: bool) -> tuple[Change, ...] | None:
        found = [changes for changes in (self.find(left, goal), self.find(right, goal)) if changes is not None]
        return min(found, key=len, default=None)

    def _bound(self, terms: tuple[tree.Term, ...], bound: int, upper: bool) -> tuple[Change, ...] | None:
        """The sum is at most, or at least, `bound`."""
        split = self._split(terms)
        if split is None:
            return None
        (argument, at, factor), low, high = split
        left = bound - (high if upper else low)
        if upper == (factor > 0):
            return (Change(argument, at, -MAX_VALUE, left // factor, None),)
        return (Change(argument, at, -(left // -factor), MAX_VALUE, None),)

    def _exactly(self, terms: tuple[tree.Term, ...], value: int) -> tuple[Change, ...] | None:
        split = self._split(terms)
        if split is None:
            return None
        (argument, at, factor), low, high = split
        wanted, rest = divmod(value - low, factor)
        return None if rest or low != high else (Change(argument, at, wanted, wanted, None),)

    def _split(self, terms: tuple[tree.Term, ...]) -> tuple[tree.Term, int, int] | None:
        """The term to change (an argument rather than a signal), and the bounds of the sum of the others."""
        movable = sorted((term for term in terms if term.factor), key=lambda term: term.argument == self._signals_only)
        if not movable:
            return None
        others = tuple(term for term in terms if term != movable[0])
        low, high, gap = total(others, self._at)
        return None if gap else (movable[0], low, high)


def _merged(changes: Sequence[Change]) -> tuple[Change, ...] | None:
    """One change for each subject, None when two contradict."""
    merged: dict[Subject, Change] = {}
    for new in changes:
        old = merged.setdefault(new.subject, new)
        if old is not new:
            both = _both(old, new)
            if both is None:
                return None
            merged[new.subject] = both
    return tuple(merged.values())


def _both(a: Change, b: Change) -> Change | None:
    if a.at is None or (a.choices is None) != (b.choices is None):
        return None
    if a.choices is not None and b.choices is not None:
        common = a.choices & b.choices
        return a._replace(choices=common) if common else None
    low, high = max(a.low, b.low), min(a.high, b.high)
    return a._replace(low=low, high=high) if low <= high else None


def nearest_in(change: Change, value: Value) -> int:
    """The value nearest to the present one that the change allows; the nearer end of a window for a time of day."""
    low, high = change.low, change.high
    present, _, gap, _ = value
    if change.at is None:
        return low if (low - present) % DAY <= (present - high) % DAY else high
    if gap:
        return low if high == MAX_VALUE else high
    return low if present < low else high
