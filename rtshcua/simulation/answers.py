"""The delay until an autopilot handles a message, drawn from recordings of real autopilots.

The recordings in `tests/traces` hold 217 delays from a command or parameter request to its answer, by the recorder's
clock. `docs/flying/simulated-vehicle.md` has the figures.
"""

from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from operator import itemgetter
from random import Random

from rtshcua.codec.frames import ReceivedFrame


class Delays:
    """A cumulative distribution of delays: points (percent, microseconds), linear between them."""

    def __init__(self, *shape: tuple[int, int]) -> None:
        self._parts = [part for part, _ in shape]
        self._times = [time_us for _, time_us in shape]

    def draw(self, chance: Random) -> int:
        """Draw one delay, in microseconds."""
        at = chance.random() * 100
        above = bisect_right(self._parts, at)
        low, high = self._parts[above - 1], self._parts[above]
        start, end = self._times[above - 1], self._times[above]
        return round(start + (end - start) * (at - low) / (high - low))


@dataclass(frozen=True, slots=True)
class Lanes:
    """The parts of an autopilot that answer. Each answers in order; one part may overtake another."""

    of: Callable[[ReceivedFrame], int]
    """The index of the part that handles a message."""
    delays: Sequence[Delays]
    """The delay distribution of each part."""


class Inbox:
    """Messages that wait for the autopilot to handle them. Delays come from a seeded random source."""

    def __init__(self, lanes: Lanes, chance: Random) -> None:
        self._lanes = lanes
        self._chance = chance
        self._waiting: list[deque[tuple[int, ReceivedFrame]]] = [deque() for _ in lanes.delays]
        self.next_us: int | None = None
        """When the autopilot handles the next message; None while no message waits."""

    def put(self, received: ReceivedFrame, now_us: int) -> None:
        """Queue a message that has arrived."""
        number = self._lanes.of(received)
        lane = self._waiting[number]
        at_us = now_us + self._lanes.delays[number].draw(self._chance)
        lane.append((max(at_us, lane[-1][0]) if lane else at_us, received))
        self._look()

    def due(self, now_us: int) -> Iterator[tuple[int, ReceivedFrame]]:
        """Return the messages that the autopilot has handled by now, each with its time."""
        if self.next_us is None or self.next_us > now_us:
            return iter(())
        ready: list[tuple[int, ReceivedFrame]] = []
        for lane in self._waiting:
            while lane and lane[0][0] <= now_us:
                ready.append(lane.popleft())
        self._look()
        return iter(sorted(ready, key=itemgetter(0)))

    def clear(self) -> None:
        """Drop all waiting messages."""
        for lane in self._waiting:
            lane.clear()
        self.next_us = None

    def _look(self) -> None:
        self.next_us = min((lane[0][0] for lane in self._waiting if lane), default=None)
