"""Which cases of many `make test` tries; `make soak` tries the others."""

from collections.abc import Iterable
from itertools import product
from typing import Any

import pytest


def each_once(*axes: Iterable[Any]) -> list[Any]:
    """Every combination as parameters. Those on the diagonal show each value of each axis; the others are for soak.

    The diagonal has the first values of all axes, then the second ones; a shorter axis begins again.
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
    """Of many cases that are alike, each so-manieth: `make test` tries the first of these parts, soak the others."""
    every = list(values)
    return [
        pytest.param(every[at::count], id=f"{at + 1} of {count}", marks=() if at == 0 else pytest.mark.soak)
        for at in range(count)
    ]
