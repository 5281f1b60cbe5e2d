"""Secrets of epoch keys, the same in each run."""

from collections.abc import Callable
from itertools import count


def epoch_seeds() -> Callable[[], bytes]:
    """What a recorder draws its epoch keys from."""
    numbers = count(1)
    return lambda: next(numbers).to_bytes(32)
