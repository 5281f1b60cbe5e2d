"""Comparisons of the local time with a time of day to postfix code: each asks whether it is in a part of that day.

A window includes both its ends, which are whole us: before 19:00 is up to the last us of it, after 19:00 from the next.
"""

from rtshcua.ground.compiler.emit import Code
from rtshcua.model.flat.code import Op
from rtshcua.model.flat.limits import DAY
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
