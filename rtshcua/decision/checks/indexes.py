"""Small checks of numbers and indexes that all other checks use."""

from collections.abc import Iterable, Iterator


def within(name: str, value: int, low: int, high: int) -> Iterator[str]:
    """Yield a problem unless the number is in `low`..`high`."""
    if not low <= value <= high:
        yield f"{name} {value} is not in {low}..{high}"


def index(name: str, value: int, count: int) -> Iterator[str]:
    """Yield a problem unless the number is a valid index of `count` things."""
    if not 0 <= value < count:
        yield f"there is no {name} {value}"


def ascending(name: str, values: Iterable[int], count: int) -> Iterator[str]:
    """Yield a problem unless the numbers are distinct, ascending indexes of `count` things."""
    before = -1
    for value in values:
        if value <= before:
            yield f"{name} indexes are not ascending"
        yield from index(name, value, count)
        before = value


def at(place: str, problems: Iterable[str]) -> Iterator[str]:
    """The same problems, each prefixed with its place."""
    for problem in problems:
        yield f"{place}: {problem}"
