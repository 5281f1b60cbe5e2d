"""The checks of a qualification: they compare the observations with the assumptions of the adapters and the signed
vehicle. Pure: the same observations give the same checks. Each check states the expected and the measured value;
without an observation it is unchecked, with the reason. docs/flying/qualify.md lists them.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from math import hypot
from typing import Final

from rtshcua.adapters.doctor.diagnosis import MissionVerdict
from rtshcua.adapters.qualification.observed import (
    MotionSample,
    ObservedCommand,
    ObservedQualification,
    ObservedSilence,
    ObservedSortie,
    ObservedTakeover,
    TakeoverKind,
)
from rtshcua.adapters.qualification.sortie import SILENCES_US, SORTIES
from rtshcua.adapters.vehicle.effects import STILL, apart
from rtshcua.adapters.vehicle.manoeuvre import RESULTS, RETRY_US
from rtshcua.adapters.vehicle.streams import AT_TIMES, SLOW
from rtshcua.adapters.vehicle.supervision import Brakes
from rtshcua.decision.volume import SHORT, cone
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.policy import Policy, VehicleLimits
from rtshcua.onboard.ports import Ending
from rtshcua.onboard.runtime.limits import Limits
from rtshcua.wire.qualification import CheckOutcome, QualificationCheck

HELD, FAILED, TOLD, UNCHECKED = CheckOutcome
_SECOND: Final = 1_000_000
_US, _MM, _MM_S = "us", "mm", "mm/s"


def judge(observed: ObservedQualification, policy: Policy) -> list[QualificationCheck]:
    """All checks, in the order of the flights."""
    return [
        _firmware(observed),
        *_fence(observed),
        *_settings(observed),
        *[_sortie(each) for each in observed.sorties],
        *_speeds(observed, policy.vehicle),
        *_stops(observed, policy.vehicle),
        *_ends(observed, policy.vehicle),
        *_answers(observed),
        _heartbeat(observed),
        *_takeovers(observed),
        *_silences(observed),
        *_streams(observed),
    ]


def _check(
    slug: str, holds: bool, expected: str, measured: str, limit: int | None = None, found: int | None = None,
    unit: str = "", advice: str = "",
) -> QualificationCheck:  # fmt: skip
    outcome = int(HELD if holds else FAILED)
    return QualificationCheck(slug, outcome, expected, measured, limit, found, unit, "" if holds else advice)


def _unchecked(slug: str, expected: str, why: str) -> QualificationCheck:
    return QualificationCheck(slug, int(UNCHECKED), expected, why)


def _why(observed: ObservedQualification, sortie: str) -> str:
    """Why something in a sortie was not observed."""
    return observed.missing.get(sortie, "not reached")


def _metres(mm: int) -> str:
    return f"{mm / 1_000:.1f} m"


def _speed(mm_s: int) -> str:
    return f"{mm_s / 1_000:.1f} m/s"


def _time(us: int) -> str:
    return f"{us / 1_000:.0f} ms" if us < 10 * _SECOND else f"{us / _SECOND:.1f} s"


# ---------------------------------------------------------------- the vehicle and its settings


def _firmware(observed: ObservedQualification) -> QualificationCheck:
    firmware = observed.firmware
    told = "the vehicle does not report its version" if firmware is None else firmware.text
    return _check("firmware/told", firmware is not None, "AUTOPILOT_VERSION", told)


def _fence(observed: ObservedQualification) -> Iterator[QualificationCheck]:
    slug, expected = "fence/read-back", "the airspace is uploaded and read back unchanged"
    flown = next(iter(observed.sorties), None)
    if flown is None or flown.fence is None:
        why = "nothing was flown" if flown is None else "the vehicle's fence was left unchanged"
        yield _unchecked(slug, expected, why)
        yield _unchecked("fence/on", "enabled in flight", why)
        return
    yield _check(slug, flown.fence_read, expected, flown.fence)
    off = [
        f"`{name}` is {'not reported' if value is None else f'{value:g}'}"
        for name, (bits, value) in flown.switches.items()
        if value is None or int(value) & bits != bits
    ]
    idle = [each for each in observed.settings if each.slug in _FENCE_ACTIONS and each.verdict is not MissionVerdict.OK]
    found = [*off, *[each.found for each in idle]]
    advice = idle[0].advice if idle else "a switch of the remote control, a script or a mission changes it"
    expected = "enabled in flight, with an action"
    yield _check("fence/on", not found, expected, "; ".join(found) or "enabled", advice=advice)


_FENCE_ACTIONS: Final = ("settings/gf_action", "settings/fence_action")


def _settings(observed: ObservedQualification) -> Iterator[QualificationCheck]:
    """The doctor's findings; a warning fails nothing."""
    well = 0
    for each in observed.settings:
        if each.verdict is MissionVerdict.OK:
            well += 1
            continue
        if each.slug == "settings/fence_enable":
            continue  # a flight of this program switches it on
        outcome = FAILED if each.verdict is MissionVerdict.STOP else TOLD
        yield QualificationCheck(each.slug, int(outcome), each.needed, each.found, advice=each.advice)
    if well:
        yield _check("settings/others", True, "no setting that interferes", f"{well} other parameters are fine")
    elif not observed.settings:
        yield _unchecked("settings/others", "no setting that interferes", "no parameter was read")


