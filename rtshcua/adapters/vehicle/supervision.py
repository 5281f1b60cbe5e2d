"""What is watched while something flies: whether it gets anywhere, whether it stops, whether somebody else flies it,
whether it crashed. A mode report or an acknowledgement proves nothing, only what is seen does.
"""

from collections import deque
from dataclasses import dataclass
from typing import Final, NamedTuple

from rtshcua.adapters.vehicle.effects import STILL, apart, still
from rtshcua.adapters.vehicle.flavour import KEPT, KEPT_LEVEL, ExpectedProgress, ExpectedTarget
from rtshcua.adapters.vehicle.observed import ABOVE, FALLS, STALE_US, STOPPED, ObservedVehicle, Placed, Reported
from rtshcua.model.flat.policy import VehicleLimits

NEVER: Final = (1 << 63) - 1  # us
#: so many heartbeats after a mode took effect it shows
MODE_BEATS: Final = 2

#: mm by which some measure must fall for it to count as progress
LEAST: Final = 1_000


class StageProgress:
    """Follows one stage."""

    def __init__(self, expected: ExpectedProgress) -> None:
        self._expected = expected
        self._best: tuple[int, ...] | None = None
        self._since_us: int | None = None
        self._began_us: int | None = None
        #: whether there was any progress yet
        self.shown = False

    @property
    def due_us(self) -> int:
        """When it will have stalled, in link time, unless something is seen before."""
        return NEVER if self._since_us is None else self._since_us + self._expected.within_us

    def has_stalled(self, seen: ObservedVehicle) -> bool:
        """Whether nothing fell for too long. What is not known meanwhile is not held against it."""
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
            self._best, self._since_us = left, seen.up_us  # it may have to turn round
        return seen.up_us - self._since_us > self._expected.within_us

    def _has_come_further(self, best: tuple[int, ...], left: tuple[int, ...]) -> bool:
        either_way = self._expected.either_way
        for before, now in zip(best, left, strict=True):
            if before - now >= LEAST or (either_way and now - before >= LEAST):
                return True
        return False


# ---------------------------------------------------------------- stopping

#: us of link time between a command to stop that was obeyed and the time from which its effect must show: what
#: filters, reports and a gust take. PX4 1.16 needs it: from 4.5 m/s it is below 0.4 m/s after 3.6 to 4.6 s only.
LAG_US: Final = 2_000_000
#: what a vehicle is taken to brake with that does not say: mm/s^2, and us before it begins
UNDECLARED_BRAKING: Final = 1_000
UNDECLARED_REACTION_US: Final = 1_000_000
_SECOND: Final = 1_000_000


@dataclass(frozen=True, slots=True)
class Brakes:
    """How a vehicle brakes, as its policy declares it (`brakes from 12 m/s in 6 s after 500 ms`): mm/s^2 and us."""

    braking: int
    reaction_us: int

    @classmethod
    def of(cls, vehicle: VehicleLimits) -> "Brakes":
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


class BrakingWatch:
    """Follows a vehicle that was told to stop, from the speed that it then had."""

    def __init__(self, brakes: Brakes, seen: ObservedVehicle) -> None:
        self._brakes = brakes
        self._speed = seen.speed
        self._since_us: int | None = None

    @property
    def due_us(self) -> int:
        """From when it may be found too fast, in link time; never while it was not seen to obey."""
        return NEVER if self._since_us is None else self._since_us + self._brakes.reaction_us + LAG_US

    def has_failed(self, seen: ObservedVehicle, *, obeyed: bool) -> bool:
        """Whether it is faster than it may be by now, or moves when it must stand still.

        `obeyed`: the command was acknowledged, or its mode shows. The speed that it must lose is the greatest until its
        effect must show. A speed counts at the time at which it was measured. One that is not known any more, and was
        not for as long as it may be old, is none that fell.
        """
        if self._since_us is None and obeyed:
            self._since_us = seen.up_us
        at_us = seen.up_us if seen.speed is None else seen.speed_us
        if self._since_us is None or at_us - self._since_us <= self._brakes.reaction_us + LAG_US:
            if seen.speed is not None:  # it may have been told to stop while it still gathered speed
                self._speed = max(self._speed or 0, seen.speed)
            return False
        passed_us, speed = at_us - self._since_us, self._speed or 0
        stands = passed_us > self._brakes.stands_us(speed)
        if seen.speed is None:
            return stands and seen.up_us - seen.speed_us > STALE_US
        return seen.speed > (STILL if stands else self._brakes.fastest(speed, passed_us) + STILL)


