"""One direction of the link, with delay, reordering and loss."""

from bisect import insort
from collections.abc import Iterable, Sequence
from operator import itemgetter
from random import Random

OVERTAKEN_US = 60_000
"""The additional delay of a datagram that others overtake."""

_arrival = itemgetter(0)


class FaultyLink:
    """Delivers datagrams in order, except for injected faults. Random choices come from a seeded source."""

    def __init__(self, chance: Random) -> None:
        self.delay_us = 0
        self.jitter_us = 0
        """The greatest random additional delay. Later datagrams wait, as on a serial line."""
        self.loss = 0
        """The share of datagrams that are lost, in 1/10000."""
        self.reordered = 0
        """The share of datagrams that others overtake, in 1/10000."""
        self.silent = False
        """Whether all datagrams are lost."""
        self.held = False
        """Whether all datagrams are held back, to arrive later in one burst."""
        self._chance = chance
        self._free_us = 0
        self.under_way: list[tuple[int, Sequence[bytes]]] = []
        """Datagrams in flight, in the order of arrival, with their arrival times."""
        self._waiting: list[bytes] = []

    def send(self, datagrams: Sequence[bytes], now_us: int) -> None:
        """Send datagrams, in this order."""
        if self.silent:
            return
        for some in self._apart(datagrams):
            if self.loss and self._happens(self.loss):
                continue
            if self.held:
                self._waiting += some
            else:
                self._launch(some, now_us)

    def _apart(self, datagrams: Sequence[bytes]) -> Iterable[Sequence[bytes]]:
        """Return the groups that are delivered together: single datagrams if chance decides about each."""
        if not datagrams or self.loss or self.jitter_us or self.reordered:
            return [(datagram,) for datagram in datagrams]
        return (datagrams,)

    def _launch(self, datagrams: Sequence[bytes], now_us: int) -> None:
        at_us = now_us + self.delay_us
        if self.jitter_us:
            at_us += self._chance.randrange(self.jitter_us + 1)
        if at_us < self._free_us:
            at_us = self._free_us
        if self.reordered and self._happens(self.reordered):
            at_us += OVERTAKEN_US
        else:
            self._free_us = at_us
        insort(self.under_way, (at_us, datagrams), key=_arrival)  # after those that arrive at the same time

    def release(self, now_us: int, shuffle: Random | None = None) -> None:
        """Send the held datagrams, shuffled if `shuffle` is given."""
        self.held = False
        waited, self._waiting = self._waiting, []
        if shuffle is not None:
            shuffle.shuffle(waited)
        for some in self._apart(waited):
            self._launch(some, now_us)

    def due(self, now_us: int) -> list[bytes]:
        """Return the datagrams that have arrived by now."""
        arrived: list[bytes] = []
        under_way = self.under_way
        while under_way and under_way[0][0] <= now_us:
            arrived += under_way.pop(0)[1]
        return arrived

    def _happens(self, part: int) -> bool:
        return self._chance.randrange(10_000) < part