# ---------------------------------------------------------------- the course of a sortie

_PLANNED: Final = {
    each.name: Ending.COMPLETED if each.takeover is None else Ending.STOOD_DOWN for each in SORTIES
}  # fmt: skip


def _sortie(flown: ObservedSortie) -> QualificationCheck:
    """Whether a sortie went as planned: each command had its reported effect, and the vehicle is down."""
    failed = [each for each in flown.commands if each.how not in ("succeeded", "replaced", "taken-over", "")]
    planned = _PLANNED[flown.name]
    pauses = flown.takeover is not None and flown.takeover.kind is TakeoverKind.PAUSE
    well = flown.down and flown.ending == planned and (pauses or not failed)
    words = [f"`{each.skill}` {each.how}" for each in failed] + (
        [] if flown.down else ["it was not seen on the ground"]
    )
    measured = "; ".join([flown.ending, *words])
    return _check(f"sortie/{flown.name}", well, f"{planned}, and down", measured)


def ends_after(flown: ObservedSortie) -> str | None:
    """Why no other sortie follows this one, in words; None if it went as planned. After a takeover, a failure, or
    without a landing no further one is flown.
    """
    check = _sortie(flown)
    if check.outcome == HELD:
        return None
    return f"not flown: sortie `{flown.name}` did not go as planned ({check.measured})"


# ---------------------------------------------------------------- speeds

#: the tolerance of a declared or commanded speed, in 1/100 and in mm/s, for gusts and reports
_MORE, _NOISE = 110, 300
#: the least speed in 1/100: of the declared climb, which times climbs; of the commanded speed
_CLIMBS, _FLIES = 33, 50
_RISES: Final = 300  # mm/s
#: us: how long a climb has to keep a speed
_KEPT_US: Final = 2_000_000


def _speeds(observed: ObservedQualification, vehicle: VehicleLimits) -> Iterator[QualificationCheck]:
    climbs = [pair for pair in _flown(observed, MotionKind.CLIMB) if len(pair[1]) > 1]
    most, least = vehicle.climb * _MORE // 100 + _NOISE, vehicle.climb * _CLIMBS // 100
    expected = f"{_speed(least)} to {_speed(most)} (the policy: at most {_speed(vehicle.climb)})"
    if climbs:
        peak = max(sample.climb for _, samples in climbs for sample in samples)
        kept = max(_kept_climb(samples) for _, samples in climbs)
        slow = kept < least
        measured = f"{_speed(kept)} over {_KEPT_US // _SECOND} s, {_speed(peak)} at most"
        advice = "declare its real climb rate, or change the autopilot's (`rtshcua doctor` names the parameter)"
        limit, found = (least, kept) if slow else (most, peak)
        yield _check("climb/speed", not slow and peak <= most, expected, measured, limit, found, _MM_S, advice)
    else:
        yield _unchecked("climb/speed", expected, _why(observed, "climb"))
    legs = [pair for pair in _flown(observed, MotionKind.FLY) if len(pair[1]) > 1]
    if not legs:
        yield _unchecked("fly/speed", f"at most {_speed(vehicle.speed)}", _why(observed, "leg"))
        return
    asked = legs[0][0].speed
    peak = max(sample.speed for _, samples in legs for sample in samples)
    most = min(asked or vehicle.speed, vehicle.speed) * _MORE // 100 + _NOISE
    least = asked * _FLIES // 100
    advice = "paths and stopping distances are computed from these speeds: correct the autopilot's speed parameters"
    expected = f"{_speed(least)} to {_speed(most)} (asked for: {_speed(asked)})"
    yield _check("fly/speed", least <= peak <= most, expected, _speed(peak), most, peak, _MM_S, advice)


