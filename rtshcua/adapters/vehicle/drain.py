"""Measure the consumption of the battery: the signal `battery.drain`, the charge that one minute of the way home takes.

By time: autopilots report the charge in whole percent, so the time between changes within a window is measured: each
percent between two changes has certainly been taken. Until the next change, at most one more is added, so a lower
consumption shows soon. The window is a minute, or longer for a slow consumption.

By distance: where the vehicle flies slower over ground than declared, against more wind, each metre takes more charge
than computed although a minute does not. The way home is computed as time, so a minute of it then takes more by the
same factor.
"""

from collections import deque
from math import isqrt
from typing import Final

from rtshcua.decision.flying import MINUTE, MOST_DRAIN, SECOND, over_ground, slower
from rtshcua.model.flat.limits import FULL
from rtshcua.model.flat.policy import VehicleLimits

#: The window in us, and how many changes are needed: three, with two intervals between them.
WINDOW_US: Final = 60 * SECOND
LEAST_CHANGES: Final = 3
#: A charge without a change for this many of its last intervals is no longer drained.
_STANDS: Final = 2
#: A greater fall at once, in 1/10000, beyond the same amount per second, is a change in the battery and not
#: consumption: earlier measurements are dropped. Some autopilots report the charge in steps of 5 or 10 %.
JUMP: Final = 500
JUMP_RATE: Final = 200
STEP: Final = 1_000
#: A charge that rises by more, in 1/10000, belongs to another battery.
RISE: Final = 300

#: The interval of position samples in us, and the longest useful one.
_LOOK_US: Final = SECOND
_GAP_US: Final = 3 * SECOND
#: mm/s: level flight counts at this speed and with no greater change in a second, along the path or in height: setting
#: off, arriving and climbing are computed apart
_LEAST_SPEED: Final = 1_000
_STEADY: Final = 500
#: us of such flight that are needed, and how many samples are kept
LEAST_STEADY_US: Final = 10 * SECOND
_LOOKS: Final = 600

KM: Final = 1_000_000  # mm


