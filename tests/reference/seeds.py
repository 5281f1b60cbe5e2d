"""Secrets of epoch keys, the same in each run."""

from collections.abc import Callable
from itertools import count


class _Seeds:
    """The numbers from 1 on, each as a secret; a copy continues at the present number."""

    def __init__(self) -> None:
        self._numbers = count(1)

    def __call__(self) -> bytes:
        return next(self._numbers).to_bytes(32)


def epoch_seeds() -> Callable[[], bytes]:
    """Return the source of epoch keys for a recorder."""
    return _Seeds()