def _kept_climb(samples: Sequence[MotionSample]) -> int:
    """The fastest climb that was kept for this long, in mm/s: a takeoff takes metres to reach its speed (PX4:
    MPC_TKO_SPEED, ramped), so the mean of an interrupted one is misleading.
    """
    rising = [each for each in samples if each.climb >= _RISES] or list(samples)
    best, first = 0, 0
    for each in rising:
        while first + 1 < len(rising) and each.at_us - rising[first + 1].at_us >= _KEPT_US:
            first += 1
        passed = each.at_us - rising[first].at_us
        if passed >= _KEPT_US or (each is rising[-1] and first == 0):
            best = max(best, (each.height - rising[first].height) * _SECOND // passed if passed else 0)
    return best


def _flown(observed: ObservedQualification, kind: MotionKind) -> list[tuple[ObservedCommand, list[MotionSample]]]:
    """The commands of a kind that were sent, and the samples during each."""
    return [
        (command, _while(sortie, command))
        for sortie in observed.sorties
        for command in sortie.commands
        if command.kind == kind and command.sent_us is not None
    ]


def _while(sortie: ObservedSortie, command: ObservedCommand) -> list[MotionSample]:
    since, until = command.sent_us or command.begun_us, command.ended_us
    return [each for each in sortie.samples if since <= each.at_us and (until is None or each.at_us <= until)]


# ---------------------------------------------------------------- stopping and holding

#: the delay of reports in us of way, and their error in mm
_LATE_US: Final = 200_000
_OFF: Final = 500
#: mm that a holding vehicle may drift in any case
_STRAYS: Final = 2_000


def _stops(observed: ObservedQualification, vehicle: VehicleLimits) -> Iterator[QualificationCheck]:
    brakes = Brakes.of(vehicle)
    for name, motion in (("climb", MotionKind.CLIMB), ("leg", MotionKind.FLY)):
        slug = f"stop/{motion.name.lower()}"
        flown, hold = observed.sortie(name), None
        if flown is not None:
            hold = next(
                (
                    after
                    for before, after in pairwise(flown.commands)
                    if before.kind == motion and before.shortened and after.kind == MotionKind.HOLD
                ),
                None,
            )
        if flown is None or hold is None or hold.sent_us is None or not _while(flown, hold):
            yield _unchecked(slug, "stops as `brakes` declares", _why(observed, name))
            yield _unchecked(f"hold/{motion.name.lower()}", "stays where it stopped", _why(observed, name))
            continue
        yield _stop(slug, flown, hold, brakes, declared=bool(vehicle.braking))
        yield _hold(f"hold/{motion.name.lower()}", _while(flown, hold), max(vehicle.position_error, _STRAYS))


def _stop(
    slug: str, flown: ObservedSortie, hold: ObservedCommand, brakes: Brakes, *, declared: bool
) -> QualificationCheck:
    told_us, samples = hold.sent_us or 0, _while(flown, hold)
    begins_us = told_us + brakes.reaction_us
    near = [each for each in flown.samples if told_us - 2 * _LATE_US <= each.at_us <= begins_us]
    speed = max(map(_whole_speed, near or samples[:1]))
    limit = speed * brakes.reaction_us // _SECOND + speed * speed // (2 * brakes.braking)
    limit += speed * _LATE_US // _SECOND + _OFF
    within_us = brakes.stands_us(speed)
    stood = _stood(samples)
    until = samples if stood is None else samples[: stood + 1]
    way = max(_way(samples[0], each) for each in until)
    whose = "`brakes`" if declared else "no `brakes` declared: 1 m/s^2 after 1 s is assumed"
    expected = f"within {_metres(limit)} and {_time(within_us)} from {_speed(speed)} ({whose})"
    advice = "declare `brakes` slightly worse than the worst measured stop, in a new version of the policy"
    if stood is None:
        measured = f"the vehicle does not stop: {_metres(way)} on, it flies at {_speed(_whole_speed(samples[-1]))}"
        return _check(slug, False, expected, measured, limit, way, _MM, "its hold is not reliable: do not fly it")
    took_us = samples[stood].at_us - told_us
    holds = way <= limit and took_us <= within_us
    return _check(slug, holds, expected, f"{_metres(way)} in {_time(took_us)}", limit, way, _MM, advice)


def _stood(samples: Sequence[MotionSample]) -> int | None:
    """The sample from which on it stands; None where it does not."""
    moving = [number for number, each in enumerate(samples) if _whole_speed(each) > STILL]
    stood = moving[-1] + 1 if moving else 0
    return stood if stood < len(samples) else None


def _hold(slug: str, samples: Sequence[MotionSample], limit: int) -> QualificationCheck:
    expected, stood = f"stays within {_metres(limit)} of where it stopped", _stood(samples)
    if stood is None:
        return _check(slug, False, expected, "the vehicle does not come to a stop")
    strays = max(_way(samples[stood], each) for each in samples[stood:])
    return _check(slug, strays <= limit, expected, _metres(strays), limit, strays, _MM)


def _whole_speed(sample: MotionSample) -> int:
    return round(hypot(sample.speed, sample.climb))


def _way(one: MotionSample, other: MotionSample) -> int:
    return round(hypot(_across(one, other), one.height - other.height))


def _across(one: MotionSample, other: MotionSample) -> int:
    return round(apart(other.latitude, other.longitude, one.latitude, one.longitude))


# ---------------------------------------------------------------- return and landing

#: mm between home and the end of a return, or between the begin and the end of a landing, in addition to the position
#: error
_ENDS: Final = 2_000


def _ends(observed: ObservedQualification, vehicle: VehicleLimits) -> Iterator[QualificationCheck]:
    limit = vehicle.position_error + _ENDS
    yield _ended(
        observed,
        "return/home",
        "leg",
        MotionKind.HOME,
        limit,
        f"lands within {_metres(limit)} of home, and disarms",
        lambda flown, _: flown.samples[0],
    )
    yield _highest(observed, vehicle)
    yield _lowest_across(observed, vehicle)
    yield _ended(
        observed, "land/down", "climb", MotionKind.LAND, limit,
        f"lands within {_metres(limit)} of where it began to, and disarms", lambda _, samples: samples[0],
    )  # fmt: skip


def _ended(
    observed: ObservedQualification, slug: str, name: str, kind: MotionKind, limit: int, expected: str,
    to: Callable[[ObservedSortie, Sequence[MotionSample]], MotionSample],
) -> QualificationCheck:  # fmt: skip
    flown = observed.sortie(name)
    command = None if flown is None else next((each for each in flown.commands if each.kind == kind), None)
    samples = [] if flown is None or command is None else _while(flown, command)
    if flown is None or command is None or not samples:
        return _unchecked(slug, expected, _why(observed, name))
    off = _across(samples[-1], to(flown, samples))
    took = _time(samples[-1].at_us - samples[0].at_us)
    down = command.how == "succeeded" and flown.down
    measured = f"{_metres(off)} off, after {took}" if down else f"{command.how or 'not ended'}, {_metres(off)} off"
    advice = "every fallback chain ends with this: do not fly it"
    return _check(slug, down and off <= limit, expected, measured, limit, off, _MM, advice)


def _highest(observed: ObservedQualification, vehicle: VehicleLimits) -> QualificationCheck:
    slug, flown = "return/height", observed.sortie("leg")
    command = None if flown is None else next((each for each in flown.commands if each.kind == MotionKind.HOME), None)
    samples = [] if flown is None or command is None else _while(flown, command)
    if not vehicle.return_altitude or not samples:
        why = _why(observed, "leg") if vehicle.return_altitude else "the policy declares no `return at`"
        return _unchecked(slug, "returns no higher than declared", why)
    limit = max(vehicle.return_altitude, samples[0].height) + _ENDS
    highest = max(each.height for each in samples)
    expected = f"no higher than {_metres(limit)} (`return at {vehicle.return_altitude / 1_000:g} m`)"
    return _check(slug, highest <= limit, expected, _metres(highest), limit, highest, _MM)


def _lowest_across(observed: ObservedQualification, vehicle: VehicleLimits) -> QualificationCheck:
    """The least height of a return between its climb and its descent, if it begins outside of the cone over home."""
    slug, flown = "return/across", observed.sortie("leg")
    expected, clear = "flies home at the declared height", vehicle.position_error + _ENDS
    command = None if flown is None else next((each for each in flown.commands if each.kind == MotionKind.HOME), None)
    samples = [] if flown is None or command is None else _while(flown, command)
    if flown is None or not vehicle.return_altitude or not samples:
        why = _why(observed, "leg") if vehicle.return_altitude else "the policy declares no `return at`"
        return _unchecked(slug, expected, why)
    start, home = samples[0], flown.samples[0]
    between = [each for each in samples if min(_across(each, start), _across(each, home)) > clear]
    if _across(start, home) <= cone(vehicle.return_altitude) + vehicle.position_error or not between:
        return _unchecked(slug, expected, "it returned from near home, where a low return is allowed")
    limit = max(vehicle.return_altitude, start.height) - SHORT
    lowest = min(each.height for each in between)
    expected = f"no lower than {_metres(limit)} (`return at {vehicle.return_altitude / 1_000:g} m`)"
    advice = "the proofs about the way home do not hold for it: check its cone over home (docs/flying/returns.md)"
    return _check(slug, lowest >= limit, expected, _metres(lowest), limit, lowest, _MM, advice)


# ---------------------------------------------------------------- answers

_UNSUPPORTED: Final = 3  # MAV_RESULT_UNSUPPORTED


def _answers(observed: ObservedQualification) -> Iterator[QualificationCheck]:
    answers = [each for sortie in observed.sorties for each in sortie.answers]
    if not answers:
        yield _unchecked("answers/come", "each command is acknowledged", "nothing was sent")
        return
    silent = sorted({each.command for each in answers if each.answered_us is None})
    expected, words = "each command is acknowledged", f"{len(answers)} of {len(answers)}"
    lost = sum(each.answered_us is None for each in answers)
    if silent:
        words = f"{len(answers) - lost} of {len(answers)}; none for MAV_CMD {', '.join(map(str, silent))}"
    advice = "check the link first: unanswered commands are repeated and fail late"
    yield _check("answers/come", not silent, expected, words, 0, lost, "", advice)
    times = [each.answered_us - each.sent_us for each in answers if each.answered_us is not None]
    if times:
        latest = max(times)
        expected = f"within {_time(RETRY_US)}: after that it is sent again"
        yield _check("answers/late", latest <= RETRY_US, expected, _time(latest), RETRY_US, latest, _US)
    obeyed = {(True, _UNSUPPORTED)}  # other checks judge whether it flew there
    refused = sorted(
        {
            (each.command, each.result)
            for each in answers
            if each.result and (each.asks_no_mode, each.result) not in obeyed
        }
    )
    told = ", ".join(f"MAV_CMD {command} {RESULTS.get(result or 0, result)}" for command, result in refused)
    yield _check("answers/accepted", not refused, "accepted", told or "all")


# ---------------------------------------------------------------- heartbeats and takeovers

#: the share in 1/100 of gaps between heartbeats within the limit: a frame may be lost
_MOST_GAPS: Final = 95
#: us without progress after which a leg counts as stopped short, and by when that is reported
_STALLS_US: Final = 8 * _SECOND
#: us in which an autopilot obeys; the slowest recording took 94 ms
_OBEYS_US: Final = 100_000


def _heartbeat(observed: ObservedQualification) -> QualificationCheck:
    slug, limit = "heartbeat/asked", _within_us(observed)
    gaps = [
        later - earlier
        for sortie in observed.sorties
        for earlier, later in pairwise(sortie.beats)
        if not any(_overlaps(each, earlier, later) for each in sortie.silences)
    ]
    expected = f"on request, every {_time(limit)} in flight"
    if not gaps:
        return _unchecked(slug, expected, "none received in flight")
    most = sorted(gaps)[-(-len(gaps) * _MOST_GAPS // 100) - 1]
    advice = "a motion starts only once the mode is known, so each step would start late"
    return _check(slug, most <= limit, expected, f"{_MOST_GAPS} % within {_time(most)}", limit, most, _US, advice)


def _overlaps(silence: ObservedSilence, since: int, until: int) -> bool:
    end = silence.ended_us if silence.fresh_us is None else silence.fresh_us
    return since <= (end or until) and until >= silence.began_us


def _within_us(observed: ObservedQualification) -> int:
    """W: the time in which a takeover must show, plus the link's delay (docs/adr/0034)."""
    return observed.mode_within_us + (observed.round_trip_us or 0)


def _takeovers(observed: ObservedQualification) -> Iterator[QualificationCheck]:
    for kind in TakeoverKind:
        slug, flown = f"takeover/{kind}", observed.sortie(kind)
        takeover = None if flown is None else flown.takeover
        if flown is None or takeover is None:
            yield _unchecked(slug, "it is detected and nothing more is sent", _why(observed, kind))
        else:
            yield _takeover(slug, flown, takeover, observed)


def _takeover(
    slug: str, flown: ObservedSortie, takeover: ObservedTakeover, observed: ObservedQualification
) -> QualificationCheck:
    sent, shown = takeover.sent_us, takeover.shown_us
    if sent is None:  # by a pilot, at an unknown time
        found = "not detected" if shown is None else f"detected by `{takeover.how}`; the delay is not known"
        return _check(slug, shown is not None and flown.ending == Ending.STOOD_DOWN, "it is detected", found)
    limit = _within_us(observed)
    stalls = takeover.kind is TakeoverKind.PAUSE and takeover.how == "paused"
    if stalls:  # ArduCopter's pause changes neither mode nor target: it shows once the vehicle stands (docs/adr/0034)
        limit = _STALLS_US + 2 * _SECOND + observed.mode_within_us
    expected = f"detected within {_time(limit)}, and no motion frame is sent after that"
    advice = "the program would act against the pilot: do not fly it"
    if shown is None:
        return _check(slug, False, expected, "not detected", limit, None, _US, advice)
    # W counts from the effect, which comes soon after the frame
    sent = max(sent, min(takeover.obeyed_us or sent, sent + (observed.round_trip_us or 0) + _OBEYS_US, shown))
    late = shown - sent
    if takeover.kind is TakeoverKind.MODE:
        if takeover.mode_us is None:
            only = f"by `{takeover.how}` only: no heartbeat reported the mode"
            return _check(slug, False, expected, only, limit, None, _US, advice)
        late = max(late, takeover.mode_us - sent - takeover.unwatched_us)
    moved = takeover.moved_us is not None and takeover.moved_us - sent > limit and not stalls
    measured = f"after {_time(late)}, by `{takeover.how}`"
    if takeover.kind is TakeoverKind.MODE and takeover.unwatched_us:
        measured += f", not counting {_time(takeover.unwatched_us)} while the log was closed and nothing was watched"
    if moved:
        measured += f"; a motion frame was sent {_time((takeover.moved_us or 0) - sent)} after"
    return _check(slug, late <= limit and not moved, expected, measured, limit, late, _US, advice)


# ---------------------------------------------------------------- silences

#: us after which a link counts as silent, and the time of its detection
_SILENT_US: Final = _SECOND
_LOOKS_US: Final = 300_000


def _silences(observed: ObservedQualification) -> Iterator[QualificationCheck]:
    flown = observed.sortie("leg")
    found = {} if flown is None else {each.for_us: each for each in flown.silences}
    fresh_us = Limits().fresh_us
    for for_us in SILENCES_US:
        slug = f"silence/{for_us // _SECOND}s"
        expected = f"it keeps holding, and all signals are fresh within {_time(fresh_us)}"
        silence = found.get(for_us)
        if silence is None:
            yield _unchecked(slug, expected, _why(observed, "leg"))
            continue
        ended = silence.ended_us
        if ended is None or silence.fresh_us is None:
            yield _check(slug, False, expected, "not every stream came back")
            continue
        late = silence.fresh_us - ended
        told = for_us <= _SILENT_US + _LOOKS_US or (
            silence.lost_us is not None
            and silence.lost_us - silence.began_us <= _SILENT_US + _LOOKS_US
            and silence.back_us is not None
        )
        words = ["" if silence.kept else "it stopped holding", "" if told else "the silence was not detected"]
        measured = "; ".join([f"fresh after {_time(late)}", *filter(None, words)])
        yield _check(slug, silence.kept and told and late <= fresh_us, expected, measured, fresh_us, late, _US)


# ---------------------------------------------------------------- streams


def _streams(observed: ObservedQualification) -> Iterator[QualificationCheck]:
    """The streams below half of their requested rate; the heartbeat has its own check."""
    slow: dict[str, tuple[int, int | None]] = {}
    measured = 0
    for sortie in observed.sorties:
        if not any(came for _, came in sortie.streams.values()):
            continue
        measured += 1
        for name, (asked, came) in sortie.streams.items():
            if name in AT_TIMES or name == "HEARTBEAT":
                continue
            if came is None or came > SLOW * asked:
                slow[name] = asked, came
    expected = "each at no less than half of the requested rate"
    if not measured:
        yield _unchecked("streams/delivered", expected, "not measured")
        return
    found = [
        f"{name} {'never' if came is None else f'every {came // 1_000} ms'}, requested every {asked // 1_000} ms"
        for name, (asked, came) in sorted(slow.items())
    ]
    advice = "docs/flying/link.md describes what limits the rates"
    yield _check("streams/delivered", not found, expected, "; ".join(found) or "all", advice=advice)
