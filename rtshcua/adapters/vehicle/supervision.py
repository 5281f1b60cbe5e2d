"""Supervise a vehicle in flight: whether it makes progress, whether it stops, whether somebody else flies it, whether
it crashed. A mode report or an acknowledgement proves nothing; only observed motion does.
"""

from collections import deque
from dataclasses import dataclass
from typing import Final, NamedTuple

from rtshcua.adapters.vehicle.effects import STILL, apart, still
from rtshcua.adapters.vehicle.flavour import KEPT, KEPT_LEVEL, ExpectedProgress, ExpectedTarget
from rtshcua.adapters.vehicle.observed import ABOVE, FALLS, STALE_US, STOPPED, ObservedVehicle, Placed, Reported
from rtshcua.model.flat.policy import VehicleLimits

NEVER: Final = (1 << 63) - 1  # us
#: a mode shows within this many heartbeats after it took effect
MODE_BEATS: Final = 2

#: mm by which a measure must fall to count as progress
LEAST: Final = 1_000


class StageProgress:
    """The progress of one stage."""

    def __init__(self, expected: ExpectedProgress) -> None:
        self._expected = expected
        self._best: tuple[int, ...] | None = None
        self._since_us: int | None = None
        self._began_us: int | None = None
        #: whether there was any progress yet
        self.shown = False

    @property
    def due_us(self) -> int:
        """When the stage will count as stalled, in link time, without a further observation."""
        return NEVER if self._since_us is None else self._since_us + self._expected.within_us

    def has_stalled(self, seen: ObservedVehicle) -> bool:
        """Whether no measure has fallen for too long. Time in which a measure was unknown does not count."""
        left = self._expected.measure(seen)
        if left is None or self._best is None or self._since_us is None:
            self._best, self._since_us = left, None if left is None else seen.up_us
            self._began_us = seen.up_us if self._began_us is None else self._began_us
            return False
        if self._has_come_further(self._best, left):
            self._best, self._since_us, self.shown = left, seen.up_us, True
            return False
        at_first = not self.shown and seen.up_us - (self._began_us or 0) <= self._expected.within_us
        if at_first and self._has_come_further(left, self._best):
            self._best, self._since_us = left, seen.up_us  # it may have to turn round first
        return seen.up_us - self._since_us > self._expected.within_us

    def _has_come_further(self, best: tuple[int, ...], left: tuple[int, ...]) -> bool:
        either_way = self._expected.either_way
        for before, now in zip(best, left, strict=True):
            if before - now >= LEAST or (either_way and now - before >= LEAST):
                return True
        return False


# ---------------------------------------------------------------- stopping

#: us of link time between an obeyed stop command and the time by which its effect must show, for filters, reports and
#: gusts. PX4 1.16 needs it: from 4.5 m/s it is below 0.4 m/s only after 3.6 to 4.6 s.
LAG_US: Final = 2_000_000
#: assumed braking of a vehicle that declares none: mm/s^2, and us before it begins
UNDECLARED_BRAKING: Final = 1_000
UNDECLARED_REACTION_US: Final = 1_000_000
_SECOND: Final = 1_000_000


