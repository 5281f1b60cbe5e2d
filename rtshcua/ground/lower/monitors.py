"""The temporal monitors of a policy, each kept once: what is inside another comes before it."""

from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.policy import Monitor, MonitorKind


class Monitors:
    """Monitors by what they remember, of how long, and of which code."""

    def __init__(self) -> None:
        self.all: list[Monitor] = []
        self._numbers: dict[tuple[int, int, tuple[int, ...]], int] = {}

    def of(self, kind: MonitorKind, window_us: int, when: Clause) -> int:
        """The index of a monitor; of two that read the same, the first tells where its condition is written."""
        key = (int(kind), window_us, when.code)
        number = self._numbers.get(key)
        if number is None:
            number = self._numbers[key] = len(self.all)
            self.all.append(Monitor(int(kind), window_us, when))
        return number