# ---------------------------------------------------------------- somebody else's target

#: Until ours shows, what is reported may be older than our frame; in us of link time.
SETTLES_US: Final = 1_500_000
_REMEMBERED: Final = 4


class TargetWatch:
    """The target that the autopilot says it flies to, against those that we gave it, over all manoeuvres of a vehicle.

    A ground station takes over without any change of mode: PX4's pause and go-to, ArduCopter's guided targets. The
    autopilot then reports another target than ours (POSITION_TARGET_GLOBAL_INT). PX4 reports one whenever it has one,
    ArduCopter in GUIDED only.
    """

    def __init__(self) -> None:
        self._ours: deque[ExpectedTarget] = deque(maxlen=_REMEMBERED)
        self._expected: ExpectedTarget | None = None
        self._prior: Reported | None = None
        self._settled_us = 0
        self._given: ExpectedTarget | None = None  # the present target as it was given, before the vehicle named it
        self._more = 0  # how often it may name another, for it was told again
        self._left: Reported | None = None  # what it flew to before a command that has no target
        self._strayed: int | None = None  # the number of the heartbeat after which it flew elsewhere
        #: whether the autopilot was seen to fly to the present target,
        self.shown = False
        self._shown: Reported | None = None  # and as what it was last reported

    @property
    def compares(self) -> bool:
        """Whether there is a target of ours of which the autopilot's report is worth waiting for."""
        return self._expected is not None and self._expected.told

    @property
    def named(self) -> ExpectedTarget | None:
        """The present target as the vehicle named it; None before it did."""
        return self._expected if self.shown else None

    def expect(self, target: ExpectedTarget | None, seen: ObservedVehicle) -> None:
        """From now on this is what it should fly to; None: nothing that could be compared.

        Where it flew to a target of its own, that may show for a while yet. Where it flew to one of ours, any other is
        somebody else's, also one that shows only after our next frame left.
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
        """From when a report that is older than our frame counts as somebody else's, in link time, if that is to come
        yet.
        """
        return NEVER if self._expected is None or up_us >= self._settled_us else self._settled_us

    def told_again(self) -> None:
        """The present target went out once more: each time that it stops anew, it stops somewhere else."""
        self._more += 1

    def is_foreign(self, seen: ObservedVehicle) -> bool:
        """Whether it flies to somebody else's target."""
        expected, reported = self._expected, seen.target
        if reported is None or (self.shown and reported == self._shown):
            return False
        if expected is None:
            return self._has_strayed(reported, seen.beats)
        if reported == self._prior and not self.shown:
            return False  # not obeyed yet; when it never is, there is no progress
        if not self.shown and not expected.is_given(reported) and self._is_late(reported):
            return False  # a stop might end there
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
        """The mode of the present command shows: where it has no target, it goes where the autopilot has it go."""
        if self._expected is None:
            self._left = None

    def _has_strayed(self, reported: Reported, beats: int) -> bool:
        """Whether it left for somewhere else before our command, which has no target, showed in its mode.

        Where our command itself is why, two heartbeats after that tell its mode.
        """
        if self._left is None or _same(self._left, reported) or self._is_late(reported):
            self._strayed = None
            return False
        if self._strayed is None:
            self._strayed = beats
        return beats - self._strayed >= MODE_BEATS

    def _is_late(self, reported: Reported) -> bool:
        """Whether this is the place of a command before, which was on its way still when the present one left."""
        return any(ours.is_given(reported) for ours in self._ours if ours is not self._expected)

    def _show(self, expected: ExpectedTarget, reported: Reported) -> None:
        if not self.shown:  # this is the one, from now on
            self._ours[-1] = self._expected = expected.as_reported(reported)
        self.shown, self._shown = True, reported


def _same(one: Reported, other: Reported) -> bool:
    return abs(one[2] - other[2]) <= KEPT_LEVEL and apart(*one[:2], *other[:2]) <= KEPT


