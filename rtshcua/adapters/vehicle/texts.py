"""STATUSTEXT, both ways: what the vehicle says to people, and what we tell any ground station.

What the vehicle says is untrusted: it may hold anything, come in floods, or never end. It explains, and decides
nothing. What we tell is never needed for the flight, and the first to be left out.
"""

from collections import deque
from typing import Any, Final

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.messages import Message
from rtshcua.mavlink.layouts import TEXT_OCTETS
from rtshcua.onboard.ports import StatusText

LONGEST: Final = 200  # characters
#: A text whose next chunk does not come is taken as it is after this long.
CHUNK_US: Final = 1_000_000
#: So many texts at once, and one more each so often; what is more is counted.
BURST: Final = 20
EARNED_US: Final = 500_000


def quoted(text: str) -> str:
    """The text with everything that does not print, and what a terminal or a log could obey, written as escapes."""
    return "".join([each if each.isprintable() else each.encode("unicode_escape").decode() for each in text])[:LONGEST]


class StatusTexts:
    """Collects the texts of one component, not too many of them. A long one comes in chunks that share an `id`
    (MAVLink 2).
    """

    def __init__(self) -> None:
        self._id = 0
        #: what came of a text that is not whole yet
        self.parts: list[str] = []
        self._severity = 0
        self._at_us = 0
        self._left = BURST
        self._paid_us: int | None = None
        self._dropped = 0

    def take(self, message: Any, now_us: int) -> list[StatusText]:
        """Take in one STATUSTEXT; the texts that are complete now."""
        part: str = message.text
        said: list[StatusText] = []
        if not (self.parts and message.id == self._id and message.chunk_seq == len(self.parts)):
            said += self._finish(now_us)
        self._id, self._severity, self._at_us = message.id, message.severity, now_us
        self.parts.append(part)
        if len(part) < TEXT_OCTETS or not message.id or len(self.parts) * TEXT_OCTETS >= LONGEST:
            said += self._finish(now_us)
        return said

    def due(self, now_us: int) -> list[StatusText]:
        """The text whose end did not come in time."""
        return self._finish(now_us) if self.parts and now_us - self._at_us > CHUNK_US else []

    def _finish(self, now_us: int) -> list[StatusText]:
        text = quoted("".join(self.parts).rstrip("\0\t\r\n "))
        self.parts = []
        if not text:
            return []
        if self._paid_us is None:
            self._paid_us = now_us
        earned = (now_us - self._paid_us) // EARNED_US
        self._left = min(BURST, self._left + earned)
        self._paid_us += earned * EARNED_US
        if not self._left:
            self._dropped += 1
            return []
        self._left -= 1
        if self._dropped:
            text, self._dropped = f"{text} ({self._dropped} texts before it were left out)", 0
        return [StatusText(now_us, self._severity, text)]


#: So many wait at most: what is older is left out.
KEPT: Final = 4
EACH_US: Final = 200_000


class Announcer:
    """Keeps what is told to ground stations until the link has nothing better to do."""

    def __init__(self) -> None:
        #: what there is to tell
        self.waiting: deque[tuple[int, str]] = deque(maxlen=KEPT)
        self._sent_us: int | None = None

    def add(self, severity: int, text: str) -> None:
        """Announce a text; of a long one the first 50 octets."""
        self.waiting.append((severity, text))

    def due(self, now_us: int, *, busy: bool) -> list[Message]:
        """The next one, unless the link is busy or was just used for one."""
        if busy or not self.waiting or (self._sent_us is not None and now_us - self._sent_us < EACH_US):
            return []
        self._sent_us = now_us
        return [messages.status_text(*self.waiting.popleft())]
