"""Choose a sample of cases for `make test`; `make soak` runs the others."""

from collections.abc import Iterable
from itertools import product
from typing import Any

import pytest


def each_once(*axes: Iterable[Any]) -> list[Any]:
    """Return every combination as parameters. The diagonal covers each value of each axis; the others are marked
    `soak`.

    The diagonal has the first values of all axes, then the second ones; a shorter axis repeats.
    """
    values = [list(axis) for axis in axes]
    sample = {tuple(row % len(axis) for axis in values) for row in range(max(map(len, values)))}
    return [
        pytest.param(
            *(axis[at] for axis, at in zip(values, where, strict=True)),
            marks=() if where in sample else pytest.mark.soak,
        )
        for where in product(*(range(len(axis)) for axis in values))
    ]


def parts(values: Iterable[Any], count: int) -> list[Any]:
    """Split similar cases into interleaved parts: `make test` runs the first part, soak the others."""
    every = list(values)
    return [
        pytest.param(every[at::count], id=f"{at + 1} of {count}", marks=() if at == 0 else pytest.mark.soak)
        for at in range(count)
    ]
