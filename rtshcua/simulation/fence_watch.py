"""Watches the fence in flight. A flavour's `fence.py` says when there is a fence, and what a breach brings."""

from collections.abc import Callable
from dataclasses import dataclass

from rtshcua.simulation.fence import Area, Limits
from rtshcua.simulation.place import Home, Point
from rtshcua.simulation.plan import FENCE, Plans

LOADED_US = 100_000
"""How long after a change, of the upload or of a setting, there is no fence: targets that come right behind an upload
are not checked, as recorded from both autopilots."""
CHECK_US = 200_000


@dataclass(frozen=True, slots=True)
class Breach:
    """What is violated: the flavour's name of it, and by how much on the plane, in metres."""

    name: str
    by: float = 0.0


@dataclass(frozen=True, slots=True)
class FenceRules:
    """What a flavour does its own way."""

    limits: Callable[[Callable[[str], float], Area], Limits | None]
    """From the parameters (by name) and the uploaded area: the fence in force, if there is one."""
    name: Callable[[Limits, Point], str]
    """What of the fence is violated there."""
    every: bool
    """Whether every included area must be kept to."""
    critical: bool
    """Whether HEARTBEAT tells of a breach (MAV_STATE_CRITICAL)."""


class FenceWatch:
    """The fence of one vehicle. `value` gives a parameter's value by its name."""

    def __init__(self, rules: FenceRules, plans: Plans, home: Home, value: Callable[[str], float]) -> None:
        self._rules = rules
        self._plans = plans
        self._home = home
        self._value = value
        self._area = Area()
        self._limits: Limits | None = None
        self._changed_us = 0
        self._checked_us = -CHECK_US
        self._now_us = 0
        self._stale = True
        self.breach: Breach | None = None
        """What is violated now, while armed and in the air."""
        self.count = 0
        """How many breaches there were."""
        plans.listeners.append(self._plan_changed)

    def _plan_changed(self, kind: int) -> None:
        if kind == FENCE:
            self._area = Area.of(self._plans.items(FENCE), self._home, self._rules.every)
            self.settings_changed()

    def settings_changed(self) -> None:
        """A parameter was set; the fence is another one a moment later."""
        self._limits = None
        self._stale = True
        self._changed_us = self._now_us

    @property
    def in_force(self) -> bool:
        """Whether there is a fence."""
        return self._limits is not None

    @property
    def critical(self) -> bool:
        """Whether HEARTBEAT tells of a breach now."""
        return self.breach is not None and self._rules.critical

    def allows(self, point: Point) -> bool:
        """Whether the fence that is in force now has nothing against a target there."""
        return self._limits is None or self._limits.holds(point)

    def step(self, now_us: int, where: Callable[[], Point], flying: bool) -> Breach | None:
        """Lets time pass; the breach that began now, if one did. `where` tells where the vehicle believes to be."""
        self._now_us = now_us
        if now_us - self._checked_us < CHECK_US and not self._stale:
            return None
        if self._stale:
            if now_us - self._changed_us < LOADED_US:
                return None
            self._stale, self._limits = False, self._rules.limits(self._value, self._area)
        self._checked_us = now_us
        limits = self._limits
        point = where() if limits is not None and flying else None
        if limits is None or point is None or limits.holds(point):
            self.breach = None
            return None
        before = self.breach
        self.breach = Breach(self._rules.name(limits, point), limits.area.outside_by(point.north, point.east))
        if before is not None:
            return None
        self.count += 1
        return self.breach
