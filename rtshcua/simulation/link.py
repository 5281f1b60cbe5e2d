"""One direction of the link: what is sent arrives later, or not at all."""

from collections import deque
from random import Random


class Link:
    """Datagrams in the order they were sent, with a delay, a loss and a switch for silence."""

    def __init__(self, chance: Random) -> None:
        self.delay_us = 0
        self.loss = 0
        """In 1/10000."""
        self.silent = False
        self._chance = chance
        self._under_way: deque[tuple[int, bytes]] = deque()

    def send(self, datagram: bytes, now_us: int) -> None:
        """Puts a datagram on its way."""
        if self.silent or (self.loss and self._chance.randrange(10_000) < self.loss):
            return
        self._under_way.append((now_us + self.delay_us, datagram))

    def due(self, now_us: int) -> list[bytes]:
        """What has arrived by now. None overtakes another, as on a serial line."""
        arrived = []
        while self._under_way and self._under_way[0][0] <= now_us:
            arrived.append(self._under_way.popleft()[1])
        return arrived
