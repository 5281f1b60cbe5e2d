"""Excuse failures that could not have been prevented. An excused failure is reported with its cause, never dropped.

| cause | excuses | condition or limit |
|---|---|---|
| `position` | outside the airspace | position error plus stopping distance; without a position, the wind's drift |
| `wind` | outside, collision, flying on | wind and gusts too strong to fly against, now or shortly before |
| `motors` | collision, outside | motors stopped, or the autopilot restarted, in the air |
| `battery` | collision, hard touchdown | a fault emptied the battery |
| `pilot` | outside, collision, flying on | a pilot took over; sticks that only shift it: as far as they shift it |
| `failsafe` | outside, flying on | the autopilot's failsafe took over |
| `unseen` | motion after a takeover | ArduCopter: a pause until it has stopped, or near the end of a leg |
| `unseen` | motion after a takeover | ArduCopter: a velocity or a pause in its takeoff |
| `unseen` | motion after a takeover | ArduCopter: a go-to in its takeoff to the end of the takeoff |
| `unseen` | motion after a takeover | sticks that only shift it; PX4's pause in a stop, or at the end of a climb |
| `unseen` | motion after a takeover | PX4's pause or go-to in Hold while its report of the target is stuck |
| `unseen` | motion after a takeover | the mode is that of the runtime's last frame, which was lost |
| `report` | standing down in the air | a HEARTBEAT or position is stuck, or the target is no longer reported |
| `crossed` | motion after a takeover | a frame in flight undid the takeover before it was reported |
| `ground` | motion after a takeover | a landing was sent to a vehicle on the ground |
| `obstacle` | collision | not visible, too late to stop, or the obstacle hit a hovering vehicle |
| `link` | collision, late reaction | no frames from the vehicle, or none to it |
| `process` | collision, flying on, unlogged effect | the runtime's process was dead or suspended |
| `disk` | incomplete log, unlogged effect | the disk was full or slow |
"""

from collections.abc import Callable, Iterator
from math import cos, hypot, radians
from typing import Final, NamedTuple

import msgspec
from pymavlink.dialects.v20 import ardupilotmega as dialect

from rtshcua.model import faults
from rtshcua.model.faults import Direction, Fault, FlightMode
from rtshcua.model.flat.contract import MotionKind
from rtshcua.virtual.flight_record import IncidentOccurrence, ScenarioFlown, TruthSample

#: mm/s: wind that a multirotor of this size cannot fly against; us: how long its effect lasts
STRONG_MM_S: Final = 12_000
_AFTER_WIND_US: Final = 30_000_000
#: us: how long the estimate stays wrong after the receiver has recovered
_AFTER_GLITCH_US: Final = 10_000_000
#: mm/s: the speed at which sticks shift a landing ArduCopter
_NUDGE_MM_S: Final = 1_250
#: us: the additional delay of an overtaken datagram
_REORDER_US: Final = 60_000
#: mm/s^2 and us: the default braking and reaction time
_BRAKING: Final = 2_000
_REACTION_US: Final = 1_000_000
_STANDS_MM_S: Final = 500
_TICK_US: Final = 50_000
#: mm: reported target heights this close count as equal (estimator error)
_SAME_MM: Final = 1_000
#: us: the records that a killed process has not written yet
_UNWRITTEN_US: Final = 250_000
#: us: how long the mode of a stuck HEARTBEAT is believed
_MODE_US: Final = 2_000_000
#: us until ArduCopter has stopped in a pause, and until that is detected; mm and mm/s: the least distance from its
#: target and the least speed for detection
_STANDS_US: Final = 4_000_000
_NOTICED_US: Final = 3_000_000
_FAR_MM: Final = 12_000
_MOVED_MM_S: Final = 2_000
#: us: after this time a takeoff that no longer climbs counts as a takeover
_KEPT_US: Final = 13_000_000
#: mm: a go-to this near the end of the takeoff does not
_TOLD_MM: Final = 3_000
_POSITION_TARGET: Final = (86).to_bytes(3, "little")  # SET_POSITION_TARGET_GLOBAL_INT
_MM: Final = 11.132  # in 1e-7 degree
_RANGES: Final = frozenset({"DISTANCE_SENSOR", "OBSTACLE_DISTANCE"})
_FOREVER: Final = 1 << 60