#: A target that was not named for this long is asked for; it is streamed at twice that rate.
UNNAMED_US: Final = 150_000
#: So long after the last answer to such a question, or to the one before, it would have come;
NAMED_WITHIN_US: Final = 100_000
#: and after this long, unless something was lost meanwhile, the question is put anew.
ASKED_ANEW_US: Final = 400_000
#: So many heartbeats without a target: on a link that loses more than half of all, one in 10**7 of such rows is chance.
MANY_BEATS: Final = 25


class NamedTargetWatch:
    """Whether an autopilot that goes on naming its target stopped doing so: somebody commands a velocity, say.

    That nothing came proves nothing, for frames are lost. It was asked, it answered, and the numbers of its frames show
    that none is missing: then it names none.
    """

    def __init__(self, slack: int = 1) -> None:
        self._slack = slack
        self._targets = -1
        self._beats = 0  # how many heartbeats had come when it last named its target
        self._asked: tuple[int, int, int, int] | None = None  # when, and what was missing, answered and heard before
        self._answered: tuple[int, int] | None = None  # when the last answer came, and how many had
        #: it is to be asked for its target now
        self.asks = False

    def is_gone(self, seen: ObservedVehicle, now_us: int, asked: int) -> bool:
        """Whether it names no target any more; `asked` counts the questions that were put so far."""
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
            return False  # not all that was asked is answered
        if self._answered is None or self._answered[1] != seen.answers:
            self._answered = now_us, seen.answers
        return now_us - self._answered[0] >= NAMED_WITHIN_US * self._slack


#: us of link time that it must stand, after it moved, before that is somebody's pause;
STANDS_US: Final = 1_500_000
#: mm/s: it moved, if it was as fast as this,
MOVED: Final = 1_500
#: us of link time that it must fly to the side in its climb, where it rises no further;
ASIDE_US: Final = 2_500_000
#: mm: and it is far from its target, where it would not slow down by itself;
FAR: Final = 10_000
#: mm: or from the height of its climb;
FAR_BELOW: Final = 2_000
#: degrees: what leans more fights the wind;
LEANS: Final = 15
#: mm, us: what is as near ahead may be why it stands
BLOCKED: Final = 10_000
BLOCKED_US: Final = 2_000_000


