"""`L_rem`, paper symbol: what validation and dispatch still take, as a measured high quantile."""

from collections import deque

#: Assumed until enough was measured, in us: an order above anything seen on the machines this was built on.
CONSERVATIVE_US = 20_000
WINDOW = 128
_ENOUGH = 8


class RemainingLatency:
    """The 99th percentile of the last `WINDOW` measurements, integers only; conservative until there are a few.

    The quantile is the nearest rank, so with few measurements it is their maximum.
    """

    def __init__(self, conservative_us: int = CONSERVATIVE_US) -> None:
        self._conservative_us = conservative_us
        self._latest: deque[int] = deque(maxlen=WINDOW)
        self._us = conservative_us

    def measured(self, took_us: int) -> None:
        """Note how long one admission took, from the moment it was decided at to the moment its command was sent."""
        self._latest.append(max(took_us, 0))
        ordered = sorted(self._latest)
        high = ordered[-(-len(ordered) * 99 // 100) - 1]
        self._us = high if len(ordered) >= _ENOUGH else max(high, self._conservative_us)

    @property
    def us(self) -> int:
        """The latency to count with now."""
        return self._us
