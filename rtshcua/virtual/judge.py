"""An independent judge of a scenario flight, based on the true state of the simulation.

The judge reads the true positions of the vehicle and the frames that it received. It uses no code of the runtime or of
the decision (import contracts enforce this): zones are judged in floating point, pymavlink decodes the frames, and
`naive_supervision` repeats the supervision. The auditor verifies the logs and derives their decisions again; the judge
then compares the logs with the frames.

| slug | failure |
|---|---|
| `outside-fence` | the vehicle was outside the policy's airspace; a zone counts while it exists |
| `collision` | the vehicle hit an obstacle or touched down too hard |
| `motion-after-takeover` | a motion frame was sent later than W (docs/adr/0034) after a takeover |
| `not-ended` | at the end the vehicle neither rests on the ground nor hovers |
| `late` | a motion frame was sent later than a permit, a step's deadline or the reaction bound allows |
| `log` | a log does not verify |
| `derive` | a decision of a log cannot be derived again |
| `unlogged-effect` | a motion frame or a command to payload belongs to no command in the log |
| `fault` | the runtime raised an exception, or the run did not end |

`runtime_checks` defines further slugs, from supervision to fallback chains.

A failure that could not be prevented is an *exception* instead, with its `cause` (`excuses`).
"""

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import cos, hypot, inf, radians
from typing import Any, Final, NamedTuple

import msgspec
from pymavlink.dialects.v20 import ardupilotmega as dialect

from rtshcua.evidence.report import LogVerdict
from rtshcua.ground.audit.audit import Auditor
from rtshcua.model.faults import FlightMode
from rtshcua.model.flat.contract import Contract, MotionKind
from rtshcua.model.step_number import step_words
from rtshcua.virtual.excuses import Excuses, JudgedFailure
from rtshcua.virtual.flight_record import ScenarioFlown, SentFrame, TruthSample, records_of
from rtshcua.virtual.runtime_checks import RuntimeChecks
from rtshcua.virtual.zone_truth import airspace_mm, in_force, is_timed, local_mm

SLUGS: Final = (
    "outside-fence", "collision", "motion-after-takeover", "not-ended", "late", "log", "derive", "unlogged-effect",
    "fault",
)  # fmt: skip
#: us: the greatest age of the mode report on which a motion frame may be sent (docs/adr/0034)
MODE_WITHIN_US: Final[Mapping[str, int]] = {"px4": 300_000, "ardupilot": 200_000}
#: mm/s: the speed of a hovering vehicle with noise and gusts; us: how long it must hover at the end
STILL_MM_S: Final = 700
LEVEL_MM_S: Final = 300
STILL_US: Final = 3_000_000


@dataclass(frozen=True, slots=True)
class Margins:
    """The distances and times to a failure; None: not applicable. Negative: the amount of the failure."""

    fence_mm: int | None = None
    """The least distance to the edge, inside the airspace."""
    obstacle_mm: int | None = None
    """The least distance to an obstacle."""
    stop_us: int | None = None
    """The longest time from the cause of a fallback to its first frame."""
    takeover_us: int | None = None
    """The longest time from a takeover to a sent motion frame."""
    ended_us: int | None = None
    """How long the vehicle kept moving after the last process had ended."""


@dataclass(frozen=True, slots=True)
class Judgement:
    """The failures, the excused failures (exceptions), and the margins."""

    failures: tuple[JudgedFailure, ...]
    exceptions: tuple[JudgedFailure, ...]
    margins: Margins


def judge(flown: ScenarioFlown) -> Judgement:
    """Judge a flight. Of each slug the first and the worst occurrence are reported."""
    excuses = Excuses(flown)
    fence, fence_mm = _fence(flown)
    motion = _motion(flown)
    reactions, stop_us = _reactions(flown, motion, excuses)
    takeovers, takeover_us = _takeovers(flown, motion, excuses)
    end, ended_us = _end(flown)
    found = [
        *fence, *_collision(flown), *takeovers, *end, *reactions, *_permits(flown, motion), *_logs(flown),
        *_unlogged(flown, motion), *_payload(flown), *_faults(flown), *RuntimeChecks(flown, motion).failures(),
        *_images(flown),
    ]  # fmt: skip
    judged = [each if each.cause is not None else excuses.judged(each) for each in found]
    margins = Margins(fence_mm, _nearest(flown.samples), stop_us, takeover_us, ended_us)
    return Judgement(
        _told([each for each in judged if each.cause is None]),
        _told([each for each in judged if each.cause is not None]),
        margins,
    )