@dataclass(frozen=True, slots=True)
class Brakes:
    """How a vehicle brakes according to its policy (`brakes from 12 m/s in 6 s after 500 ms`): mm/s^2 and us."""

    braking: int
    reaction_us: int

    @classmethod
    def of(cls, vehicle: VehicleLimits) -> "Brakes":
        """The declared values of a signed vehicle, or a cautious assumption without them."""
        if not vehicle.braking:
            return cls(UNDECLARED_BRAKING, UNDECLARED_REACTION_US)
        return cls(vehicle.braking, vehicle.reaction_us)

    def fastest(self, speed: int, passed_us: int) -> int:
        """The highest permitted speed in mm/s, this long after a stop command at `speed`."""
        falling_us = max(passed_us - self.reaction_us - LAG_US, 0)
        return max(speed - self.braking * falling_us // _SECOND, STILL)

    def stands_us(self, speed: int) -> int:
        """The time by which a vehicle must stand still after a stop command at `speed`."""
        return self.reaction_us + speed * _SECOND // self.braking + 2 * LAG_US


class BrakingWatch:
    """Supervises a vehicle after a stop command, from the speed that it had then."""

    def __init__(self, brakes: Brakes, seen: ObservedVehicle) -> None:
        self._brakes = brakes
        self._speed = seen.speed
        self._since_us: int | None = None

    @property
    def due_us(self) -> int:
        """The link time from which it may be found too fast; never before it was seen to obey."""
        return NEVER if self._since_us is None else self._since_us + self._brakes.reaction_us + LAG_US

    def has_failed(self, seen: ObservedVehicle, *, obeyed: bool) -> bool:
        """Whether it is faster than permitted by now, or moves when it must stand still. `obeyed`: the command was
        acknowledged, or its mode shows.

        The initial speed is the highest one until the effect must show. A speed counts at the time of its measurement.
        A speed that has been unknown for as long as a report may be old counts as not reduced.
        """
        if self._since_us is None and obeyed:
            self._since_us = seen.up_us
        at_us = seen.up_us if seen.speed is None else seen.speed_us
        if self._since_us is None or at_us - self._since_us <= self._brakes.reaction_us + LAG_US:
            if seen.speed is not None:  # the stop command may have come while it still accelerated
                self._speed = max(self._speed or 0, seen.speed)
            return False
        passed_us, speed = at_us - self._since_us, self._speed or 0
        stands = passed_us > self._brakes.stands_us(speed)
        if seen.speed is None:
            return stands and seen.up_us - seen.speed_us > STALE_US
        return seen.speed > (STILL if stands else self._brakes.fastest(speed, passed_us) + STILL)


# ---------------------------------------------------------------- targets of others

#: us of link time: until our target shows, a reported target may be older than our frame.
SETTLES_US: Final = 1_500_000
_REMEMBERED: Final = 4


class TargetWatch:
    """Compares the target that the autopilot reports with those that we commanded, over all manoeuvres of a vehicle.

    A ground station can take over without a change of mode: by PX4's pause and go-to, by ArduCopter's guided targets.
    The autopilot then reports a target that is not ours (POSITION_TARGET_GLOBAL_INT). PX4 reports one whenever it has
    one, ArduCopter only in GUIDED.
    """

    def __init__(self) -> None:
        self._ours: deque[ExpectedTarget] = deque(maxlen=_REMEMBERED)
        self._expected: ExpectedTarget | None = None
        self._prior: Reported | None = None
        self._settled_us = 0
        self._given: ExpectedTarget | None = None  # the present target as commanded, before the vehicle reported it
        self._more = 0  # how many other targets it may report, because the command was repeated
        self._left: Reported | None = None  # its target before a command without a target
        self._strayed: int | None = None  # the count of heartbeats when it left for another target
        #: whether the autopilot was seen to fly to the present target
        self.shown = False
        self._shown: Reported | None = None  # and the last report of that target

    @property
    def compares(self) -> bool:
        """Whether there is a target of ours whose report is worth waiting for."""
        return self._expected is not None and self._expected.told

    @property
    def named(self) -> ExpectedTarget | None:
        """The present target as the vehicle reported it; None before it did."""
        return self._expected if self.shown else None

    def expect(self, target: ExpectedTarget | None, seen: ObservedVehicle) -> None:
        """Set the expected target; None: nothing to compare.

        Where the vehicle flew to a target of its own, that one may be reported for a while longer. Where it flew to one
        of ours, any other target is somebody else's, even if it is reported only after our next frame left.
        """
        settles_us = 0 if self.shown else SETTLES_US
        if target is not None:
            self._left = self._strayed = None
        elif self._left is None and (self.shown or seen.target == self._prior):
            self._left = seen.target
        self._expected, self.shown = target, False
        self._given, self._more = target, 0
        self._prior, self._settled_us = seen.target, seen.up_us + settles_us
        if target is not None:
            self._ours.append(target)

    def due_us(self, up_us: int) -> int:
        """The link time from which a report from before our frame would count as somebody else's, if in the future."""
        return NEVER if self._expected is None or up_us >= self._settled_us else self._settled_us

    def told_again(self) -> None:
        """Note that the present target was sent again: after each stop command it stops somewhere else."""
        self._more += 1

    def is_foreign(self, seen: ObservedVehicle) -> bool:
        """Whether it flies to somebody else's target."""
        expected, reported = self._expected, seen.target
        if reported is None or (self.shown and reported == self._shown):
            return False
        if expected is None:
            return self._has_strayed(reported, seen.beats)
        if reported == self._prior and not self.shown:
            return False  # not obeyed yet; if it never is, there is no progress
        if not self.shown and not expected.is_given(reported) and self._is_late(reported):
            return False  # the place may be where a stop ends
        if expected.matches(reported):
            self._show(expected, reported)
            return False
        if self.shown and self._more and self._given is not None and self._given.matches(reported):
            self._more, self.shown = self._more - 1, False
            self._show(self._given, reported)
            return False
        if self.shown:
            return True
        if any(ours.matches(reported) for ours in self._ours if ours is not expected):
            return False  # not obeyed yet
        return seen.up_us >= self._settled_us

    def obeyed(self) -> None:
        """Note that the mode of the present command shows: a command without a target flies where the autopilot
        decides.
        """
        if self._expected is None:
            self._left = None

    def _has_strayed(self, reported: Reported, beats: int) -> bool:
        """Whether it left for another target before the mode of our command, which has no target, showed. If our
        command is the reason, its mode shows within two heartbeats.
        """
        if self._left is None or _same(self._left, reported) or self._is_late(reported):
            self._strayed = None
            return False
        if self._strayed is None:
            self._strayed = beats
        return beats - self._strayed >= MODE_BEATS

    def _is_late(self, reported: Reported) -> bool:
        """Whether this is the target of an earlier command that was still on its way when the present one left."""
        return any(ours.is_given(reported) for ours in self._ours if ours is not self._expected)

    def _show(self, expected: ExpectedTarget, reported: Reported) -> None:
        if not self.shown:  # from now on this is the target
            self._ours[-1] = self._expected = expected.as_reported(reported)
        self.shown, self._shown = True, reported


def _same(one: Reported, other: Reported) -> bool:
    return abs(one[2] - other[2]) <= KEPT_LEVEL and apart(*one[:2], *other[:2]) <= KEPT


#: A target that was not reported for this long is requested; it is streamed at twice that rate.
UNNAMED_US: Final = 150_000
#: An answer would have come within this time after the last one, or the one before;
NAMED_WITHIN_US: Final = 100_000
#: and after this long, unless a frame was lost meanwhile, the request is repeated.
ASKED_ANEW_US: Final = 400_000
#: Heartbeats in a row without a target: on a link that loses more than half of all frames, one in 10**7 such rows is
#: chance.
MANY_BEATS: Final = 25


class NamedTargetWatch:
    """Detects that an autopilot which repeats its target stopped doing so, for example because somebody commands a
    velocity.

    Missing reports alone prove nothing, because frames are lost. The target counts as gone when the autopilot was
    asked, answered, and the numbers of its frames show that none was lost.
    """

    def __init__(self, slack: int = 1) -> None:
        self._slack = slack
        self._targets = -1
        self._beats = 0  # the count of heartbeats at the last report of a target
        # when it was asked, and the counts of missing, answered and received frames then
        self._asked: tuple[int, int, int, int] | None = None
        self._answered: tuple[int, int] | None = None  # when the last answer came, and the count of answers
        #: the target is to be requested now
        self.asks = False

    def is_gone(self, seen: ObservedVehicle, now_us: int, asked: int) -> bool:
        """Whether it no longer reports a target; `asked` is the number of requests so far."""
        if seen.targets != self._targets or now_us - seen.target_us <= UNNAMED_US * self._slack:
            self._targets, self._beats, self._asked, self.asks = seen.targets, seen.beats, None, False
            return False
        if seen.beats - self._beats >= MANY_BEATS:
            return True
        missing, asked_us = seen.numbered - seen.heard, now_us if self._asked is None else self._asked[0]
        is_lost = self._asked is not None and missing > self._asked[1]
        again_us = (NAMED_WITHIN_US if is_lost else ASKED_ANEW_US) * self._slack
        if self._asked is None or now_us - asked_us >= again_us:
            self._asked, self._answered = (now_us, missing, seen.answers - asked, seen.beats), None
            self.asks = True
            return False
        if is_lost:
            return False
        if seen.answers - asked < self._asked[2] or seen.beats == self._asked[3] or self.asks:
            return False  # a request is still unanswered
        if self._answered is None or self._answered[1] != seen.answers:
            self._answered = now_us, seen.answers
        return now_us - self._answered[0] >= NAMED_WITHIN_US * self._slack


#: us of link time that a vehicle must stand after moving before this counts as a pause;
STANDS_US: Final = 1_500_000
#: mm/s: the speed at which it counts as having moved,
MOVED: Final = 1_500
#: us of link time that it must fly sideways in a climb without rising;
ASIDE_US: Final = 2_500_000
#: mm: it must be this far from its target, where it would not slow down by itself;
FAR: Final = 10_000
#: mm: or from the height of its climb;
FAR_BELOW: Final = 2_000
#: degrees: with more tilt it may be fighting the wind;
LEANS: Final = 15
#: mm, us: an obstacle this near ahead may be why it stands
BLOCKED: Final = 10_000
BLOCKED_US: Final = 2_000_000


class PauseWatch:
    """Detects that somebody stopped a vehicle on its way, without changing mode or target. After ArduCopter's
    DO_PAUSE_CONTINUE it stops within 3 s from 5.6 m/s (recorded).

    Other causes are excluded: wind shows as tilt, an obstacle is reported ahead, near the target it stops anyway, and
    without a position nothing is known. In a `climb` no target is reported, so somebody else's velocity shows as
    sideways motion without a rise. A climb that stops is no evidence by itself: weight, weak motors or a fence above
    have the same effect.
    """

    def __init__(self, *, climb: bool = False) -> None:
        self._far, self._climb = FAR_BELOW if climb else FAR, climb
        self._moved = False
        self._since_us: int | None = None
        self._aside_us: int | None = None  # since when it has moved sideways in a climb without rising

    @property
    def due_us(self) -> int:
        """When it will have stood for long enough, in link time, without a further observation."""
        return NEVER if self._since_us is None else self._since_us + STANDS_US

    def is_paused(
        self, seen: ObservedVehicle, left: tuple[int, ...] | None, now_us: int, *, granted: bool = False
    ) -> bool:
        """Whether it has been standing since it moved; `left` is the distance to its target. `granted`: the vehicle
        accepted somebody else's command.
        """
        self._moved = self._moved or (seen.speed is not None and seen.speed >= MOVED)
        idle = stands_idly(seen, left, now_us, self._far, climb=self._climb)
        if self._climb:
            level = stands_idly(seen, left, now_us, 0, climb=True)
            if not level or still(seen):
                self._aside_us = None
            elif self._aside_us is None:
                self._aside_us = seen.speed_us
            if idle and self.flies_aside(seen):
                return True
            idle = idle and granted
        if not self._moved or not idle:
            self._since_us = None
            return False
        if self._since_us is None:
            self._since_us = seen.speed_us
        return seen.speed_us - self._since_us >= STANDS_US

    def flies_aside(self, seen: ObservedVehicle) -> bool:
        """Whether it has moved sideways in its climb for long without rising: no climb of ours does that."""
        return self._aside_us is not None and seen.speed_us - self._aside_us >= ASIDE_US


def stands_idly(
    seen: ObservedVehicle, left: tuple[int, ...] | None, now_us: int, far: int = FAR, *, climb: bool = False
) -> bool:
    """Whether it stands still far from its target (in a `climb`: its height) without an observed cause."""
    if left is None or min(left) < far or not (_is_level(seen) if climb else still(seen)):
        return False
    blocked = seen.ahead is not None and seen.ahead < BLOCKED and now_us - seen.ahead_us <= BLOCKED_US
    return seen.tilt < LEANS and not blocked


def _is_level(seen: ObservedVehicle) -> bool:
    return seen.airborne and seen.speed is not None and abs(seen.descent) <= STOPPED


#: us of link time that a leg must be flown steadily at less than `SLOWER` % of the commanded speed
SLOW_US: Final = 4_000_000
SLOWER: Final = 60
#: mm/s: the largest variation of a steady speed
STEADY: Final = 600


class SpeedWatch:
    """Detects that a leg is flown steadily slower than commanded: somebody set another speed (DO_CHANGE_SPEED)."""

    def __init__(self, told: int) -> None:
        self._told = told
        self._since_us: int | None = None
        self._low = self._high = 0
        #: the actual speed in mm/s, once known
        self.slow: int | None = None

    def look(self, seen: ObservedVehicle, left: tuple[int, ...] | None) -> bool:
        """Take in an observation; return whether it is found to be slow now for the first time."""
        speed = seen.speed
        if not self._told or self.slow is not None:
            return False
        steadily = speed is not None and max(self._high, speed) - min(self._low, speed) <= STEADY
        slow = speed is not None and not still(seen) and 100 * speed < SLOWER * self._told
        if speed is None or not slow or left is None or min(left) < FAR or seen.tilt >= LEANS:
            self._since_us = None
            return False
        if self._since_us is None or not steadily:
            self._since_us, self._low, self._high = seen.speed_us, speed, speed
            return False
        self._low, self._high = min(self._low, speed), max(self._high, speed)
        if seen.speed_us - self._since_us < SLOW_US:
            return False
        self.slow = speed
        return True


# ---------------------------------------------------------------- crashes

#: us: observations are judged together within this time (height, flight, stopped motors). Between observations further
#: apart it may have landed.
RECENT_US: Final = 2_000_000
#: us: a tilt counts as a crash once it was reported for at least this long; one report is not enough
LASTS_US: Final = 400_000
#: us: motors cannot stop a fall (`FALLS`) to standing (`STOPPED`) within this time between two speed reports.
AT_ONCE_US: Final = 400_000
#: us from there until it reports that it is on the ground or that its motors are off
LIES_WITHIN_US: Final = 10_000_000
#: degrees: autopilots tilt by at most 45 themselves
TILTED: Final = 60

_POSITION: Final = "GLOBAL_POSITION_INT"


class _Off(NamedTuple):
    """The first heartbeat with motors off: its place in the order of sending, the vehicle's position then, by when they
    were off, and whether that time is by the vehicle's clock.
    """

    place: int
    placed: Placed | None
    by_us: int
    settled: bool


class CrashWatch:
    """Distinguishes a crash from a landing, once in a flight: by the motors, by a fall or by the attitude.

    A vehicle on the ground with its motors off reports ON_GROUND however it got there. All times are the vehicle's, on
    our clock (`source_time`): after a stall or a silence, reports that waited arrive all at once, and only their own
    times tell which belong together. The time of a report without a stamp is at least that of the last stamp before it,
    and at most that of the next one, or its arrival. The first bound decides whether a report is recent, the second
    whether an event came soon.
    """

    def __init__(self) -> None:
        self._flown = False
        self._told = False
        self.forget()

    def forget(self) -> None:
        """Forget all times: the vehicle's clock was set."""
        # when it was last seen to fly, its height, and whether it was landing
        self._flew: tuple[int, int, bool] | None = None
        self._off: _Off | None = None
        self._tilted: tuple[int, int] | None = None  # since when it is tilted, and when it was last seen tilted
        self._fell: tuple[int, int] | None = None  # when, and how fast it came down
        self._impact: tuple[int, int] | None = None

    def look(self, seen: ObservedVehicle, name: str, now_us: int) -> str | None:
        """Evidence of a crash, after a message of this name; None otherwise, and once it was reported."""
        flies = seen.armed and seen.airborne
        if flies:
            self._flown = True
        if not self._flown or self._told:
            return None
        how = None
        if name == _POSITION:
            how = self._place(seen, flies=flies)
        elif name == "HEARTBEAT":
            how = self._motors(seen, now_us)
        if how is None and (seen.tilt >= TILTED or self._tilted is not None):
            how = self._attitude(seen)
        self._told = how is not None
        return how

    def _place(self, seen: ObservedVehicle, *, flies: bool) -> str | None:
        placed = seen.placed
        if placed is None:
            return None
        at_us, height, descent = placed
        off = self._off
        if off is None:
            if flies and height is not None and _says_air(seen, at_us):
                self._flew = at_us, height, seen.landing
        elif not off.settled and placed is not off.placed and seen.places[_POSITION] > off.place:
            self._off = off._replace(by_us=min(off.by_us, at_us), settled=True)
            how = self._stopped(seen)
            if how is not None:
                return how
        if descent >= FALLS or self._fell is not None or self._impact is not None:
            return self._fall(at_us, descent, flies=flies)
        return None

    def _motors(self, seen: ObservedVehicle, now_us: int) -> str | None:
        if seen.armed and not seen.disarms:
            self._off = None
            return None
        if self._off is None:
            self._off = _Off(seen.places["HEARTBEAT"], seen.placed, now_us, settled=False)
        return self._stopped(seen)

    def _stopped(self, seen: ObservedVehicle) -> str | None:
        """Evidence by stopped motors. Autopilots call a disarmed vehicle landed: what counts is how it flew just
        before.
        """
        off, flew = self._off, self._flew
        if seen.armed or off is None or flew is None:
            return None
        if off.by_us - flew[0] > RECENT_US or flew[1] < ABOVE or flew[2]:
            return None
        return f"the motors stopped {flew[1] // 1_000} m above home"

    def _attitude(self, seen: ObservedVehicle) -> str | None:
        if seen.tilt < TILTED or not (seen.armed or seen.airborne):
            self._tilted = None
            return None
        at_us = seen.tilt_us
        since_us, last_us = self._tilted or (at_us, at_us)
        if at_us - last_us > RECENT_US:
            since_us = at_us
        self._tilted = since_us, at_us
        # after a landing it may lie on its side, and be carried
        stands = _says_air(seen, at_us) or (seen.armed and not seen.disarms and _is_recent(seen, "HEARTBEAT", at_us))
        return f"the vehicle is tilted by {seen.tilt} degrees" if stands and at_us - since_us >= LASTS_US else None

    def _fall(self, at_us: int, descent: int, *, flies: bool) -> str | None:
        if descent >= FALLS:
            self._fell, self._impact = (at_us, descent), None
        elif self._fell is not None:
            # an estimator takes some reports to settle on standing still
            if at_us - self._fell[0] > AT_ONCE_US:
                self._fell = None
            elif abs(descent) <= STOPPED:
                self._impact, self._fell = self._fell, None
        if self._impact is None:
            return None
        if at_us - self._impact[0] > LIES_WITHIN_US:
            self._impact = None
            return None
        return None if flies else f"the vehicle came down at {self._impact[1] / 1_000:.1f} m/s"


def _says_air(seen: ObservedVehicle, at_us: int) -> bool:
    """Whether it reported shortly before that it is in the air."""
    return seen.airborne and _is_recent(seen, "EXTENDED_SYS_STATE" if seen.landed_state else "HEARTBEAT", at_us)


def _is_recent(seen: ObservedVehicle, name: str, at_us: int) -> bool:
    """Whether a message of this name was made at most `RECENT_US` before; False if unknown."""
    made_us = seen.made_us.get(name)
    return made_us is not None and at_us - made_us <= RECENT_US