class JudgedFailure(NamedTuple):
    """A failure, its time (us of the simulation), and its amount in mm, mm/s or us, if it has one.

    `cause` None: a real failure. Otherwise an exception that could not be prevented, and its cause.
    """

    slug: str
    at_us: int
    text: str
    amount: int = 0
    cause: str | None = None


class Excuses:
    """Decides which failures of one flight are excused."""

    def __init__(self, flown: ScenarioFlown) -> None:
        self._flown = flown
        self._happened = flown.happened
        vehicle = flown.policy.vehicle
        self._braking = vehicle.braking or _BRAKING
        self._reaction_us = vehicle.reaction_us or _REACTION_US
        self._rules: dict[str, tuple[Callable[[JudgedFailure], str | None], ...]] = {
            "outside-fence": (self._motors, self._taken, self._wind, self._position, self._nudged),
            "collision": (
                self._motors, self._battery, self._taken, self._wind, self._process, self._link, self._obstacle,
            ),
            "not-ended": (self._taken, self._wind, self._process, self._misled),
            "motion-after-takeover": (self._unseen,),
            "late": (self._link,),
            "log": (self._disk, self._boundary),
            "unlogged-effect": (self._disk, self._killed),
            "not-watched": (self._disk,),
        }  # fmt: skip

    def judged(self, failure: JudgedFailure) -> JudgedFailure:
        """Return the failure, with its cause if it is excused."""
        for rule in self._rules.get(failure.slug, ()):
            cause = rule(failure)
            if cause is not None:
                return failure._replace(cause=cause)
        return failure

    def delay_us(self, from_us: int, to_us: int, *, silences: bool = False) -> int:
        """Return the greatest additional delay of a frame between two times, in one direction, compared with a good
        link: delays of the link, held frames, and stalls of the receiver; with `silences` also silences of the link. A
        link keeps the order: a frame after the end of a delay waits for earlier frames.
        """
        total = 0
        for each in self._happened:
            match each.fault:
                case faults.LinkDelay(delay_us=added_us) | faults.LinkJitter(jitter_us=added_us) if each.at_us <= to_us:
                    total += max(0, min(added_us, _ends_us(each) + added_us - from_us))
        for fault in self._during(from_us, to_us):
            match fault:
                case faults.StaleSource(delay_us=added_us):
                    total += added_us
                case faults.LinkReorder():
                    total += _REORDER_US
                case faults.LinkSilence(held=held) if not held and not silences:
                    pass
                case faults.LinkSilence(at_us, for_us) | faults.Stall(at_us, for_us) | faults.HostStall(at_us, for_us):
                    total += min(for_us or _FOREVER, to_us - at_us)
        return total

    def paused_at(self, at_us: int) -> bool:
        """Return whether a pilot's pause took place at that time."""
        return any(
            isinstance(each.fault, faults.PilotPause) and each.at_us <= at_us <= each.at_us + _TICK_US
            for each in self._happened
        )

    # -------------------------------------------------------- incidents

    def _before(self, at_us: int, *kinds: type[Fault]) -> Iterator[Fault]:
        return (each.fault for each in self._happened if each.at_us <= at_us and isinstance(each.fault, kinds))

    def _during(self, from_us: int, to_us: int) -> Iterator[Fault]:
        """Yield the faults that were active between two times."""
        return (each.fault for each in self._happened if each.at_us <= to_us and _ends_us(each) >= from_us)

    def _sample(self, at_us: int) -> TruthSample | None:
        found = None
        for sample in self._flown.samples:
            if sample.at_us > at_us:
                break
            found = sample
        return found

    def _stop_mm(self, from_us: int, to_us: int) -> float:
        """Return the stopping distance from the greatest speed between two times."""
        speeds = [sample.speed_mm_s for sample in self._flown.samples if from_us <= sample.at_us <= to_us]
        speed = max(speeds, default=0)
        return speed * self._reaction_us / 1e6 + speed**2 / (2 * self._braking)

    # -------------------------------------------------------- causes

    def _motors(self, failure: JudgedFailure) -> str | None:
        for fault in self._before(failure.at_us, faults.Kill, faults.Reboot):
            sample = self._sample(fault.at_us)
            if sample is not None and sample.in_air:
                return "motors"
        return None

    def _battery(self, failure: JudgedFailure) -> str | None:
        sample = self._sample(failure.at_us)
        made = any(self._before(failure.at_us, faults.BatteryLevel, faults.BatteryCell))
        return "battery" if made and sample is not None and sample.battery <= 0 else None

    def _taken(self, failure: JudgedFailure) -> str | None:
        sample = self._sample(failure.at_us)
        if sample is None or sample.taken_over_us is None or sample.taken_over_us >= failure.at_us:
            return None
        if sample.taken_over_by == "pilot":
            return "pilot"
        return "failsafe" if failure.slug != "collision" else None

    def _wind(self, failure: JudgedFailure) -> str | None:
        start = self._flown.scenario.start
        winds = [(0, start.wind_mm_s or 0, start.gust_mm_s)]
        for fault in self._before(failure.at_us, faults.WindStep):
            assert isinstance(fault, faults.WindStep)
            winds.append((fault.at_us, fault.speed_mm_s, fault.gust_mm_s))
        ends = [*(at_us for at_us, _, _ in winds[1:]), _FOREVER]
        for (_, speed, gust), end_us in zip(winds, ends, strict=True):
            if speed + 2 * gust >= STRONG_MM_S and end_us + _AFTER_WIND_US >= failure.at_us:
                return "wind"
        return None

    def _position(self, failure: JudgedFailure) -> str | None:
        off, since_us = 0.0, failure.at_us
        for fault in self._before(failure.at_us, faults.ReceiverFault):
            ended_us = fault.at_us + (getattr(fault, "for_us", None) or _FOREVER)
            passes = isinstance(fault, faults.GpsLoss | faults.GpsGlitch)
            blind = passes and self._lands_blind(ended_us + _AFTER_GLITCH_US, failure.at_us)
            if blind:
                ended_us = failure.at_us
            lasted_s = (min(ended_us, failure.at_us) - fault.at_us) / 1e6
            carried = (self._air_mm_s(failure.at_us) + 1_000) * lasted_s
            match fault:
                case faults.GpsJump(_, north_mm, east_mm):
                    off += hypot(north_mm, east_mm)
                case faults.GpsDrift(_, north_mm_s, east_mm_s):
                    off += hypot(north_mm_s, east_mm_s) * lasted_s
                case faults.GpsGlitch(_, north_mm, east_mm) if failure.at_us <= ended_us + _AFTER_GLITCH_US:
                    off += hypot(north_mm, east_mm) + (carried if blind else 0)
                case faults.GpsLoss() if failure.at_us <= ended_us + _AFTER_GLITCH_US:
                    off += carried
                case _:
                    continue
            since_us = min(since_us, fault.at_us)
        return "position" if off and failure.amount <= off + self._stop_mm(since_us, failure.at_us) else None

    def _lands_blind(self, back_us: int, at_us: int) -> bool:
        """Return whether ArduCopter lands without a position: it checks the position only when a landing begins
        (`ModeLand::init`).
        """
        from_us = min(back_us, at_us)
        lands = [sample.mode is FlightMode.LAND for sample in self._flown.samples if from_us <= sample.at_us <= at_us]
        return self._flown.flavour == "ardupilot" and all(lands)

    def _misled(self, failure: JudgedFailure) -> str | None:
        """Excuse a stand-down after a stuck HEARTBEAT, whose mode looks like a pilot's choice; for ArduCopter also
        after a target that is no longer reported, or a stuck position.
        """
        if self._flown.ending != "stood-down":
            return None
        for fault in self._during(failure.at_us - _MODE_US, failure.at_us):
            match fault:
                case faults.MessageStuck(message="HEARTBEAT"):
                    return "report"
                case faults.MessageSilence(message="POSITION_TARGET_GLOBAL_INT") if self._is_copter:
                    return "report"
                case faults.MessageStuck(message="GLOBAL_POSITION_INT") if self._is_copter:
                    return "report"
        return None

    @property
    def _is_copter(self) -> bool:
        return self._flown.flavour == "ardupilot"

    def _air_mm_s(self, at_us: int) -> float:
        start = self._flown.scenario.start
        strongest = (start.wind_mm_s or 0) + 2 * start.gust_mm_s
        for fault in self._before(at_us, faults.WindStep):
            assert isinstance(fault, faults.WindStep)
            strongest = max(strongest, fault.speed_mm_s + 2 * fault.gust_mm_s)
        return strongest

    def _nudged(self, failure: JudgedFailure) -> str | None:
        nudged = 0.0
        for fault in self._before(failure.at_us, faults.PilotSticks):
            assert isinstance(fault, faults.PilotSticks)
            nudged += fault.for_us / 1e6 * _NUDGE_MM_S
        return "pilot" if nudged and failure.amount <= nudged + 1_000 else None

    def _unseen(self, failure: JudgedFailure) -> str | None:
        """Excuse takeovers that no report shows: ArduCopter's pause, sticks that shift its landing, and PX4's pause
        near the end of a climb.
        """
        since_us = failure.at_us - failure.amount - _TICK_US  # earlier actions of a pilot had no effect
        if self._target_stands_still(since_us, failure.at_us):
            return "unseen"
        told = [*self._before(failure.at_us, faults.PilotMode, faults.PilotGoto)]
        if any(
            fault.at_us >= since_us and not self._ends_the_climb(fault) and not self._stands(fault) for fault in told
        ):
            return None
        if self._is_copter:
            return "unseen" if self._is_silent(failure) else None
        if any(self._before(failure.at_us, faults.PilotSticks)):
            return None
        for fault in self._before(failure.at_us, faults.PilotPause):
            sample = self._sample(fault.at_us)
            climbs = sample is not None and sample.mode is FlightMode.TAKEOFF
            if sample is not None and climbs and any(abs(up - sample.up_mm) <= _SAME_MM for up in self._climbs()):
                return "unseen"
        return None

    def _target_stands_still(self, since_us: int, at_us: int) -> bool:
        """Return whether a pilot only gave PX4 another target in Hold while the report of the target was stuck or
        absent.
        """
        acts = [each for each in self._before(at_us, faults.PilotFault) if each.at_us >= since_us]
        return not self._is_copter and bool(acts) and all(self._shows_nowhere(each, at_us) for each in acts)

    def _shows_nowhere(self, act: Fault, until_us: int) -> bool:
        before = self._sample(act.at_us - _TICK_US)
        in_hold = before is not None and before.mode is FlightMode.LOITER
        stuck = (each.fault for each in self._happened if each.at_us <= act.at_us and _ends_us(each) >= until_us)
        return isinstance(act, faults.PilotPause | faults.PilotGoto) and in_hold and any(map(_hides_target, stuck))

    def _is_silent(self, failure: JudgedFailure) -> bool:
        """Return whether a pilot's action on ArduCopter may be invisible. A pause on a leg is visible once the vehicle
        has stopped, unless other faults are active or it is near the end of the leg.
        """
        others = (faults.PilotPause, faults.PilotSpeed, faults.AgentFault)
        alone = all(isinstance(each.fault, others) for each in self._happened if each.at_us <= failure.at_us)
        silent = (faults.PilotPause, faults.PilotSticks, faults.PilotVelocity, faults.PilotGoto)
        for fault in self._before(failure.at_us, *silent):
            if isinstance(fault, faults.PilotGoto):
                is_silent = self._ends_the_climb(fault)
            elif isinstance(fault, faults.PilotVelocity):
                # in a takeoff there is no reported target that could vanish, until the climb stops
                is_silent = self._left_mm(failure.at_us - failure.amount) is None and failure.amount <= _KEPT_US
            else:
                noticed = failure.at_us - fault.at_us > _STANDS_US + _NOTICED_US
                is_silent = not (alone and noticed and self._pause_shows(fault))
            if is_silent:
                return True
        return False

    def _pause_shows(self, fault: Fault) -> bool:
        """Return whether a pause stopped a moving vehicle far from the end of its leg."""
        sample, left_mm = self._sample(fault.at_us), self._left_mm(fault.at_us + _STANDS_US)
        far = left_mm is not None and left_mm > _FAR_MM
        return isinstance(fault, faults.PilotPause) and far and sample is not None and sample.speed_mm_s >= _MOVED_MM_S

    def _stands(self, fault: Fault) -> bool:
        """Return whether a pilot chose ArduCopter's current mode, which has no effect (Copter::set_mode, mode.cpp)."""
        before = self._sample(fault.at_us - _TICK_US)
        return (
            isinstance(fault, faults.PilotMode) and self._is_copter and before is not None and before.mode is fault.mode
        )

    def _ends_the_climb(self, fault: Fault) -> bool:
        """Return whether a go-to in ArduCopter's takeoff names the end of the takeoff, as older versions do."""
        if not (isinstance(fault, faults.PilotGoto) and self._is_copter) or self._left_mm(fault.at_us) is not None:
            return False
        start, sample = self._flown.samples[0], self._sample(fault.at_us)
        if sample is None or not any(abs(up - fault.up_mm) <= _TOLD_MM for up in self._climbs()):
            return False
        north = (sample.latitude - start.latitude) * _MM - fault.north_mm
        east = (sample.longitude - start.longitude) * _MM * cos(radians(start.latitude / 1e7)) - fault.east_mm
        return hypot(north, east) <= _TOLD_MM

    def _left_mm(self, at_us: int) -> float | None:
        """Return the distance from the last target that ArduCopter received; None if there is none."""
        sample, place = self._sample(at_us), None
        for frame in self._flown.frames:
            if frame.heard_us is None or frame.heard_us > at_us or frame.octets[7:10] != _POSITION_TARGET:
                continue
            message = dialect.MAVLink(None).decode(bytearray(frame.octets))
            place = message.lat_int, message.lon_int
        if sample is None or place is None:
            return None
        north, east = (place[0] - sample.latitude) * _MM, (place[1] - sample.longitude) * _MM
        return hypot(north, east * cos(radians(sample.latitude / 1e7)))

    def _climbs(self) -> Iterator[int]:
        """Yield the takeoff heights of the mission."""
        for invocation in self._flown.mission.invocations:
            if invocation.plan.kind == MotionKind.CLIMB:
                yield invocation.plan.altitude

    def _link(self, failure: JudgedFailure) -> str | None:
        """Excuse failures while the link was down in one direction. Expired permits and missed deadlines are not
        excused: they depend only on the runtime's clock.
        """
        if failure.slug == "late" and not failure.text.startswith("a fallback"):
            return None
        from_us = failure.at_us - 5_000_000
        for fault in self._during(from_us, failure.at_us):
            match fault:
                case faults.LinkSilence(way=way) if failure.slug != "late" or way is not Direction.UP:
                    return "link"
                case faults.LinkLoss(loss=loss) if loss >= 3_000 or failure.slug == "late":
                    return "link"
                case faults.LinkDelay(delay_us=delay_us) if delay_us >= 500_000:
                    return "link"
                case faults.Stall() | faults.Reboot():
                    return "link"
                case faults.MessageSilence(message="HEARTBEAT") if failure.slug == "late":
                    return "link"
        return None

    def _process(self, failure: JudgedFailure) -> str | None:
        """Excuse failures while the runtime's process was dead or suspended, and until a stop after that."""
        flown = self._flown
        if failure.slug == "not-ended":
            return "process" if flown.left not in (None, "replayed") and not flown.fault else None
        ends = [
            (killed.ended_us, after.began_us)
            for killed, after in zip(flown.lives, (*flown.lives[1:], None), strict=True)
            if killed.ending is None and after is not None
        ]
        if flown.left is not None:
            ends.append((flown.ended_us, _FOREVER))
        for fault in self._before(failure.at_us, faults.HostStall):
            assert isinstance(fault, faults.HostStall)
            ends.append((fault.at_us, fault.at_us + fault.for_us))
        for died_us, back_us in ends:
            if died_us <= failure.at_us <= back_us + self._reaction_us + 2_000_000:
                return "process"
        return None

    def _obstacle(self, failure: JudgedFailure) -> str | None:
        pillars = [fault for fault in self._before(failure.at_us, faults.Pillar) if isinstance(fault, faults.Pillar)]
        if not pillars:
            return None
        if not self._looks_out(failure.at_us) or failure.amount < _STANDS_MM_S:
            return "obstacle"
        if any(fault.message in _RANGES for fault in self._before(failure.at_us, faults.MessageStuck)):  # type: ignore[attr-defined]
            return "obstacle"
        newest = max(pillars, key=lambda pillar: pillar.at_us)
        sample = self._sample(newest.at_us)
        near = sample.obstacle_mm if sample is not None else None
        away = self._next_distance(newest.at_us) if near is None else near
        if newest.speed_mm_s or (away is not None and away <= self._stop_mm(newest.at_us, failure.at_us) + 2_000):
            return "obstacle"
        return None

    def _looks_out(self, at_us: int) -> bool:
        """Return whether the running skill reads a range finder signal; otherwise it cannot avoid obstacles."""
        policy = self._flown.policy
        slots = {
            slot for signal in policy.signals for slot in signal.slots
            if any(source.message in _RANGES for source in signal.sources)
        }  # fmt: skip
        skill = None
        for life in self._flown.lives:
            for line in life.lines:
                if b'"event":"dispatched"' in line:
                    record = msgspec.json.decode(line)
                    if record["at_us"] - self._flown.start_us <= at_us:
                        skill = record["detail"]
        return any(contract.name == skill and slots & set(contract.reads) for contract in policy.contracts)

    def _next_distance(self, at_us: int) -> int | None:
        for sample in self._flown.samples:
            if sample.at_us >= at_us and sample.obstacle_mm is not None:
                return sample.obstacle_mm
        return None

    def _disk(self, failure: JudgedFailure) -> str | None:
        if failure.slug == "log" and not failure.text.startswith("incomplete"):
            return None
        for fault in self._before(failure.at_us, faults.DiskFull, faults.DiskStall):
            assert isinstance(fault, faults.DiskFull | faults.DiskStall)
            if fault.for_us is None or failure.at_us <= fault.at_us + fault.for_us:
                return "disk"
        return None

    def _boundary(self, failure: JudgedFailure) -> str | None:
        """Excuse a log that is incomplete because the boundary was killed in flight."""
        lost = failure.text.startswith("incomplete: boundary/lost") and any(
            self._before(failure.at_us, faults.BoundaryKilled)
        )
        return "boundary" if lost else None

    def _killed(self, failure: JudgedFailure) -> str | None:
        """Excuse frames just before a process was killed: a fallback does not wait for its record to be written."""
        for life in self._flown.lives:
            if life.ending is None and 0 <= life.ended_us - failure.at_us <= _UNWRITTEN_US:
                return "process"
        return None


def _hides_target(fault: Fault) -> bool:
    """Return whether a fault makes the report of the autopilot's target old or absent."""
    match fault:
        case faults.Freeze():
            return True
        case faults.MessageSilence(message=message) | faults.MessageStuck(message=message):
            return message == "POSITION_TARGET_GLOBAL_INT"
    return False


def _ends_us(happened: IncidentOccurrence) -> int:
    for_us = getattr(happened.fault, "for_us", None)
    if isinstance(happened.fault, faults.Reboot):
        return happened.at_us + 10_000_000
    return happened.at_us + (_FOREVER if for_us is None else for_us)