def _told(found: Sequence[JudgedFailure]) -> tuple[JudgedFailure, ...]:
    """Return the first and the worst failure of each slug and cause, ordered by time."""
    chosen: set[JudgedFailure] = set()
    for slug, cause in {(each.slug, each.cause) for each in found}:
        alike = [each for each in found if (each.slug, each.cause) == (slug, cause)]
        chosen |= {min(alike, key=lambda each: each.at_us), max(alike, key=lambda each: each.amount)}
    return tuple(sorted(chosen, key=lambda each: (each.at_us, each.slug, each.text)))


# ---------------------------------------------------------------- place


def _fence(flown: ScenarioFlown) -> tuple[list[JudgedFailure], int | None]:
    """Return the times outside the airspace, and the least distance to its edge.

    Between two places at distance d the distance to an edge changes by at most d: samples that must be far inside are
    skipped.
    """
    stated = flown.policy.airspace
    if stated is None:
        return [], None
    timed = any(is_timed(flown.policy.zones[number]) for number in (*stated.inside, *stated.outside))
    there = in_force(flown.policy, flown.utc_us)
    worst, found = inf, list[JudgedFailure]()
    x0 = y0 = up0 = 0.0
    known = -inf  # how far inside it was at x0, y0, up0
    for sample in flown.samples:
        if sample.crashed:
            break
        if not sample.in_air:
            continue
        if timed and (now := in_force(flown.policy, flown.utc_us + sample.at_us)) != there:
            there, known = now, -inf
        if len(there.inside) < len(stated.inside):
            found.append(
                JudgedFailure("outside-fence", sample.at_us, "in the air while an inclusion zone does not exist")
            )
            continue
        x, y = local_mm(flown.policy, sample.latitude, sample.longitude)
        if known - hypot(x - x0, y - y0, sample.up_mm - up0) > max(worst, 0):
            continue
        x0, y0, up0 = x, y, float(sample.up_mm)
        known = airspace_mm(there, x, y, up0)
        worst = min(worst, known)
        if known < 0:
            place = f"{x / 1000:.1f} m east and {y / 1000:.1f} m north of home, {up0 / 1000:.1f} m up"
            text = f"{-known / 1000:.2f} m outside the airspace: {place}"
            found.append(JudgedFailure("outside-fence", sample.at_us, text, round(-known)))
    return found, None if worst == inf else round(worst)


def _nearest(samples: Sequence[TruthSample]) -> int | None:
    return min(
        (sample.obstacle_mm for sample in samples if sample.obstacle_mm is not None and sample.in_air), default=None
    )


def _collision(flown: ScenarioFlown) -> list[JudgedFailure]:
    for before, sample in pairwise(flown.samples):
        if sample.crashed and not before.crashed:
            near = min((d for d in (before.obstacle_mm, sample.obstacle_mm) if d is not None), default=None)
            what = "touched down too hard" if near is None or near > _TOUCHES_MM else "hit an obstacle"
            return [
                JudgedFailure(
                    "collision",
                    sample.at_us,
                    f"the vehicle {what} at {before.speed_mm_s / 1000:.1f} m/s",
                    before.speed_mm_s,
                )
            ]
    return []


_TOUCHES_MM: Final = 1_000


# ---------------------------------------------------------------- the end


def _end(flown: ScenarioFlown) -> tuple[list[JudgedFailure], int | None]:
    samples = flown.samples
    if not samples:
        return [], None
    last = samples[-1]
    moving = [each for each in samples if each.at_us > flown.ended_us and each.in_air and not _is_still(each)]
    ended_us = max(0, moving[-1].at_us - flown.ended_us) if moving else 0
    if not last.in_air:
        return [], ended_us
    where = f"{last.up_mm / 1000:.1f} m up in {last.mode}, at {last.speed_mm_s / 1000:.1f} m/s"
    if flown.ending == "completed":
        return [
            JudgedFailure("not-ended", last.at_us, f"the run ended as `completed` with the vehicle {where}")
        ], ended_us
    if flown.left == "replayed":
        return [JudgedFailure("not-ended", last.at_us, f"no run was started with the vehicle {where}")], ended_us
    if any(not _is_still(each) for each in samples if each.at_us > last.at_us - STILL_US):
        return [JudgedFailure("not-ended", last.at_us, f"the vehicle keeps flying {where}", last.speed_mm_s)], ended_us
    return [], ended_us


