"""What flying takes of the battery, as measured: the signal `battery.drain`, the part of the charge taken in a minute.

Autopilots report their charge in whole percent. So it is timed from one change to another within a window: between the
changes each percent is known to have been taken. While the next change is still to come, no more than one is counted
on top of those that came, so a vehicle that takes less than before is believed soon.
"""

from collections import deque
from typing import Final

from rtshcua.decision.flying import MINUTE, MOST_DRAIN, SECOND

#: What is looked back on, us, and how many changes tell something: the two stretches between three.
WINDOW_US: Final = 60 * SECOND
LEAST_CHANGES: Final = 3
#: More than this at once, 1/10000, and so much in a second besides, is a finding about the battery and no drain: what
#: was measured before counts no more. Some autopilots report their charge in steps of 5 %.
JUMP: Final = 500
JUMP_RATE: Final = 200


class DrainMeter:
    """Measures one charge, 1/10000, by the times at which it was measured itself. All integers."""

    def __init__(self) -> None:
        self._changes: deque[tuple[int, int]] = deque()  # when it came to be so much
        self._last: tuple[int, int] | None = None

    def take(self, charge: int | None, at_us: int) -> int | None:
        """One report of the charge, None where it is not known; what is taken in a minute, if that is known yet."""
        if charge is None:
            self._changes.clear()
            self._last = None
            return None
        last, changes = self._last, self._changes
        if last is not None and at_us < last[0]:
            at_us = last[0]  # came late
        self._last = at_us, charge
        if last is not None and charge != last[1]:
            gap_us, fell = at_us - last[0], last[1] - charge
            if fell < 0 or fell > JUMP + JUMP_RATE * gap_us // SECOND:
                changes.clear()
            else:
                changes.append((at_us, charge))
        while changes and at_us - changes[0][0] > WINDOW_US:
            changes.popleft()
        return self._rate(at_us) if len(changes) >= LEAST_CHANGES else None

    def _rate(self, now_us: int) -> int:
        """From the first change to the last, or to now with one more: whichever is less. Rounded up."""
        (first_us, before), (last_us, after) = self._changes[0], self._changes[-1]
        taken = before - after
        mean = -(-taken // (len(self._changes) - 1))
        rate = _in_a_minute(taken, last_us - first_us)
        return min(rate, _in_a_minute(taken + mean, now_us - first_us))


def _in_a_minute(taken: int, us: int) -> int:
    return MOST_DRAIN if us <= 0 else min(-(-taken * MINUTE // us), MOST_DRAIN)