class DrainMeter:
    """Measures the consumption of one charge, in 1/10000, at the times of its measurements. All integers.

    It uses the least charge so far: a charge that rises slightly at times, as an estimate by voltage does when the load
    falls, is drained nevertheless. The last result is reported until a new one is known or the charge stands: after a
    jump, and after reports without a charge.
    """

    def __init__(self) -> None:
        self._changes: deque[tuple[int, int]] = deque()  # when the charge reached each value
        self._least: tuple[int, int] | None = None  # the least charge, and since when
        self._at_us = self._between_us = 0
        self._measured: int | None = None
        #: the start of the measurement, once a result is known
        self.since_us = 0

    def take(self, charge: int | None, at_us: int) -> int | None:
        """Take in a report of the charge, None if unknown; return the consumption of a minute, if known."""
        if charge is None:
            return None
        least, before_us = self._least, self._at_us
        self._at_us = at_us = max(at_us, before_us) if least is not None else at_us  # a report may come late
        changes = self._changes
        if least is None:
            self._least = at_us, charge
        elif charge < least[1] or charge > least[1] + RISE:
            if charge > least[1] or self._is_jump(least, charge, before_us):
                changes.clear()
            else:
                changes.append((at_us, charge))
            self._least = at_us, charge
        while len(changes) > LEAST_CHANGES and at_us - changes[0][0] > WINDOW_US:
            changes.popleft()
        self._look_whether_it_stands(at_us)
        if len(changes) >= LEAST_CHANGES:
            self._measured, self.since_us = self._rate(at_us), changes[0][0]
        return self._measured

    def _is_jump(self, least: tuple[int, int], charge: int, before_us: int) -> bool:
        """Whether it fell by more than any consumption since the last report, and by more than one step since the last
        change.
        """
        fell = least[1] - charge
        in_steps = min(STEP, JUMP_RATE * (self._at_us - least[0]) // SECOND)
        return fell > max(JUMP + JUMP_RATE * (self._at_us - before_us) // SECOND, in_steps)

    def _look_whether_it_stands(self, now_us: int) -> None:
        """Drop the result once the charge stands."""
        changes = self._changes
        if len(changes) > 1:
            self._between_us = (changes[-1][0] - changes[0][0]) // (len(changes) - 1)
        if self._least is None or now_us - self._least[0] <= max(WINDOW_US, _STANDS * self._between_us):
            return
        if len(changes) > 1:
            changes.clear()
        self._measured = None

    def _rate(self, now_us: int) -> int:
        """From the first change to the last, or to now with one more, whichever is less. Rounded up."""
        (first_us, before), (last_us, after) = self._changes[0], self._changes[-1]
        taken = before - after
        mean = -(-taken // (len(self._changes) - 1))
        rate = _in_a_minute(taken, last_us - first_us)
        return min(rate, _in_a_minute(taken + mean, now_us - first_us))


class PaceMeter:
    """The speed over ground of steady level flight. All integers."""

    def __init__(self) -> None:
        self._flown: deque[tuple[int, int, int]] = deque(maxlen=_LOOKS)  # when, for how long, how far
        self._last: tuple[int, int, int, int] | None = None
        self._speed: int | None = None

    def move(self, x: int | None, y: int | None, height: int | None, at_us: int) -> None:
        """Take in a position in mm; None if unknown."""
        last = self._last
        if x is None or y is None or height is None:
            self._last = self._speed = None
            return
        gap_us = _LOOK_US if last is None else at_us - last[0]
        if gap_us < _LOOK_US:
            return
        self._last = at_us, x, y, height
        if last is None or gap_us > _GAP_US:
            self._speed = None
            return
        way, before = isqrt((x - last[1]) ** 2 + (y - last[2]) ** 2), self._speed
        self._speed = speed = way * SECOND // gap_us
        steady = before is not None and abs(speed - before) <= _STEADY
        if steady and speed >= _LEAST_SPEED and abs(height - last[3]) * SECOND <= _STEADY * gap_us:
            self._flown.append((last[0], gap_us, way))

    def flown(self, since_us: int) -> tuple[int, int]:
        """The duration and distance of such flight since a time, in us and mm; (0, 1) where too little."""
        time_us = way = 0
        for began_us, lasted_us, far in reversed(self._flown):
            if began_us < since_us:
                break
            time_us, way = time_us + lasted_us, way + far
        return (time_us, way) if time_us >= LEAST_STEADY_US else (0, 1)


class Consumption:
    """The measured consumption of a policy's vehicle, compared with the declared one. All integers."""

    def __init__(self, vehicle: VehicleLimits) -> None:
        self._vehicle, self._asked = vehicle, 0
        self._drain, self._pace = DrainMeter(), PaceMeter()
        self._told = 0
        #: the highest measured consumption of a minute, 1/10000; 0: none
        self.in_a_minute = 0
        #: the measured and the declared consumption of a km over ground at the same speed, 1/10000, where their ratio
        #: was highest
        self.for_a_km = 0, 1
        #: notes for the operator, to be taken from here
        self.notes: list[str] = []

    def fly(self, speed: int) -> None:
        """Note a command with a speed in mm/s, 0 for none. The slowest counts, as for the way home (`home_us`)."""
        self._asked = slower(self._asked, speed)

    def move(self, x: int | None, y: int | None, height: int | None, at_us: int) -> None:
        """Take in the vehicle's position in mm; None if unknown."""
        self._pace.move(x, y, height, at_us)

    def take(self, charge: int | None, at_us: int) -> int | None:
        """Take in a report of the charge; return the consumption of a minute of the way home, None without a
        measurement.
        """
        drain = self._drain.take(charge, at_us)
        if drain is None:
            return None
        self.in_a_minute = max(self.in_a_minute, drain)
        time_us, way = self._pace.flown(self._drain.since_us)
        pace = _pace(self._vehicle, self._asked)
        per_km = min(-(-drain * KM * time_us // (MINUTE * way)), MOST_DRAIN)
        says = for_a_km(self._vehicle, pace)
        if per_km * self.for_a_km[1] > self.for_a_km[0] * says:
            self.for_a_km = per_km, says
        of_the_way = min(-(-drain * pace * time_us // (SECOND * way)), MOST_DRAIN)
        if of_the_way > drain:
            self._tell(of_the_way, f"{percent(per_km)} of its charge for a km over ground", percent(says))
        else:
            self._tell(drain, f"{percent(drain)} of its charge a minute", percent(drained(self._vehicle)))
        return max(drain, of_the_way)

    @property
    def summary(self) -> tuple[str, ...]:
        """The declared and the highest measured values, in words; empty without a measurement."""
        minute, (km, km_declared) = self.in_a_minute, self.for_a_km
        told = (minute, drained(self._vehicle), "a minute"), (km, km_declared, "a km")
        return tuple(
            f"{percent(says)} {each} declared, {percent(found)} measured" for found, says, each in told if found
        )

    def _tell(self, drain: int, gives: str, declared: str) -> None:
        if drain * 10 <= max(self._told, drained(self._vehicle)) * 11:
            return
        self._told = drain
        self.notes.append(
            f"the battery loses {gives}, more than the {declared} that the policy declares as the worst case: the way "
            "home is computed with the measured value"
        )


def drained(vehicle: VehicleLimits) -> int:
    """The declared worst consumption of a minute, in 1/10000 of a full charge, rounded."""
    flight_us = vehicle.endurance_us if vehicle.speeds is None else vehicle.speeds.flight_us
    return (MINUTE * FULL + flight_us // 2) // flight_us


def for_a_km(vehicle: VehicleLimits, pace: int) -> int:
    """The declared worst consumption of a km over ground at a speed in mm/s, in 1/10000, rounded up."""
    flight_us = vehicle.endurance_us if vehicle.speeds is None else vehicle.speeds.flight_us
    return -(-FULL * KM * SECOND // (flight_us * pace))


def percent(part: int) -> str:
    """A part of a full charge, in 1/10000, as text."""
    return f"{part / 100:.1f} %"


def _pace(vehicle: VehicleLimits, asked: int) -> int:
    """The declared speed over ground for the present command, but no more than that of the way home, mm/s."""
    speeds = vehicle.speeds
    return vehicle.speed if speeds is None else over_ground(speeds, min(asked or speeds.cruise, speeds.homeward))


def _in_a_minute(taken: int, us: int) -> int:
    return MOST_DRAIN if us <= 0 else min(-(-taken * MINUTE // us), MOST_DRAIN)