class PauseWatch:
    """Whether a vehicle on its way to its target was stopped by somebody, who changed neither mode nor target.

    ArduCopter's DO_PAUSE_CONTINUE takes 3 s from 5.6 m/s (recorded). Wind makes it lean, an obstacle is seen ahead, at
    the end of a leg it is near its target, and without a position nothing is known. `climb`: it is to get higher, and
    names no target, so somebody else's velocity is seen by that it flies to the side and rises no further. That it
    rises no further shows nothing alone: its weight, weak motors or a fence above keep it down as well.
    """

    def __init__(self, *, climb: bool = False) -> None:
        self._far, self._climb = FAR_BELOW if climb else FAR, climb
        self._moved = False
        self._since_us: int | None = None
        self._aside_us: int | None = None  # since when it moved to the side in a climb, and rose no further

    @property
    def due_us(self) -> int:
        """When it will have stood for long enough, in link time, unless something is seen before."""
        return NEVER if self._since_us is None else self._since_us + STANDS_US

    def is_paused(
        self, seen: ObservedVehicle, left: tuple[int, ...] | None, now_us: int, *, granted: bool = False
    ) -> bool:
        """Whether it stands so since it moved; `left` is how far its target is. `granted`: somebody else was told that
        it obeys.
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
        """Whether it moved to the side all the while in its climb, and rose no further: no climb of its own does."""
        return self._aside_us is not None and seen.speed_us - self._aside_us >= ASIDE_US


def stands_idly(
    seen: ObservedVehicle, left: tuple[int, ...] | None, now_us: int, far: int = FAR, *, climb: bool = False
) -> bool:
    """Whether it stands still far from its target, in a `climb` its height, and nothing that is seen keeps it there."""
    if left is None or min(left) < far or not (_is_level(seen) if climb else still(seen)):
        return False
    blocked = seen.ahead is not None and seen.ahead < BLOCKED and now_us - seen.ahead_us <= BLOCKED_US
    return seen.tilt < LEANS and not blocked


def _is_level(seen: ObservedVehicle) -> bool:
    return seen.airborne and seen.speed is not None and abs(seen.descent) <= STOPPED


#: us of link time that a leg must be flown steadily at less than `SLOWER` % of the speed that it was told
SLOW_US: Final = 4_000_000
SLOWER: Final = 60
#: mm/s by which a steady speed goes up and down at most
STEADY: Final = 600


class SpeedWatch:
    """Whether a leg is flown steadily slower than it was told: somebody set another speed (DO_CHANGE_SPEED)."""

    def __init__(self, told: int) -> None:
        self._told = told
        self._since_us: int | None = None
        self._low = self._high = 0
        #: how fast it flies instead, in mm/s, once that is known
        self.slow: int | None = None

    def look(self, seen: ObservedVehicle, left: tuple[int, ...] | None) -> bool:
        """Take in what is seen; whether it is found to be slow now, and was not before."""
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

#: us between what is judged together: its height, that it flies, and that its motors stopped. What lies further apart
#: is of two moments, between which it may have landed.
RECENT_US: Final = 2_000_000
#: us between two reports of a tilt, of which a single one proves nothing
LASTS_US: Final = 400_000
#: from a speed that falls (`FALLS`), no motors stop it to one that stands (`STOPPED`)
#: within this time, in us, between two reports of its speed.
AT_ONCE_US: Final = 400_000
#: us from there until it says that it lies on the ground, or that its motors are off
LIES_WITHIN_US: Final = 10_000_000
#: degrees: autopilots lean at most 45 of their own accord
TILTED: Final = 60

_POSITION: Final = "GLOBAL_POSITION_INT"


class _Off(NamedTuple):
    """The first heartbeat that says that the motors are off: its place in the order of sending, what was known of the
    vehicle's place then, by when they were off, and whether that is by the vehicle's clock.
    """

    place: int
    placed: Placed | None
    by_us: int
    settled: bool


class CrashWatch:
    """A crash told from a landing, once, by each observation of one flight: by the motors, the fall and the attitude.

    What lies on the ground with its motors off says ON_GROUND however it came there.

    All times are the vehicle's, on our clock (`source_time`): after a stall or a silence what waited comes all at once,
    with a gap behind it, and only its own time tells what is of one moment. The time of a report without a stamp is at
    least that of the last stamp before it, and at most that of the next one, or when it came. What must be recent
    counts by the first, what must have been soon by the second.
    """

    def __init__(self) -> None:
        self._flown = False
        self._told = False
        self.forget()

    def forget(self) -> None:
        """Times from before mean nothing any more: the vehicle's clock was set."""
        self._flew: tuple[int, int, bool] | None = None  # when it was last seen to, how high, and whether to land
        self._off: _Off | None = None
        self._tilted: tuple[int, int] | None = None  # since when, and when it was last seen to be
        self._fell: tuple[int, int] | None = None  # when, and how fast it came down
        self._impact: tuple[int, int] | None = None

    def look(self, seen: ObservedVehicle, name: str, now_us: int) -> str | None:
        """What shows that it crashed, now that a message of this name came; None, also once that was told."""
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
        """Autopilots call a vehicle landed that is disarmed: what counts is how it flew just before."""
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
        # it may lie on its side after it landed, and be carried
        stands = _says_air(seen, at_us) or (seen.armed and not seen.disarms and _is_recent(seen, "HEARTBEAT", at_us))
        return f"the vehicle is tilted by {seen.tilt} degrees" if stands and at_us - since_us >= LASTS_US else None

    def _fall(self, at_us: int, descent: int, *, flies: bool) -> str | None:
        if descent >= FALLS:
            self._fell, self._impact = (at_us, descent), None
        elif self._fell is not None:
            # an estimator takes some reports to believe that it stands
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
    """Whether it said not long before that it is in the air."""
    return seen.airborne and _is_recent(seen, "EXTENDED_SYS_STATE" if seen.landed_state else "HEARTBEAT", at_us)


def _is_recent(seen: ObservedVehicle, name: str, at_us: int) -> bool:
    """Whether a message of this name was made at most `RECENT_US` before; not known is no."""
    made_us = seen.made_us.get(name)
    return made_us is not None and at_us - made_us <= RECENT_US