def _is_still(sample: TruthSample) -> bool:
    return sample.speed_mm_s <= STILL_MM_S and abs(sample.climb_mm_s) <= LEVEL_MM_S


def _faults(flown: ScenarioFlown) -> list[JudgedFailure]:
    return [] if flown.fault is None else [JudgedFailure("fault", flown.ended_us, flown.fault)]


# ---------------------------------------------------------------- frames

#: HEARTBEAT, PARAM_REQUEST_READ, PARAM_REQUEST_LIST, MISSION_REQUEST, MISSION_REQUEST_LIST, MISSION_ACK,
#: MISSION_REQUEST_INT, TIMESYNC, LOG_REQUEST_LIST, STATUSTEXT
_QUIET: Final = frozenset({0, 20, 21, 40, 43, 47, 51, 111, 117, 253})
#: messages about a fence or a parameter: they cause no motion by themselves
_SETTINGS: Final = frozenset({"PARAM_SET", "MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_CLEAR_ALL"})
_FENCE: Final = 1
_NOWHERE: Final = 0x7FFFFFFF
_REPOSITION: Final = 192
_MM: Final = 11.132  # in 1e-7 degree
#: mm: how far from its reported target the vehicle may stop: a decimetre, and the estimator's error
_SAME_MM: Final = 2_000
#: us: how long no report shows the effect of a received frame: two reports at 10 Hz
_SHOWS_US: Final = 200_000
#: PX4's reported stopping distance (`Navigator::calculate_breaking_stop`): MPC_ACC_HOR, and its addition for the jerk
_TOLD_BRAKING_MM_S2: Final = 3_000
_TOLD_DELAY_S: Final = 0.6
_REQUEST_MESSAGE, _HEARTBEAT = 512, 0
_ASKS: Final = frozenset({401, 511, _REQUEST_MESSAGE})  # RUN_PREARM_CHECKS, SET_MESSAGE_INTERVAL
_POINT, _CONTROL = dialect.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, dialect.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE
#: commands to payload, which cause no motion (`_payload`): those that a skill may emit, and what ends them
_PAYLOAD: Final = frozenset({
    dialect.MAV_CMD_IMAGE_START_CAPTURE, dialect.MAV_CMD_IMAGE_STOP_CAPTURE, dialect.MAV_CMD_VIDEO_START_CAPTURE,
    dialect.MAV_CMD_VIDEO_STOP_CAPTURE, dialect.MAV_CMD_SET_CAMERA_MODE, dialect.MAV_CMD_SET_CAMERA_ZOOM,
    dialect.MAV_CMD_SET_CAMERA_FOCUS, dialect.MAV_CMD_DO_DIGICAM_CONTROL, dialect.MAV_CMD_DO_TRIGGER_CONTROL,
    dialect.MAV_CMD_DO_SET_CAM_TRIGG_DIST, _POINT, _CONTROL, dialect.MAV_CMD_DO_MOUNT_CONTROL,
    dialect.MAV_CMD_DO_SET_ROI_LOCATION, dialect.MAV_CMD_DO_SET_ROI_NONE, dialect.MAV_CMD_DO_GRIPPER,
    dialect.MAV_CMD_DO_WINCH, dialect.MAV_CMD_DO_SET_SERVO,
})  # fmt: skip
#: what may also be sent after its step: by the command that ends something, the one that begins it
_ENDS: Final[Mapping[int, int]] = {
    dialect.MAV_CMD_IMAGE_STOP_CAPTURE: dialect.MAV_CMD_IMAGE_START_CAPTURE,
    dialect.MAV_CMD_VIDEO_STOP_CAPTURE: dialect.MAV_CMD_VIDEO_START_CAPTURE,
    dialect.MAV_CMD_DO_SET_CAM_TRIGG_DIST: dialect.MAV_CMD_DO_SET_CAM_TRIGG_DIST,
    _CONTROL: _POINT,
}
#: the first parameter of `_CONTROL` that gives the control back
_GIVES_BACK: Final = -3
_LEGS: Final = frozenset({MotionKind.FLY, MotionKind.COVER})
_SET_MODE: Final = 176
#: the modes of `_MODES` without a reported target
_NO_TARGET: Final[Mapping[str, Mapping[tuple[int, int], FlightMode]]] = {
    "px4": {(4, 5): FlightMode.RETURN, (4, 6): FlightMode.LAND},
    "ardupilot": {(17, 0): FlightMode.BRAKE, (6, 0): FlightMode.RETURN, (9, 0): FlightMode.LAND},
}
#: the motions that a DO_SET_MODE can belong to, by its parameters 2 and 3
_MODES: Final[Mapping[str, Mapping[tuple[int, int], frozenset[MotionKind]]]] = {
    "px4": {
        (4, 3): frozenset({MotionKind.CLIMB, MotionKind.HOLD}),
        (4, 5): frozenset({MotionKind.HOME}),
        (4, 6): frozenset({MotionKind.LAND}),
    },
    "ardupilot": {
        (4, 0): _LEGS | {MotionKind.CLIMB},
        (17, 0): frozenset({MotionKind.HOLD}),
        (6, 0): frozenset({MotionKind.HOME}),
        (9, 0): frozenset({MotionKind.LAND}),
    },
}


