"""The vehicle's side of MAVLink 2 signing: https://mavlink.io/en/guide/message_signing.html.

Once a key is set (by SETUP_SIGNING, or from the start) the autopilot signs every frame and ignores frames without a
valid signature, as recorded from ArduCopter on its second channel. The flavour decides which unsigned messages it
obeys (`obeys_unsigned`) and whether it accepts a key (`on_setup_signing`).
"""

from typing import Final

from rtshcua.codec.frames import Message, ReceivedFrame
from rtshcua.mavlink.signing import EPOCH_US, UNIT_US, SignedLink, SigningState

_FULL_SPEED: Final = 100
_LATEST: Final = 1 << 47
"""The latest initial time stamp (year 2059): time stamps have 48 bits and must not overflow in flight."""


class VehicleSigning:
    """One vehicle's signing key, if any. `speed`: see `SimulationConfig.speed`; `ahead_us`: how far its time stamps
    begin ahead of the time that came with the key; if not 0, time stamps count frames instead of time (recorded).
    """

    def __init__(self, key: bytes | None, utc_us: int, speed: int, ahead_us: int) -> None:
        self._ahead_us = ahead_us
        self._speed = speed
        self._before_us = 0  # running time before the last restart
        self._link: SignedLink | None = None
        if key is not None:
            self._link = SignedLink(key, SigningState(0, {}), max(utc_us, EPOCH_US) + ahead_us, 0, as_library=True)

    @property
    def on(self) -> bool:
        """Whether a key is set."""
        return self._link is not None

    def accept(self, received: ReceivedFrame, now_us: int) -> bool:
        """Return whether a frame has a valid signature; without a key every frame is accepted."""
        return self._link is None or self._link.accept(received.frame, self._clock(now_us))

    def set_up(self, message: Message, now_us: int) -> None:
        """Handle SETUP_SIGNING: set the key and the initial time stamp; a key of zeros disables signing."""
        key = bytes(message.secret_key)
        if any(key):
            first = min(message.initial_timestamp + self._ahead_us // UNIT_US, _LATEST)
            self._link = SignedLink(key, SigningState(first, {}), EPOCH_US, self._clock(now_us), as_library=True)
        else:
            self._link = None

    def restart(self, after_us: int) -> None:
        """Continue time stamps after a restart, `after_us` after the last start."""
        self._before_us += after_us

    def seal(self, frame: bytes, now_us: int) -> bytes:
        """Return the frame, signed if a key is set."""
        return frame if self._link is None else self._link.sign(frame, self._clock(now_us))

    def _clock(self, now_us: int) -> int:
        return 0 if self._ahead_us else (self._before_us + now_us) * _FULL_SPEED // self._speed
