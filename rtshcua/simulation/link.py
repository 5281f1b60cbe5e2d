"""One direction of the link: what is sent arrives later, in another order, or not at all."""

from bisect import insort
from collections.abc import Iterable, Sequence
from operator import itemgetter
from random import Random

OVERTAKEN_US = 60_000
"""How much later than the rest a datagram comes that others overtake."""

_arrival = itemgetter(0)


class FaultyLink:
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
        self._free_us = 0
        self.under_way: list[tuple[int, Sequence[bytes]]] = []
        """What was sent and has not arrived, in the order of arriving: when it does, and datagrams that come then."""
        self._waiting: list[bytes] = []

    def send(self, datagrams: Sequence[bytes], now_us: int) -> None:
        """Puts datagrams on their way, in this order."""
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
        """Those that share their lot: all, unless chance decides about each."""
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
        insort(self.under_way, (at_us, datagrams), key=_arrival)  # behind those that arrive at the same time

    def release(self, now_us: int, shuffle: Random | None = None) -> None:
        """Sends what waited, in another order if it is to be shuffled."""
        self.held = False
        waited, self._waiting = self._waiting, []
        if shuffle is not None:
            shuffle.shuffle(waited)
        for some in self._apart(waited):
            self._launch(some, now_us)

    def due(self, now_us: int) -> list[bytes]:
        """What has arrived by now."""
        arrived: list[bytes] = []
        under_way = self.under_way
        while under_way and under_way[0][0] <= now_us:
            arrived += under_way.pop(0)[1]
        return arrived

    def _happens(self, part: int) -> bool:
        return self._chance.randrange(10_000) < part
