"""MAVLink 2 signing, the vehicle's end: https://mavlink.io/en/guide/message_signing.html.

Once a key is set (SETUP_SIGNING, or from the start) all that the autopilot sends is signed, and what is not rightly
signed has no effect and gets no answer, as recorded from ArduCopter on its second channel. What is let in all the same
is the flavour's (`obeys_unsigned`), and so is whether it takes a key at all (`on_setup_signing`).
"""

from typing import Final

from rtshcua.codec.frames import Message, ReceivedFrame
from rtshcua.mavlink.signing import EPOCH_US, UNIT_US, SignedLink, SigningState

_FULL_SPEED: Final = 100
_LATEST: Final = 1 << 47
"""No key begins with a later time stamp (in the year 2059): they have 48 bits, and must not run out in flight."""


class VehicleSigning:
    """One vehicle's key, if it has one. `speed`: see `SimulationConfig.speed`; `ahead_us`: how far ahead of the time
    that it was given with a key begins; then its time stamps count what it sends, and not the time (recorded).
    """

    def __init__(self, key: bytes | None, utc_us: int, speed: int, ahead_us: int) -> None:
        self._ahead_us = ahead_us
        self._speed = speed
        self._before_us = 0  # how long it ran before it was started again
        self._link: SignedLink | None = None
        if key is not None:
            self._link = SignedLink(key, SigningState(0, {}), max(utc_us, EPOCH_US) + ahead_us, 0, as_library=True)

    @property
    def on(self) -> bool:
        """Whether there is a key."""
        return self._link is not None

    def accept(self, received: ReceivedFrame, now_us: int) -> bool:
        """Whether a frame is rightly signed; without a key every frame is as good."""
        return self._link is None or self._link.accept(received.frame, self._clock(now_us))

    def set_up(self, message: Message, now_us: int) -> None:
        """SETUP_SIGNING: another key and the first time stamp, or none at all if the key is nothing but zeros."""
        key = bytes(message.secret_key)
        if any(key):
            first = min(message.initial_timestamp + self._ahead_us // UNIT_US, _LATEST)
            self._link = SignedLink(key, SigningState(first, {}), EPOCH_US, self._clock(now_us), as_library=True)
        else:
            self._link = None

    def restart(self, after_us: int) -> None:
        """The autopilot starts again, `after_us` after the last start: its clock begins anew, time stamps go on."""
        self._before_us += after_us

    def seal(self, frame: bytes, now_us: int) -> bytes:
        """The frame as it leaves: signed, if there is a key."""
        return frame if self._link is None else self._link.sign(frame, self._clock(now_us))

    def _clock(self, now_us: int) -> int:
        return 0 if self._ahead_us else (self._before_us + now_us) * _FULL_SPEED // self._speed