def moves(octets: bytes, flavour: str) -> frozenset[MotionKind] | None:
    """Return the kinds of motion that a frame can belong to; empty for a frame that the runtime never sends. None: not
    a motion frame.
    """
    if len(octets) >= 10 and octets[0] == 0xFD and int.from_bytes(octets[7:10], "little") in _QUIET:
        return None
    try:
        message = dialect.MAVLink(None).decode(bytearray(octets))
    except dialect.MAVError:
        return None  # no autopilot obeys it
    name = message.get_type()
    if name in _SETTINGS and getattr(message, "mission_type", _FENCE) == _FENCE:
        return None
    if name == "SET_POSITION_TARGET_GLOBAL_INT":
        return _LEGS
    if name not in ("COMMAND_LONG", "COMMAND_INT"):
        return frozenset()
    return _moves(message, name, flavour)


def _moves(message: Any, name: str, flavour: str) -> frozenset[MotionKind] | None:
    match message.command:
        case 176:  # DO_SET_MODE
            return _MODES[flavour].get((int(message.param2), int(message.param3)), frozenset())
        case 400 if message.param1 == 1 and message.param2 == 0:  # COMPONENT_ARM_DISARM
            return frozenset({MotionKind.CLIMB})
        case 22:  # NAV_TAKEOFF
            return frozenset({MotionKind.CLIMB})
        case 178:  # DO_CHANGE_SPEED
            return _LEGS
        case 192 if name == "COMMAND_INT":  # DO_REPOSITION
            return frozenset({MotionKind.HOLD}) if (message.x, message.y) == (_NOWHERE, _NOWHERE) else _LEGS
    if name == "COMMAND_LONG" and message.command in _PAYLOAD:
        return None
    return None if message.command in _ASKS else frozenset()


Obeyed = tuple[SentFrame, frozenset[MotionKind]]
Motion = Sequence[Obeyed]
"""Motion frames in the order of sending, each with the kinds of motion that it can belong to."""


def _motion(flown: ScenarioFlown) -> Motion:
    read = ((frame, moves(frame.octets, flown.flavour)) for frame in flown.frames)
    return sorted(((frame, kinds) for frame, kinds in read if kinds is not None), key=lambda each: each[0].sent_us)


# ---------------------------------------------------------------- takeovers


