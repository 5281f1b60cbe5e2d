"""How long an autopilot takes until it gets to what it was sent: drawn from what was recorded of the real ones.

From a command of ours, or a parameter that was asked for, to its answer, by the clock of who recorded it: 217 of them
are in `tests/traces`. `docs/flying/simulated-vehicle.md` has the figures.
"""

from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from operator import itemgetter
from random import Random

from rtshcua.codec.frames import ReceivedFrame


class Delays:
    """A distribution of delays, from the shortest to the longest: (part of them in %, microseconds), linear between."""

    def __init__(self, *shape: tuple[int, int]) -> None:
        self._parts = [part for part, _ in shape]
        self._times = [time_us for _, time_us in shape]

    def draw(self, chance: Random) -> int:
        """One of them."""
        at = chance.random() * 100
        above = bisect_right(self._parts, at)
        low, high = self._parts[above - 1], self._parts[above]
        start, end = self._times[above - 1], self._times[above]
        return round(start + (end - start) * (at - low) / (high - low))


@dataclass(frozen=True, slots=True)
class Lanes:
    """The parts of an autopilot that answer, each in order and at its own pace, so that one overtakes another."""

    of: Callable[[ReceivedFrame], int]
    """Which part a message is for."""
    delays: Sequence[Delays]
    """How long each takes."""


class Inbox:
    """What was sent to an autopilot and waits for it to get to it. Chance decides, from a seeded source."""

    def __init__(self, lanes: Lanes, chance: Random) -> None:
        self._lanes = lanes
        self._chance = chance
        self._waiting: list[deque[tuple[int, ReceivedFrame]]] = [deque() for _ in lanes.delays]
        self.next_us: int | None = None
        """When the autopilot gets to the next one; None while nothing waits."""

    def put(self, received: ReceivedFrame, now_us: int) -> None:
        """A message has come."""
        number = self._lanes.of(received)
        lane = self._waiting[number]
        at_us = now_us + self._lanes.delays[number].draw(self._chance)
        lane.append((max(at_us, lane[-1][0]) if lane else at_us, received))
        self._look()

    def due(self, now_us: int) -> Iterator[tuple[int, ReceivedFrame]]:
        """What the autopilot has got to by now, and when."""
        if self.next_us is None or self.next_us > now_us:
            return iter(())
        ready: list[tuple[int, ReceivedFrame]] = []
        for lane in self._waiting:
            while lane and lane[0][0] <= now_us:
                ready.append(lane.popleft())
        self._look()
        return iter(sorted(ready, key=itemgetter(0)))

    def clear(self) -> None:
        """Forgets all that waits."""
        for lane in self._waiting:
            lane.clear()
        self.next_us = None

    def _look(self) -> None:
        self.next_us = min((lane[0][0] for lane in self._waiting if lane), default=None)
