"""The target that the autopilot says it flies to, against those that we gave it (POSITION_TARGET_GLOBAL_INT).

A ground station takes over without any change of mode: PX4's pause and go-to, ArduCopter's guided targets. The
autopilot then reports another target than ours. PX4 reports one whenever it has one, ArduCopter in GUIDED only.
"""

from collections import deque
from dataclasses import dataclass, replace
from typing import Final

from rtshcua.adapters.vehicle.effects import apart
from rtshcua.adapters.vehicle.observed import Observed

#: mm: what rounding, and a height of home that moves a little, may make of a target
SAME: Final = 3_000
#: Until ours shows, what is reported may be older than our frame; in us of link time.
SETTLES_US: Final = 1_500_000
_REMEMBERED: Final = 4

Reported = tuple[int, int, int]
"""Latitude and longitude in 1e-7 degree, mm above mean sea level."""


@dataclass(frozen=True, slots=True)
class Target:
    """What the autopilot should report: a place, and its height in mm above mean sea level (None: any).

    `within`: how far off, in mm, the first one that is reported may be; it then counts as the target. A vehicle that
    was told to stop says itself where it will.
    """

    latitude: int
    longitude: int
    amsl: int | None
    within: int = SAME

    def matches(self, reported: Reported) -> bool:
        """Whether a report is of this target."""
        latitude, longitude, amsl = reported
        level = self.amsl is None or abs(amsl - self.amsl) <= SAME
        return level and apart(latitude, longitude, self.latitude, self.longitude) <= self.within


class Targets:
    """Remembers the targets that we gave, over all manoeuvres of a vehicle."""

    def __init__(self) -> None:
        self._ours: deque[Target] = deque(maxlen=_REMEMBERED)
        self._expected: Target | None = None
        self._prior: Reported | None = None
        self._settled_us = 0
        self._wide: Target | None = None  # the present target as it was expected, where the vehicle names it itself
        self._more = 0  # how often it may name another, for it was told again
        #: whether the autopilot was seen to fly to the present target
        self.shown = False

    def expect(self, target: Target | None, seen: Observed) -> None:
        """From now on this is what it should fly to; None: nothing that could be compared.

        Where it flew to a target of its own, that may show for a while yet. Where it flew to one of ours, any other is
        somebody else's, also one that shows only after our next frame left.
        """
        settles_us = 0 if self.shown else SETTLES_US
        self._expected, self.shown = target, False
        self._wide, self._more = target if target is not None and target.within > SAME else None, 0
        self._prior, self._settled_us = seen.target, seen.up_us + settles_us
        if target is not None:
            self._ours.append(target)

    def told_again(self) -> None:
        """The present target went out once more: each time that it stops anew, it stops somewhere else."""
        self._more += 1

    def is_foreign(self, seen: Observed) -> bool:
        """Whether it flies to somebody else's target."""
        expected, reported = self._expected, seen.target
        if expected is None or reported is None:
            return False
        if reported == self._prior and not self.shown:
            return False  # not obeyed yet; when it never is, there is no progress
        if expected.matches(reported):
            self._show(expected, reported)
            return False
        if self.shown and self._more and self._wide is not None and self._wide.matches(reported):
            self._more, self.shown = self._more - 1, False
            self._show(self._wide, reported)
            return False
        if self.shown:
            return True
        if any(ours.matches(reported) for ours in self._ours if ours is not expected):
            return False  # not obeyed yet
        return seen.up_us >= self._settled_us

    def _show(self, expected: Target, reported: Reported) -> None:
        if not self.shown and expected.within > SAME:  # this is the one, from now on
            latitude, longitude, amsl = reported
            expected = replace(expected, latitude=latitude, longitude=longitude, amsl=amsl, within=SAME)
            self._ours[-1] = self._expected = expected
        self.shown = True
