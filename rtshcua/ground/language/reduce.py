"""What to do with the values of a rule: one small function for each, made once for a text."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.table import Rule

#: from the stack of values, where the rule's own begin in it, and the offsets at which its text starts and ends
Make = Callable[[list[Any], int, int, int], object]


class Reduction(NamedTuple):
    """Pop `length` values, push what `make` makes of them, and go on with `origin`."""

    origin: str
    length: int
    make: Make


def reduction(rule: Rule, file: str, actions: object) -> Reduction:
    """The reduction of `rule`, whose action is a method of `actions`."""
    if rule.action:
        make = _call(rule.kept, file, getattr(actions, rule.action))
    elif rule.repeats:
        make = _repeat(*(at for at in rule.kept if at is not None))
    else:
        (at,) = rule.kept
        make = _keep(at or 0)
    return Reduction(rule.origin, rule.length, make)


class Reductions(dict[int, Reduction]):
    """The reductions by the rule's number, each made when it is first needed: a short text has need of few."""

    def __init__(self, rules: Sequence[Rule], file: str, actions: object) -> None:
        super().__init__()
        self._rules, self._file, self._actions = rules, file, actions

    def __missing__(self, number: int) -> Reduction:
        made = self[number] = reduction(self._rules[number], self._file, self._actions)
        return made


def _keep(at: int) -> Make:
    def make(values: list[Any], base: int, start: int, end: int) -> object:
        return values[base + at]

    return make


def _repeat(first: int, *more: int) -> Make:
    """A list that begins with `first`, or is that list itself, so that a long list is not copied at every step."""

    def make(values: list[Any], base: int, start: int, end: int) -> object:
        made = [values[base + first]] if first >= 0 else values[base + ~first]
        made.extend([values[base + at] for at in more])
        return made

    return make


def _call(kept: tuple[int | None, ...], file: str, action: Callable[..., object]) -> Make:
    new = tuple.__new__

    def make(values: list[Any], base: int, start: int, end: int) -> object:
        arguments = [None if at is None else values[base + at] for at in kept]
        return action(new(Span, (file, start, end)), *arguments)

    def make_spreading(values: list[Any], base: int, start: int, end: int) -> object:
        arguments: list[Any] = []
        for at in kept:
            if at is None:
                arguments.append(None)
            elif at >= 0:
                arguments.append(values[base + at])
            else:
                arguments += values[base + ~at]
        return action(new(Span, (file, start, end)), *arguments)

    return make_spreading if any(at is not None and at < 0 for at in kept) else make
