"""What is told to any ground station as STATUSTEXT: never needed for the flight, and the first to be left out."""

from collections import deque
from typing import Final

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.flavour import Message

#: So many wait at most: what is older is left out.
KEPT: Final = 4
EACH_US: Final = 200_000


class Announcer:
    """Keeps texts until the link has nothing better to do."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[int, str]] = deque(maxlen=KEPT)
        self._sent_us: int | None = None

    def add(self, severity: int, text: str) -> None:
        """Announce a text; of a long one the first 50 octets."""
        self._waiting.append((severity, text))

    def due(self, now_us: int, *, busy: bool) -> list[Message]:
        """The next one, unless the link is busy or was just used for one."""
        if busy or not self._waiting or (self._sent_us is not None and now_us - self._sent_us < EACH_US):
            return []
        self._sent_us = now_us
        return [messages.status_text(*self._waiting.popleft())]