def _takeovers(flown: ScenarioFlown, motion: Motion, excuses: Excuses) -> tuple[list[JudgedFailure], int | None]:
    """Return failures for motion frames that were sent later than W after a takeover took effect.

    Three cases are exceptions, because no report shows the takeover (docs/adr/0034): a frame in flight undid the
    takeover; the pilot stopped a vehicle that had stopped, or was stopping, by the runtime's command; the vehicle is in
    the mode of the runtime's last frame, which was lost, so that the report looks as if that frame had arrived.
    """
    times = [sample.at_us for sample in flown.samples]
    found, latest, crossed = list[JudgedFailure](), None, False
    for frame, kinds, since_us, last, met in _after_takeovers(flown, motion, times):
        crossed = crossed or met
        after_us = frame.sent_us - since_us
        latest = max(latest or 0, after_us)
        within_us = MODE_WITHIN_US[flown.flavour] + flown.tick_us + flown.wait_us
        if after_us <= within_us + excuses.delay_us(since_us, frame.sent_us):
            crossed = crossed or frame.heard_us is not None
            continue
        text = f"{_name(frame)} was sent {after_us / 1e6:.2f} s after the takeover at {since_us / 1e6:.2f} s"
        lands = kinds == {MotionKind.LAND} and not flown.samples[bisect_left(times, frame.sent_us)].in_air
        stood = excuses.paused_at(since_us) and _stood(flown, motion, times, last, since_us)
        as_lost = _flies_as_lost(flown, motion, times, since_us, max(since_us, frame.sent_us - within_us))
        cause = "crossed" if crossed else "unseen" if stood or as_lost else "ground" if lands else None
        crossed = crossed or (as_lost and frame.heard_us is not None)
        found.append(JudgedFailure("motion-after-takeover", frame.sent_us, text, after_us, cause))
    return found, latest


def _after_takeovers(
    flown: ScenarioFlown, motion: Motion, times: Sequence[int]
) -> Iterator[tuple[SentFrame, frozenset[MotionKind], int, Obeyed | None, bool]]:
    """Yield the motion frames after a takeover, with the time of the takeover, the last frame that was obeyed before,
    and whether a frame arrived at the very moment of a takeover.
    """
    last, met = None, False
    for frame, kinds in motion:
        at = bisect_left(times, frame.sent_us)
        since_us = flown.samples[at].taken_over_us if at < len(times) else None
        if since_us is not None and (frame.heard_us or frame.sent_us) > since_us:
            yield frame, kinds, since_us, last, met
        else:
            last = last if frame.heard_us is None else (frame, kinds)
            met = met or (since_us is not None and frame.heard_us == since_us)


def _stood(flown: ScenarioFlown, motion: Motion, times: Sequence[int], last: Obeyed | None, at_us: int) -> bool:
    """Return whether the vehicle had stopped, or was stopping, by the runtime's command."""
    then = flown.samples[bisect_left(times, at_us)]
    if not then.in_air:
        return False
    shown = _obeyed(motion, at_us - _SHOWS_US)
    return _ends_at(last, then) or _ends_at(shown, then) or _stops(last, then, flown.samples, times)


def _obeyed(motion: Motion, by_us: int) -> Obeyed | None:
    """Return the last motion frame that had arrived by a time, whose effect a report could show then."""
    return next((each for each in reversed(motion) if each[0].heard_us is not None and each[0].heard_us <= by_us), None)


def _ends_at(last: Obeyed | None, sample: TruthSample) -> bool:
    """Return whether a pause at this place looks like the end of the last command: a stop, a climb, or a leg that ends
    within PX4's reported stopping distance.
    """
    if last is None:
        return False
    frame, kinds = last
    if kinds in ({MotionKind.HOLD}, {MotionKind.CLIMB}):
        return _is_still(sample)
    message = dialect.MAVLink(None).decode(bytearray(frame.octets))
    if getattr(message, "command", None) != _REPOSITION:
        return False
    north, east = (message.x - sample.latitude) * _MM, (message.y - sample.longitude) * _MM
    left = hypot(north, east * cos(radians(sample.latitude / 1e7)))
    speed = sample.speed_mm_s
    ahead = 0 if _is_still(sample) else speed * (speed / _TOLD_BRAKING_MM_S2 / 2 + _TOLD_DELAY_S)
    return abs(left - ahead) <= _SAME_MM


def _stops(last: Obeyed | None, then: TruthSample, samples: Sequence[TruthSample], times: Sequence[int]) -> bool:
    """Return whether the vehicle is slowing down by the runtime's stop command."""
    if last is None or last[1] != {MotionKind.HOLD} or last[0].heard_us is None:
        return False
    told = samples[bisect_left(times, last[0].heard_us)]
    return then is told or _fast_mm_s(then) < _fast_mm_s(told)


