"""RADIO_STATUS on a link with a key: radios do not sign, so their reports can be forged, and may only make the state
worse.

The worst value of the last seconds counts, field by field, so that a forged frame can make the link look worse but
never better. It is only accepted if the operator states that there is a radio.
"""

from typing import Any, Final

from rtshcua.mavlink.framing import FLAG_SIGNED, FLAGS, message_id
from rtshcua.mavlink.signing import Counts, FrameVerifier

RADIO_STATUS: Final = 109
#: the ids of a SiK radio: `RADIO_SOURCE_SYSTEM` '3' and `RADIO_SOURCE_COMPONENT` 'D' of ArduPilot/SiK,
#: Firmware/radio/mavlink.c
RADIO_SYSTEM, RADIO = 51, 68
#: us; radios report each second
SPAN_US: Final = 5_000_000

_BETTER_HIGH: Final = ("rssi", "remrssi", "txbuf")
_BETTER_LOW: Final = ("noise", "remnoise", "rxerrors", "fixed")
_NOT_KNOWN: Final = 255


class UnsignedRadio:
    """Accepts the frames that `link` accepts, and unsigned RADIO_STATUS with the worst recent values."""

    def __init__(self, link: FrameVerifier) -> None:
        self._link = link
        self._now: dict[str, int] = {}  # the worst since `_since_us`,
        self._before: dict[str, int] = {}  # and in the span before it
        self._since_us: int | None = None

    @property
    def counts(self) -> Counts:
        return self._link.counts

    def accept(self, frame: bytes, now_us: int) -> bool:
        """Whether a frame is accepted."""
        if not frame[FLAGS] & FLAG_SIGNED and message_id(frame, 0) == RADIO_STATUS:
            return True
        return self._link.accept(frame, now_us)

    def temper(self, message: Any, now_us: int) -> None:
        """Replace the values of an unsigned RADIO_STATUS by the worst within the last `SPAN_US`."""
        since_us = self._since_us
        if since_us is None or now_us - since_us >= SPAN_US:
            recent = since_us is not None and now_us - since_us < 2 * SPAN_US
            self._before, self._now, self._since_us = (self._now if recent else {}), {}, now_us
        for names, worst in ((_BETTER_HIGH, _lower), (_BETTER_LOW, max)):
            for name in names:
                value = getattr(message, name)
                self._now[name] = worst(self._now.get(name, value), value)
                setattr(message, name, worst(self._before.get(name, value), self._now[name]))


def _lower(one: int, other: int) -> int:
    """The worse of two values; unknown is the worst."""
    return _NOT_KNOWN if _NOT_KNOWN in (one, other) else min(one, other)
