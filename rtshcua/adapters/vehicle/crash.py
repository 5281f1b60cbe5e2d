"""A crash told from a landing: by the motors, the fall and the attitude, not by the landed state alone.

What lies on the ground with its motors off says ON_GROUND however it came there.
"""

from typing import Final

from rtshcua.adapters.vehicle.observed import Observed

#: mm above home: motors that stop higher than this, without a landing before, did not stop for one
ABOVE: Final = 3_000
#: us: how old the last report of its flight may be when they stop; after a silence it may have landed meanwhile
RECENT_US: Final = 2_000_000
#: us between two reports of a tilt, of which a single one proves nothing
LASTS_US: Final = 400_000
#: mm/s: no landing comes down so fast,
FALLS: Final = 3_000
#: and no motors stop it to this
STOPPED: Final = 500
#: within this time, in us, between two reports of its speed.
AT_ONCE_US: Final = 400_000
#: us from there until it says that it lies on the ground, or that its motors are off
SETTLES_US: Final = 10_000_000
#: degrees: autopilots lean at most 45 of their own accord
TILTED: Final = 60


class CrashWatch:
    """Looks at each observation of one flight; tells of a crash once."""

    def __init__(self) -> None:
        self._flown = False
        self._told = False
        self._flew: tuple[int, int, bool] | None = None  # when it was last seen to, how high, and whether to land
        self._tilted_us: int | None = None
        self._fell: tuple[int, int] | None = None  # when, and how fast it came down
        self._impact: tuple[int, int] | None = None

    def look(self, seen: Observed, now_us: int) -> str | None:
        """What shows that it crashed; None, also once that was told."""
        if seen.airborne and seen.armed:
            self._flown = True
        if not self._flown or self._told:
            return None
        how = self._motors(seen, now_us) or self._attitude(seen, now_us) or self._fall(seen, now_us)
        self._told = how is not None
        return how

    def _motors(self, seen: Observed, now_us: int) -> str | None:
        """Autopilots call a vehicle landed that is disarmed: what counts is how it flew when it was last seen armed."""
        if seen.armed:
            if seen.airborne and seen.levelled:
                self._flew = now_us, seen.height, seen.landing
            return None
        flew, self._flew = self._flew, None
        if flew is None or now_us - flew[0] > RECENT_US or flew[1] < ABOVE or flew[2]:
            return None
        return f"its motors stopped {flew[1] // 1_000} m above home"

    def _attitude(self, seen: Observed, now_us: int) -> str | None:
        if seen.tilt < TILTED or not (seen.armed or seen.airborne):
            self._tilted_us = None
            return None
        if self._tilted_us is None:
            self._tilted_us = seen.tilt_us
        return f"it leans {seen.tilt} degrees" if seen.tilt_us - self._tilted_us >= LASTS_US else None

    def _fall(self, seen: Observed, now_us: int) -> str | None:
        if seen.descent >= FALLS:
            self._fell, self._impact = (now_us, seen.descent), None
        elif self._fell is not None:
            if abs(seen.descent) <= STOPPED and now_us - self._fell[0] <= AT_ONCE_US:
                self._impact = self._fell
            self._fell = None
        if self._impact is None or now_us - self._impact[0] > SETTLES_US:
            return None
        if seen.airborne and seen.armed:
            return None
        return f"it came down at {self._impact[1] / 1_000:.1f} m/s"
