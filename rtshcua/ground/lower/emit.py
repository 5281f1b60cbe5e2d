"""Postfix code, written one instruction at a time; see `rtshcua.model.flat.code`."""

from rtshcua.model.flat.code import Op

_PUSHES = frozenset(
    {
        Op.CONST,
        Op.SIGNAL,
        Op.ARGUMENT,
        Op.SIGNAL_IN,
        Op.ARGUMENT_IN,
        Op.KNOWN,
        Op.POSITION_IN,
        Op.POSITION_IN_ARGUMENT,
        Op.ARGUMENT_POINT_IN,
        Op.TIME_IN,
        Op.WEEK_IN,
        Op.PHASE_IN,
        Op.MONITOR,
    }
)
_KEEPS = frozenset({Op.NOT, Op.SCALE})


class Code:
    """Instructions in the order in which they run, and how deep their stack gets."""

    def __init__(self) -> None:
        self.integers: list[int] = []
        self.deepest = 0
        self._depth = 0

    def add(self, op: Op, a: int = 0, b: int = 0) -> None:
        """Append one instruction."""
        self.integers += (int(op), a, b)
        if op in _PUSHES:
            self._depth += 1
            self.deepest = max(self.deepest, self._depth)
        elif op not in _KEEPS:
            self._depth -= 1

    @property
    def length(self) -> int:
        """The number of instructions."""
        return len(self.integers) // 3
