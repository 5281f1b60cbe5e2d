"""What the autopilot's own estimator vouches for: position and height are known only while it does.

GLOBAL_POSITION_INT goes on as if nothing had happened while the estimator has no position any more, and begins before
it has one; the pre-arm bit of SYS_STATUS turns good seconds too early (recorded flights of ArduCopter 4.7). Only the
flags of ESTIMATOR_STATUS (PX4) and EKF_STATUS_REPORT (ArduPilot) tell; up to 0x200 they mean the same in both.
"""

from collections.abc import Mapping
from typing import Final

#: ESTIMATOR_STATUS_FLAGS, EKF_STATUS_FLAGS
ATTITUDE: Final = 0x01
VELOCITY_HORIZONTAL: Final = 0x02
VELOCITY_VERTICAL: Final = 0x04
POSITION_RELATIVE: Final = 0x08
POSITION: Final = 0x10
HEIGHT: Final = 0x20
#: PX4: GPS glitch; ArduPilot: not initialised. Either way its position is worth nothing.
_GLITCH: Final = 0x400
#: ArduPilot alone: GPS glitching
_GLITCHING: Final = 0x8000

#: A report that is older than this vouches for nothing; it is asked for several times within.
STALE_US: Final = 2_000_000

_WHERE: Final = POSITION | VELOCITY_HORIZONTAL | ATTITUDE
_HIGH: Final = HEIGHT | VELOCITY_VERTICAL | ATTITUDE
_ACROSS: Final = VELOCITY_HORIZONTAL | ATTITUDE
_UP: Final = VELOCITY_VERTICAL | ATTITUDE

#: What a field rests on. What is not here does not come from the estimator.
_RESTS_ON: Mapping[str, Mapping[str, int]] = {
    "GLOBAL_POSITION_INT": {
        "lat": _WHERE, "lon": _WHERE, "alt": _HIGH, "relative_alt": _HIGH, "vx": _ACROSS, "vy": _ACROSS, "vz": _UP,
        "hdg": ATTITUDE,
    },
    "LOCAL_POSITION_NED": {
        "x": POSITION_RELATIVE | _ACROSS, "y": POSITION_RELATIVE | _ACROSS, "z": _HIGH,
        "vx": _ACROSS, "vy": _ACROSS, "vz": _UP,
    },
    "VFR_HUD": {"alt": _HIGH, "climb": _UP, "groundspeed": _ACROSS, "heading": ATTITUDE},
    "ATTITUDE": dict.fromkeys(("roll", "pitch", "yaw", "rollspeed", "pitchspeed", "yawspeed"), ATTITUDE),
}  # fmt: skip


class Estimator:
    """The last report, by `flags` and when it was made. A height is above home, so it means nothing before there is
    one: the estimator must have had a position once.
    """

    def __init__(self, report: str = "") -> None:
        self.report = report
        self._flags = 0
        self._at_us: int | None = None
        self._homed = False

    def take(self, flags: int, at_us: int) -> None:
        """A report came that was made at `at_us` (see `source_time`); one that is older than the last is set aside."""
        if self._at_us is not None and at_us < self._at_us:
            return
        self._flags, self._at_us = flags, at_us
        self._homed = self._homed or self.position(at_us)

    def vouches(self, bits: int, now_us: int) -> bool:
        """Whether a report that is not stale has all these flags, and no sign of being astray."""
        if self._at_us is None or now_us - self._at_us > STALE_US:
            return False
        astray = bits & (POSITION | POSITION_RELATIVE | VELOCITY_HORIZONTAL) and self._flags & (_GLITCH | _GLITCHING)
        return not astray and self._flags & bits == bits

    def position(self, now_us: int) -> bool:
        """Whether it knows where it is."""
        return self.vouches(_WHERE, now_us)

    def height(self, now_us: int) -> bool:
        """Whether it knows how high above home it is."""
        return self._homed and self.vouches(_HIGH, now_us)

    def vouches_for(self, message: str, field: str, now_us: int) -> bool:
        """Whether what this field of a message says is known to the estimator; true of what does not come from it."""
        fields = _RESTS_ON.get(message)
        bits = 0 if fields is None else fields.get(field, 0)
        if bits & HEIGHT and field == "relative_alt":
            return self.height(now_us)
        return not bits or self.vouches(bits, now_us)

    def missing(self, now_us: int) -> str | None:
        """What it has not got, in words; None when it has a position and a height."""
        if self._at_us is None:
            return f"its estimator says nothing (no {self.report})"
        if now_us - self._at_us > STALE_US:
            return f"its estimator fell silent (no {self.report})"
        if not self.position(now_us):
            return f"its estimator has no position (flags 0x{self._flags:x})"
        return None if self.height(now_us) else f"its estimator has no height (flags 0x{self._flags:x})"