def _fast_mm_s(sample: TruthSample) -> float:
    return hypot(sample.speed_mm_s, sample.climb_mm_s)


def _flies_as_lost(flown: ScenarioFlown, motion: Motion, times: Sequence[int], from_us: int, to_us: int) -> bool:
    """Return whether each mode between two times is the one requested by the last frame before it, which was lost."""
    mode, before_us = None, from_us
    for sample in flown.samples[bisect_left(times, from_us) : bisect_left(times, to_us) + 1]:
        if sample.mode is not mode:
            mode = sample.mode
            sent = bisect_left(motion, before_us, key=lambda each: each[0].sent_us)
            if sent == 0 or _lost_mode(motion[sent - 1][0], flown.flavour) is not mode:
                return False
        before_us = sample.at_us
    return True


def _lost_mode(frame: SentFrame, flavour: str) -> FlightMode | None:
    """Return the mode that a lost frame requested, if that mode reports no target by which to tell who chose it."""
    if frame.heard_us is not None:
        return None
    message = dialect.MAVLink(None).decode(bytearray(frame.octets))
    if getattr(message, "command", None) != _SET_MODE:
        return None
    return _NO_TARGET[flavour].get((int(message.param2), int(message.param3)))


def _name(frame: SentFrame) -> str:
    message = dialect.MAVLink(None).decode(bytearray(frame.octets))
    number = getattr(message, "command", None)
    known = dialect.enums["MAV_CMD"].get(number) if number is not None else None
    return str(known.name if known is not None else message.get_type())


# ---------------------------------------------------------------- timing


def _reactions(flown: ScenarioFlown, motion: Motion, excuses: Excuses) -> tuple[list[JudgedFailure], int | None]:
    """Check the time from the cause of a fallback to its first frame: a turn of the loop, and the time that the
    autopilot takes to report its mode.
    """
    sent = [frame.sent_us for frame, _ in motion]
    found, latest = list[JudgedFailure](), None
    within_us = flown.wait_us + 2 * flown.tick_us
    for life in flown.lives:
        ends = (*(each.acted_us for each in life.reactions[1:]), life.ended_us + 1)
        for reaction, end_us in zip(life.reactions, ends, strict=False):
            first_us = next((each for each in sent if reaction.acted_us <= each < end_us), None)
            if first_us is None:
                continue  # nothing had to be, or could be, sent
            took_us = first_us - reaction.heard_us
            latest = max(latest or 0, took_us)
            slow_us = _slow_mode_us(flown.frames, reaction.heard_us) if took_us > within_us else 0
            if took_us > within_us + slow_us + 2 * excuses.delay_us(reaction.heard_us, first_us, silences=True):
                text = f"a fallback took {took_us / 1e6:.3f} s to its first frame; the bound is {within_us / 1e6:.3f} s"
                found.append(JudgedFailure("late", first_us, text, took_us))
    return found, latest


def _slow_mode_us(frames: Sequence[SentFrame], from_us: int) -> int:
    """Return how long after `from_us` the autopilot takes to answer the pending request for its mode."""
    for frame in frames:
        if frame.heard_us is not None and (frame.obeyed_us or 0) > from_us and _asks_for_mode(frame.octets):
            return (frame.obeyed_us or 0) - max(frame.heard_us, from_us)
    return 0


def _asks_for_mode(octets: bytes) -> bool:
    message = dialect.MAVLink(None).decode(bytearray(octets))
    return getattr(message, "command", None) == _REQUEST_MESSAGE and message.param1 == _HEARTBEAT


def _permits(flown: ScenarioFlown, motion: Motion) -> Iterator[JudgedFailure]:
    """Check that first frames are sent within their permit's validity, and those of steps within the deadline."""
    kinds = {contract.name: contract.motion.kind for contract in flown.policy.contracts}
    for life in flown.lives:
        records = records_of(life)
        commands = list(_commands(records, flown.start_us))
        for decision, record in _decided(records):
            kind, at_us = kinds.get(record["detail"]), record["at_us"] - flown.start_us
            # later frames belong to the next command of the same kind
            later = [each.at_us for each in commands if kinds.get(each.skill) == kind and each.at_us > at_us]
            end_us = min([life.ended_us + 1, *later])
            frames = (frame for frame, parts in motion if kind in parts and at_us <= frame.sent_us < end_us)
            first = next(frames, None)
            if first is not None:
                yield from _in_time(flown, first, decision)


