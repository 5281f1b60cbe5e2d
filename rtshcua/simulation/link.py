"""One direction of the link: what is sent arrives later, in another order, or not at all."""

from heapq import heappop, heappush
from itertools import count
from random import Random

OVERTAKEN_US = 60_000
"""How much later than the rest a datagram comes that others overtake."""


class Link:
    """Datagrams in the order they were sent, but for what faults ask for. Chance decides, from a seeded source."""

    def __init__(self, chance: Random) -> None:
        self.delay_us = 0
        self.jitter_us = 0
        """Each datagram takes up to this much longer; those behind it wait, as on a serial line."""
        self.loss = 0
        """The part that is lost, in 1/10000."""
        self.reordered = 0
        """The part that others overtake, in 1/10000."""
        self.silent = False
        """Whether everything is lost."""
        self.held = False
        """Whether everything waits: it comes in one burst, later."""
        self._chance = chance
        self._order = count()
        self._free_us = 0
        self.under_way: list[tuple[int, int, bytes]] = []
        """What was sent and has not arrived, a heap: when it does, its place in the order of sending, the datagram."""
        self._waiting: list[bytes] = []

    def send(self, datagram: bytes, now_us: int) -> None:
        """Puts a datagram on its way."""
        if self.silent or (self.loss and self._happens(self.loss)):
            return
        if self.held:
            self._waiting.append(datagram)
        else:
            self._launch(datagram, now_us)

    def _launch(self, datagram: bytes, now_us: int) -> None:
        at_us = now_us + self.delay_us
        if self.jitter_us:
            at_us += self._chance.randrange(self.jitter_us + 1)
        if at_us < self._free_us:
            at_us = self._free_us
        if self.reordered and self._happens(self.reordered):
            at_us += OVERTAKEN_US
        else:
            self._free_us = at_us
        heappush(self.under_way, (at_us, next(self._order), datagram))

    def release(self, now_us: int, shuffle: Random | None = None) -> None:
        """Sends what waited, in another order if it is to be shuffled."""
        self.held = False
        waited, self._waiting = self._waiting, []
        if shuffle is not None:
            shuffle.shuffle(waited)
        for datagram in waited:
            self._launch(datagram, now_us)

    def due(self, now_us: int) -> list[bytes]:
        """What has arrived by now."""
        arrived: list[bytes] = []
        under_way = self.under_way
        while under_way and under_way[0][0] <= now_us:
            arrived.append(heappop(under_way)[2])
        return arrived

    def _happens(self, part: int) -> bool:
        return self._chance.randrange(10_000) < part
