"""What flying takes of the battery, as measured: the signal `battery.drain`, what a minute of the way home takes of it.

By time: autopilots report their charge in whole percent. So it is timed from one change to another within a window:
between the changes each percent is known to have been taken. While the next change is still to come, no more than one
is counted on top of those that came, so a vehicle that takes less than before is believed soon. The window is a minute,
and as wide as it takes for a drain that is slow.

By distance: where the vehicle gets on slower over ground than is declared, against more wind, each metre takes more
charge than is counted, though a minute does not. The way home is counted as time, so a minute of it then takes as many
times as much.
"""

from collections import deque
from math import isqrt
from typing import Final

from rtshcua.decision.flying import MINUTE, MOST_DRAIN, SECOND, over_ground, slower
from rtshcua.model.flat.limits import FULL
from rtshcua.model.flat.policy import VehicleLimits

#: What is looked back on, us, and how many changes tell something: the two stretches between three.
WINDOW_US: Final = 60 * SECOND
LEAST_CHANGES: Final = 3
#: A charge that stands for so many times as long as it took between the last changes is drained no more.
_STANDS: Final = 2
#: More than this at once, 1/10000, and so much in a second besides, is a finding about the battery and no drain: what
#: was measured before counts no more. Some autopilots report their charge in steps of 5 or 10 %.
JUMP: Final = 500
JUMP_RATE: Final = 200
STEP: Final = 1_000
#: A charge that rises by more, 1/10000, is another one.
RISE: Final = 300

#: A place is looked at so often, us, and tells nothing after more.
_LOOK_US: Final = SECOND
_GAP_US: Final = 3 * SECOND
#: mm/s: flight over ground that counts is this fast, and changes by no more in a second, along it or in height:
#: setting off, arriving and climbing are counted apart
_LEAST_SPEED: Final = 1_000
_STEADY: Final = 500
#: us of such flight that tell something, and how many looks are kept
LEAST_STEADY_US: Final = 10 * SECOND
_LOOKS: Final = 600

KM: Final = 1_000_000  # mm


class DrainMeter:
    """Measures one charge, 1/10000, by the times at which it was measured itself. All integers.

    It goes by the least charge that was reported: one that rises a little now and then, as an estimate by voltage does
    where the load falls, is drained all the same. What was measured last is told until a new drain is known or the
    charge stands: after a jump, and after reports without a charge.
    """

    def __init__(self) -> None:
        self._changes: deque[tuple[int, int]] = deque()  # when it came to be so much
        self._least: tuple[int, int] | None = None  # since when, and how much
        self._at_us = self._between_us = 0
        self._measured: int | None = None
        #: from when on what was taken tells of the drain, once it is known
        self.since_us = 0

    def take(self, charge: int | None, at_us: int) -> int | None:
        """One report of the charge, None where it is not known; what is taken in a minute, if that is known yet."""
        if charge is None:
            return None
        least, before_us = self._least, self._at_us
        self._at_us = at_us = max(at_us, before_us) if least is not None else at_us  # it may come late
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
        """Whether it fell by more than any drain takes since the last report, and by more than one step since the last
        change.
        """
        fell = least[1] - charge
        in_steps = min(STEP, JUMP_RATE * (self._at_us - least[0]) // SECOND)
        return fell > max(JUMP + JUMP_RATE * (self._at_us - before_us) // SECOND, in_steps)

    def _look_whether_it_stands(self, now_us: int) -> None:
        """Nothing is told of a drain that was, and is no more."""
        changes = self._changes
        if len(changes) > 1:
            self._between_us = (changes[-1][0] - changes[0][0]) // (len(changes) - 1)
        if self._least is None or now_us - self._least[0] <= max(WINDOW_US, _STANDS * self._between_us):
            return
        if len(changes) > 1:
            changes.clear()
        self._measured = None

    def _rate(self, now_us: int) -> int:
        """From the first change to the last, or to now with one more: whichever is less. Rounded up."""
        (first_us, before), (last_us, after) = self._changes[0], self._changes[-1]
        taken = before - after
        mean = -(-taken // (len(self._changes) - 1))
        rate = _in_a_minute(taken, last_us - first_us)
        return min(rate, _in_a_minute(taken + mean, now_us - first_us))


class PaceMeter:
    """How fast steady level flight gets on over ground. All integers."""

    def __init__(self) -> None:
        self._flown: deque[tuple[int, int, int]] = deque(maxlen=_LOOKS)  # since when, for how long, how far
        self._last: tuple[int, int, int, int] | None = None
        self._speed: int | None = None

    def move(self, x: int | None, y: int | None, height: int | None, at_us: int) -> None:
        """Where it was at a time, mm; None is not known."""
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
        """For how long it flew so since a time, and how far, us and mm; (0, 1) where that is too little to tell."""
        time_us = way = 0
        for began_us, lasted_us, far in reversed(self._flown):
            if began_us < since_us:
                break
            time_us, way = time_us + lasted_us, way + far
        return (time_us, way) if time_us >= LEAST_STEADY_US else (0, 1)


class Consumption:
    """What flying takes of the charge of a policy's vehicle, beside what it declares. All integers."""

    def __init__(self, vehicle: VehicleLimits) -> None:
        self._vehicle, self._asked = vehicle, 0
        self._drain, self._pace = DrainMeter(), PaceMeter()
        self._told = 0
        #: the most that was measured so far to be taken in a minute, 1/10000; 0: nothing was
        self.in_a_minute = 0
        #: what was measured to be taken for a km over ground, and what was declared for it at the same speed, when the
        #: one was the most beside the other, 1/10000
        self.for_a_km = 0, 1
        #: what an operator should know, to be taken
        self.notes: list[str] = []

    def fly(self, speed: int) -> None:
        """A command that asks for a speed, mm/s, 0 for none. The slowest counts, as for the way home (`home_us`)."""
        self._asked = slower(self._asked, speed)

    def move(self, x: int | None, y: int | None, height: int | None, at_us: int) -> None:
        """Where the vehicle was at a time, mm; None is not known."""
        self._pace.move(x, y, height, at_us)

    def take(self, charge: int | None, at_us: int) -> int | None:
        """One report of the charge; what a minute of the way home takes, None where nothing was measured yet."""
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
        """What was declared and what was measured at the worst, in words; nothing where nothing was measured."""
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
    """What the vehicle of a policy takes of a full charge in a minute, as declared at the worst, 1/10000, rounded."""
    flight_us = vehicle.endurance_us if vehicle.speeds is None else vehicle.speeds.flight_us
    return (MINUTE * FULL + flight_us // 2) // flight_us


def for_a_km(vehicle: VehicleLimits, pace: int) -> int:
    """What it takes for a km over ground at a speed, mm/s, as declared at the worst, 1/10000, rounded up."""
    flight_us = vehicle.endurance_us if vehicle.speeds is None else vehicle.speeds.flight_us
    return -(-FULL * KM * SECOND // (flight_us * pace))


def percent(part: int) -> str:
    """A part of a full charge, 1/10000, in words."""
    return f"{part / 100:.1f} %"


def _pace(vehicle: VehicleLimits, asked: int) -> int:
    """The speed over ground that is declared for what is flown, and no more than that of the way home, mm/s."""
    speeds = vehicle.speeds
    return vehicle.speed if speeds is None else over_ground(speeds, min(asked or speeds.cruise, speeds.homeward))


def _in_a_minute(taken: int, us: int) -> int:
    return MOST_DRAIN if us <= 0 else min(-(-taken * MINUTE // us), MOST_DRAIN)