def _decided(records: Sequence[dict[str, Any]]) -> Iterator[tuple[dict[str, Any], dict[str, Any]]]:
    """Yield each decision with its first dispatch; a repeated dispatch uses another permit, or a standing one."""
    decided: dict[tuple[int, int, int], dict[str, Any]] = {}
    for record in records:
        ref = (record.get("kind", -1), record.get("step", -1), record.get("link", -1))
        if record["type"] == "decision":
            decided[ref] = record
        elif record.get("event") == "dispatched" and ref in decided:
            yield decided.pop(ref), record


def _in_time(flown: ScenarioFlown, first: SentFrame, decision: dict[str, Any]) -> Iterator[JudgedFailure]:
    if decision["at_us"] > first.sent_us + flown.start_us:
        return
    after_us = first.sent_us - (decision["valid_until_us"] - flown.start_us)
    if after_us > 0:
        text = f"{_name(first)} was sent {after_us / 1e6:.3f} s after its permit had expired"
        yield JudgedFailure("late", first.sent_us, text, after_us)
    if decision["kind"] == 0:
        contract = flown.mission.invocations[decision["step"]].contract
        released_us = max([decision["context"]["released_us"], *(each[3] for each in decision["context"]["approvals"])])
        after_us = first.sent_us + flown.start_us - released_us - contract.deadline_us
        if after_us > 0:
            text = f"{step_words(decision['step'])} began {after_us / 1e6:.3f} s after its deadline"
            yield JudgedFailure("late", first.sent_us, text, after_us)


# ---------------------------------------------------------------- logs


def _logs(flown: ScenarioFlown) -> Iterator[JudgedFailure]:
    for life in flown.lives:
        if life.ending is None and not any(line.endswith(b"\n") for line in life.lines):
            continue  # killed before it began a log; frames that it sent are unlogged effects
        auditor = Auditor(flown.root)
        for line in life.lines:
            auditor.take(line)
        report = auditor.audit().report
        if report.verdict is LogVerdict.VERIFIED:
            continue
        at_us = max(0, report.last_us - flown.start_us)
        if report.failure is None:
            missing = report.shortfall
            text = "" if missing is None else f"{missing.slug}: {missing.text}"
            yield JudgedFailure("log", life.ended_us, f"incomplete: {text}")
            continue
        auditor = Auditor(flown.root, derive=False)
        for line in life.lines:
            auditor.take(line)
        slug = "derive" if auditor.audit().report.failure is None else "log"
        yield JudgedFailure(
            slug, at_us, f"record {report.failure.record}: {report.failure.slug}: {report.failure.text}"
        )


def _images(flown: ScenarioFlown) -> Iterator[JudgedFailure]:
    """Yield recorded images that the camera did not store, or not with that place."""
    stored = {each.utc_us: each for each in flown.images}
    for life in flown.lives:
        for record in records_of(life):
            if record["type"] != "effect" or record["event"] != "image":
                continue
            told, at_us = msgspec.json.decode(record["detail"]), record["at_us"] - flown.start_us
            if told["index"] is None:
                continue
            true = stored.get(told["utc_us"])
            if true is None:
                yield JudgedFailure("untrue", at_us, f"image {told['index']} was recorded and never stored")
            elif (told["latitude"], told["longitude"]) != (true.latitude, true.longitude):
                yield JudgedFailure("untrue", at_us, f"image {told['index']} was recorded with another place")


class _Sent(NamedTuple):
    """A command of a log: when it was dispatched, and when and how it ended (never: None, empty)."""

    at_us: int
    skill: str
    over_us: int | None
    over: str


