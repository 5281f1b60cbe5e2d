"""Whether a manoeuvre gets anywhere: a mode report or an acknowledgement proves nothing, only motion does."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from rtshcua.adapters.vehicle.effects import STILL
from rtshcua.adapters.vehicle.observed import Observed
from rtshcua.model.flat.policy import Vehicle

#: mm by which some measure must fall for it to count as progress
LEAST: Final = 1_000
#: us of link time between a command to stop that was obeyed and the time from which its effect must show: what
#: filters, reports and a gust take. PX4 1.16 needs it: from 4.5 m/s it is below 0.4 m/s after 3.6 to 4.6 s only.
LAG_US: Final = 2_000_000
#: what a vehicle is taken to brake with that does not say: mm/s^2, and us before it begins
UNDECLARED_BRAKING: Final = 1_000
UNDECLARED_REACTION_US: Final = 1_000_000
_SECOND: Final = 1_000_000

Measure = Callable[[Observed], tuple[int, ...] | None]
"""What is left, in mm, in one or more ways of which one falls while there is progress; None: not known now."""


@dataclass(frozen=True, slots=True)
class Expected:
    """How a stage shows its progress: some part of `measure` falls by `LEAST` within `within_us` of link time.

    `either_way`: that it changes is enough. A return climbs, crosses and descends, to a place that the autopilot knows.
    """

    measure: Measure
    within_us: int
    either_way: bool = False


class Progress:
    """Follows one stage."""

    def __init__(self, expected: Expected) -> None:
        self._expected = expected
        self._best: tuple[int, ...] | None = None
        self._since_us: int | None = None
        self._began_us: int | None = None
        #: whether there was any progress yet
        self.shown = False

    @property
    def due_us(self) -> int | None:
        """When it will have stalled, in link time, unless something is seen before."""
        return None if self._since_us is None else self._since_us + self._expected.within_us

    def has_stalled(self, seen: Observed) -> bool:
        """Whether nothing fell for too long. What is not known meanwhile is not held against it."""
        left = self._expected.measure(seen)
        if left is None or self._best is None or self._since_us is None:
            self._best, self._since_us = left, None if left is None else seen.up_us
            self._began_us = seen.up_us if self._began_us is None else self._began_us
            return False
        if self._has_come_further(self._best, left):
            self._best, self._since_us, self.shown = left, seen.up_us, True
            return False
        if (
            not self.shown
            and self._has_come_further(left, self._best)
            and seen.up_us - (self._began_us or 0) <= self._expected.within_us
        ):
            self._best, self._since_us = left, seen.up_us  # at first it may have to turn round
        return seen.up_us - self._since_us > self._expected.within_us

    def _has_come_further(self, best: tuple[int, ...], left: tuple[int, ...]) -> bool:
        changes = [before - now for before, now in zip(best, left, strict=True)]
        return max(map(abs, changes) if self._expected.either_way else changes) >= LEAST


@dataclass(frozen=True, slots=True)
class Brakes:
    """How a vehicle brakes, as its policy declares it (`brakes from 12 m/s in 6 s after 500 ms`): mm/s^2 and us."""

    braking: int
    reaction_us: int

    @classmethod
    def of(cls, vehicle: Vehicle) -> "Brakes":
        """Those of a signed vehicle, or a cautious guess for one that declares none."""
        if not vehicle.braking:
            return cls(UNDECLARED_BRAKING, UNDECLARED_REACTION_US)
        return cls(vehicle.braking, vehicle.reaction_us)

    def fastest(self, speed: int, passed_us: int) -> int:
        """How fast it may still be, mm/s, so long after it was told to stop at a speed of `speed`."""
        falling_us = max(passed_us - self.reaction_us - LAG_US, 0)
        return max(speed - self.braking * falling_us // _SECOND, STILL)

    def stands_us(self, speed: int) -> int:
        """By when it must stand still, told to stop at a speed of `speed`."""
        return self.reaction_us + speed * _SECOND // self.braking + 2 * LAG_US


class Stop:
    """Follows a vehicle that was told to stop, from the speed that it then had."""

    def __init__(self, brakes: Brakes, seen: Observed) -> None:
        self._brakes = brakes
        self._speed = seen.speed
        self._since_us: int | None = None

    @property
    def due_us(self) -> int | None:
        """By when it must stand still, in link time; None while it was not seen to obey."""
        return None if self._since_us is None else self._since_us + self._brakes.stands_us(self._speed or 0)

    def has_failed(self, seen: Observed, *, obeyed: bool) -> bool:
        """Whether it is faster than it may be by now, or moves when it must stand still.

        `obeyed`: the command was acknowledged, or its mode shows. The speed that it must lose is the greatest until its
        effect must show. A speed that is not known is none that fell.
        """
        if self._since_us is None and obeyed:
            self._since_us = seen.up_us
        if self._since_us is None or seen.up_us - self._since_us <= self._brakes.reaction_us + LAG_US:
            if seen.speed is not None:  # it may have been told to stop while it still gathered speed
                self._speed = max(self._speed or 0, seen.speed)
            return False
        passed_us, speed = seen.up_us - self._since_us, self._speed or 0
        if passed_us > self._brakes.stands_us(speed):
            return seen.speed is None or seen.speed > STILL
        return seen.speed is not None and seen.speed > self._brakes.fastest(speed, passed_us) + STILL
