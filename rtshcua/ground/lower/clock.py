"""Comparisons of the local time with a time of day to postfix code: each asks whether it is in a part of that day.

A window includes both its ends, which are whole us: before 19:00 is up to the last us of it, after 19:00 from the next.
One of some days of the week begins on these, and may end on the next.
"""

from collections.abc import Iterable

from rtshcua.ground.lower.emit import Code
from rtshcua.ground.lower.sets import Sets
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.limits import DAY, WEEK
from rtshcua.model.ir.expression import Comparison, TimeOfDay

_MIRRORED = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}


def compare(code: Code, node: Comparison) -> bool:
    """Whether a comparison is one of the local time, and then its code."""
    operator: str = node.operator
    if isinstance(node.right, TimeOfDay):
        time = node.right.value
    elif isinstance(node.left, TimeOfDay):
        time, operator = node.left.value, _MIRRORED[node.operator]
    else:
        return False
    match operator:
        case ">=":
            start, end = time, DAY
        case ">":
            start, end = time + 1, DAY
        case "<=":
            start, end = 0, time
        case _:
            start, end = 0, time - 1
    if end >= 0:
        code.add(Op.TIME_IN, start, end)
    else:  # before 00:00: not at any time of the day
        code.add(Op.TIME_IN, 0, DAY)
        code.add(Op.NOT)
    return True


def window(code: Code, sets: Sets, start: int, end: int, days: tuple[int, ...]) -> None:
    """The code of a window of the day, on some days of the week, or (none) on all."""
    if days:
        windows = week(start, end, days)
        if windows != (0, WEEK):
            code.add(Op.WEEK_IN, sets.of(windows), 0)
            return
        start, end = 0, DAY
    code.add(Op.TIME_IN, start % DAY, end)


def week(start: int, end: int, days: Iterable[int]) -> tuple[int, ...]:
    """Windows of the week, as `Zone.weekly` has them: from `start` to `end`, both included, or over midnight."""
    after = end + 1 if start <= end else end + 1 + DAY
    spans = [(day * DAY + start, day * DAY + after) for day in days]
    within = [(low, min(high, WEEK)) for low, high in spans] + [(0, high - WEEK) for _, high in spans if high > WEEK]
    merged: list[int] = []
    for low, high in sorted(within):
        if merged and low <= merged[-1]:
            merged[-1] = max(merged[-1], high)
        else:
            merged += (low, high)
    return tuple(merged)