def _unlogged(flown: ScenarioFlown, motion: Motion) -> Iterator[JudgedFailure]:
    """Yield motion frames without a matching command in the log: the last command has another kind, or has ended."""
    kinds = {contract.name: contract.motion.kind for contract in flown.policy.contracts}
    for life in flown.lives:
        commands = list(_commands(records_of(life), flown.start_us))
        for frame, parts in motion:
            if life.began_us <= frame.sent_us <= life.ended_us:
                why = _unexplained(
                    frame.sent_us, [each for each in commands if each.at_us <= frame.sent_us], parts, kinds
                )
                if why:
                    yield JudgedFailure("unlogged-effect", frame.sent_us, f"{_name(frame)} was sent{why}")
    for frame, _ in motion:
        if not any(life.began_us <= frame.sent_us <= life.ended_us for life in flown.lives):
            yield JudgedFailure("unlogged-effect", frame.sent_us, f"{_name(frame)} was sent while no process ran")


def _payload(flown: ScenarioFlown) -> Iterator[JudgedFailure]:
    """Yield commands to payload that were sent outside of a step whose skill emits them, except those that end what
    such a step began.
    """
    emitted = {each.name: _may_send(each) for each in flown.policy.contracts}
    sent = [(frame, message) for frame in flown.frames if (message := _payload_command(frame.octets)) is not None]
    for life in flown.lives:
        commands_sent = list(_commands(records_of(life), flown.start_us))
        for frame, message in sent:
            if life.began_us <= frame.sent_us <= life.ended_us:
                begun = [each for each in commands_sent if each.at_us <= frame.sent_us]
                if not _emitted(message, frame.sent_us, begun, emitted):
                    text = f"{_name(frame)} was sent outside of a step that emits it"
                    yield JudgedFailure("unlogged-effect", frame.sent_us, text)
    for frame, _ in sent:
        if not any(life.began_us <= frame.sent_us <= life.ended_us for life in flown.lives):
            yield JudgedFailure("unlogged-effect", frame.sent_us, f"{_name(frame)} was sent while no process ran")


def _may_send(contract: Contract) -> frozenset[int]:
    """Return the commands to payload that a contract emits or implies."""
    commands = frozenset(each.command for each in contract.emits)
    return commands | {_CONTROL} if _POINT in commands else commands


def _payload_command(octets: bytes) -> Any:
    """Return the message of a command to payload; None if it is none."""
    if octets[:1] != b"\xfd" or int.from_bytes(octets[7:10], "little") != dialect.MAVLINK_MSG_ID_COMMAND_LONG:
        return None
    message = dialect.MAVLink(None).decode(bytearray(octets))
    return message if message.command in _PAYLOAD else None


def _emitted(message: Any, sent_us: int, begun: Sequence[_Sent], emitted: Mapping[str, frozenset[int]]) -> bool:
    """Whether a command to payload belongs to the running step, or ends what a step before began."""
    number = message.command
    ends = number in _ENDS and (number != _CONTROL or message.param1 == _GIVES_BACK)
    if ends and any(_ENDS[number] in emitted.get(each.skill, ()) for each in begun):
        return True
    if not begun or number not in emitted.get(begun[-1].skill, ()):
        return False
    return begun[-1].over_us is None or begun[-1].over_us >= sent_us


def _commands(records: Sequence[dict[str, Any]], start_us: int) -> Iterator[_Sent]:
    effects = [record for record in records if record["type"] == "effect" and record["token"] >= 0]
    over: dict[int, dict[str, Any]] = {}
    for record in effects:
        if record["event"] != "dispatched":
            over.setdefault(record["token"], record)
    for record in effects:
        if record["event"] == "dispatched":
            end = over.get(record["token"])
            ended = (None, "") if end is None else (end["at_us"] - start_us, end["event"])
            yield _Sent(record["at_us"] - start_us, record["detail"], *ended)


def _unexplained(sent_us: int, begun: Sequence[_Sent], parts: frozenset[MotionKind], kinds: Mapping[str, int]) -> str:
    """Return why a frame belongs to no dispatched command; empty if it may belong to one."""
    if not begun:
        return ", but no command was dispatched"
    may_be = [each for each in begun if each.at_us == sent_us] + [each for each in begun if each.at_us < sent_us][-1:]
    fitting = [each for each in may_be if kinds.get(each.skill) in parts]
    if not fitting:
        return f", but the last command was `{begun[-1].skill}`"
    if all(each.over_us is not None and each.over_us < sent_us for each in fitting):
        return f" after `{fitting[0].skill}` had ended: {fitting[0].over}"
    return ""
