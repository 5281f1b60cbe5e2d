"""The smallest part of what cannot be that still cannot be."""

from collections.abc import Callable, Sequence
from typing import TypeVar

T = TypeVar("T")


def minimal(parts: Sequence[T], impossible: Callable[[list[T]], bool]) -> list[T]:
    """A subset of parts which are impossible together, such that without any one of them they are not proved to be.

    By deletion: each part is left out if the others are impossible without it.
    """
    kept = list(parts)
    for part in parts:
        without = [each for each in kept if each is not part]
        if without and impossible(without):
            kept = without
    return kept
