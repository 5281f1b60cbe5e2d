"""Further checks of the runtime, from its readings, its log and the true state.

| slug | failure |
|---|---|
| `untrue` | a logged success, or a received position, height or charge, contradicts the true state |
| `no-stop` | a stop reached the vehicle without effect, or was not repeated although it could have arrived |
| `not-watched` | a condition of a running step failed, by the readings, and the step was not aborted |
| `needless` | a running step was aborted although, by the readings, its conditions held or had grace left |
| `chain` | a fallback was not the first possible link, belonged to the wrong chain, or was not tried again |
| `went-on` | a decision or dispatch followed a reported takeover or crash |
| `release` | a step's deadline was not counted from the end of the step before |
| `unrecorded` | a frame that only a step sends was sent before the record of the step's decision was stored |

The judge repeats the supervision with its own rules (`naive_supervision`) from the readings that the loop received.
`untrue` checks those readings.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import hypot
from typing import Any, Final

from rtshcua.model import faults
from rtshcua.model.faults import Fault
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.situation import Now
from rtshcua.model.step_number import step_words
from rtshcua.virtual.excuses import JudgedFailure
from rtshcua.virtual.flight_record import HeardReadings, Life, ScenarioFlown, SentFrame, TruthSample, records_of
from rtshcua.virtual.naive_supervision import DURATION, JudgedState, RunningStep, Span, WatchedStep, supervise
from rtshcua.virtual.zone_truth import local_mm
from rtshcua.wire.request import CONTINGENCY_LINK, FALLBACK_LINK, STEP

Record = dict[str, Any]
Motion = Sequence[tuple[SentFrame, frozenset[MotionKind]]]

#: mm: the error of a reported and of a reached place, from noise, lag and the position's own error
TOLD_MM: Final = 4_000
#: mm and 1/10000: the error of a reported height and charge, from noise and rounding
_TOLD_UP_MM, _TOLD_CHARGE = 1_500, 250
REACHED_MM: Final = 6_000
#: us: the greatest age of a report on a good link
_LATER_US: Final = 1_500_000
#: mm/s: a stop is checked above the first speed; `_STOPS_US` after the reaction time, the vehicle must have lost the
#: second speed, or be slower than the third
_FAST_MM_S, _LOST_MM_S, _SLOW_MM_S = 2_500, 800, 1_200
_STOPS_US: Final = 2_300_000
_STANDS_MM_S: Final = 1_800
#: us: within the first, an unanswered command is sent again; within the second, all tries of the last link are over
_AGAIN_US: Final = 2_000_000
_HELD_OUT_US: Final = 60_000_000
_NEVER: Final = 1 << 60
#: us: a longer pause of the computer is a stall; how long fresh state is awaited; and the number of retries of the
#: last link (docs/flying/supervision.md)
_STALLED_US, _FRESH_US, _TRIES = 1_000_000, 1_500_000, 5
_STOOD_STILL: Final = "stood-still"
#: the truth of a temporal monitor in a record
_TRUTHS: Final = {1: True, 2: False, 4: None}
_ONLY_STEPS: Final = frozenset({MotionKind.FLY, MotionKind.COVER, MotionKind.CLIMB})
_HOMEWARD: Final = frozenset({MotionKind.HOME, MotionKind.LAND})
#: faults that make reports untrue
_DECEIVES: Final = (faults.ReceiverFault, faults.Freeze, faults.MessageStuck, faults.Reboot)
#: faults that disturb a stop
_DISTURBS: Final = (faults.WindStep, faults.Stall, faults.EstimatorUnhealthy)


@dataclass(frozen=True, slots=True)
class LoggedCommand:
    """A command of a log: its begin, end, and how it ended; `until_us` None: it did not end."""

    kind: int
    step: int
    link: int
    motion: MotionKind
    since_us: int
    until_us: int | None
    how: str
    detail: str


class RuntimeChecks:
    """Checks of the runtime in one flight. `motion` are its motion frames."""

    def __init__(self, flown: ScenarioFlown, motion: Motion) -> None:
        self._flown = flown
        self._motion = motion
        self._times = [sample.at_us for sample in flown.samples]
        self._kinds = {contract.name: MotionKind(contract.motion.kind) for contract in flown.policy.contracts}

    def failures(self) -> Iterator[JudgedFailure]:
        """Yield all failures."""
        lives = [life for life in self._flown.lives if life.turns]  # without turns its readings are unknown
        if not lives:
            return
        for life in lives:
            records = records_of(life)
            flights = list(self._flights(records))
            yield from self._succeeded(flights)
            yield from self._stops(flights)
            yield from self._told(life)
            yield from self._watched(life, records, flights)
            yield from self._chains(records, flights)
            yield from self._went_on(records)
            yield from self._released(records)
            yield from self._recorded(life, records)
        yield from self._left()

    # -------------------------------------------------------- the log

    def _at(self, record: Record) -> int:
        return int(record["at_us"]) - self._flown.start_us

    def _flights(self, records: Sequence[Record]) -> Iterator[LoggedCommand]:
        effects = [record for record in records if record["type"] == "effect"]
        for number, record in enumerate(effects):
            if record["event"] != "dispatched" or record["detail"] not in self._kinds:
                continue
            end = next((each for each in effects[number + 1 :] if each["token"] == record["token"]), None)
            yield LoggedCommand(
                record["kind"], record["step"], record["link"], self._kinds[record["detail"]], self._at(record),
                None if end is None else self._at(end),
                "" if end is None else end["event"],
                "" if end is None else end["detail"],
            )  # fmt: skip

    @property
    def _bound_us(self) -> int:
        """The greatest delay of the loop's reaction."""
        return self._flown.wait_us + 2 * self._flown.tick_us

    # -------------------------------------------------------- the true state

    def _between(self, from_us: int, to_us: int) -> Sequence[TruthSample]:
        low = max(bisect_left(self._times, from_us) - 1, 0)
        return self._flown.samples[low : bisect_right(self._times, to_us) + 1]

    def _sample(self, at_us: int) -> TruthSample:
        return self._flown.samples[max(bisect_right(self._times, at_us) - 1, 0)]

    def _before(self, at_us: int, *kinds: type[Fault]) -> bool:
        return any(each.at_us <= at_us and isinstance(each.fault, kinds) for each in self._flown.happened)

    def _during(self, from_us: int, to_us: int, *kinds: type[Fault]) -> bool:
        for each in self._flown.happened:
            if each.at_us <= to_us and isinstance(each.fault, kinds):
                for_us = getattr(each.fault, "for_us", None)
                if for_us is None or each.at_us + for_us >= from_us:
                    return True
        return False

    def _delayed_us(self, at_us: int) -> int:
        """Return the greatest age of a report at a time."""
        late = (faults.LinkFault, faults.StaleSource, faults.Stall, faults.HostStall, faults.MessageSilence)
        return _LATER_US + (8_000_000 if self._during(at_us - 8_000_000, at_us, *late) else 0)

    def _is_others(self, at_us: int) -> bool:
        sample = self._sample(at_us)
        return sample.crashed or sample.taken_over_us is not None

    # -------------------------------------------------------- effects

    def _succeeded(self, flights: Sequence[LoggedCommand]) -> Iterator[JudgedFailure]:
        for flight in flights:
            at_us = flight.until_us
            if at_us is None or self._before(at_us, *_DECEIVES):
                continue
            if flight.how == "landed":
                flight = replace(flight, motion=MotionKind.LAND)
            elif flight.how != "succeeded":
                continue
            seen = self._between(at_us - self._delayed_us(at_us), at_us)
            if any(sample.crashed for sample in seen) or any(self._is_so(flight, sample) for sample in seen):
                continue
            sample = self._sample(at_us)
            what = "landed" if flight.how == "landed" else f"`{flight.motion.name.lower()}` succeeded"
            text = f"logged as {what}, but the vehicle was {sample.up_mm / 1000:.1f} m up at "
            yield JudgedFailure("untrue", at_us, text + f"{sample.speed_mm_s / 1000:.1f} m/s")

    def _is_so(self, flight: LoggedCommand, sample: TruthSample) -> bool:
        match flight.motion:
            case MotionKind.HOME | MotionKind.LAND:
                return not sample.in_air
            case MotionKind.HOLD:
                return sample.speed_mm_s <= _STANDS_MM_S
            case _ if flight.kind != STEP:
                return True
        plan = self._flown.mission.invocations[flight.step].plan
        if flight.motion is MotionKind.CLIMB:
            return sample.up_mm >= plan.altitude - REACHED_MM // 2
        x, y = self._place(sample)
        level = not plan.heights or abs(sample.up_mm - plan.last_height) <= REACHED_MM
        return level and hypot(x - plan.path[-2], y - plan.path[-1]) <= REACHED_MM

    def _place(self, sample: TruthSample) -> tuple[float, float]:
        return local_mm(self._flown.policy, sample.latitude, sample.longitude)

    def _told(self, life: Life) -> Iterator[JudgedFailure]:
        """Check that received places, heights and charges are near the truth at some time since their measurement."""
        found: dict[str, list[tuple[float, int]]] = {}
        for turn in life.turns[::3]:
            if self._before(turn.at_us, *_DECEIVES, faults.EstimatorUnhealthy):
                break
            for heard in turn.heard:
                for what, off in self._off(heard, turn.at_us):
                    found.setdefault(what, []).append((off, turn.at_us))
        for what, all_off in found.items():
            off, at_us = max(all_off)
            if len(all_off) >= 3:
                much = f"{off / 100:.1f} %" if what == "charge" else f"{off / 1000:.1f} m"
                text = f"a received {what} differs by {much} from the truth since its measurement"
                yield JudgedFailure("untrue", at_us, text, round(off))

    def _off(self, heard: HeardReadings, at_us: int) -> Iterator[tuple[str, float]]:
        """Yield the readings with too large an error, and the error, in mm or 1/10000."""
        vehicle, values = self._flown.policy.vehicle, dict(heard.values)
        x, y = values.get(vehicle.position), values.get(vehicle.position + 1)
        height, charge = values.get(vehicle.height), values.get(vehicle.battery)
        if (x, height, charge) == (None, None, None):
            return
        samples = self._between(heard.measured_us - self._flown.start_us, at_us)
        if not samples or not samples[0].in_air:
            return
        if x is not None and y is not None:
            off = min(hypot(x - east, y - north) for east, north in map(self._place, samples))
            if off > TOLD_MM:
                yield "place", off
        if height is not None and (off := min(abs(height - each.up_mm) for each in samples)) > _TOLD_UP_MM:
            yield "height", off
        if charge is not None:  # charges have no time stamp
            since = self._between(at_us - self._delayed_us(at_us), at_us)
            off = min(abs(charge - each.battery) for each in since)
            if off > _TOLD_CHARGE:
                yield "charge", off

    def _stops(self, flights: Sequence[LoggedCommand]) -> Iterator[JudgedFailure]:
        """Check that the vehicle slows down after the first frame of a stop that reached it."""
        after_us = (self._flown.policy.vehicle.reaction_us or 1_000_000) + _STOPS_US
        heard = [(frame.sent_us, frame.heard_us) for frame, _ in self._motion if frame.heard_us is not None]
        for flight in flights:
            if flight.motion is not MotionKind.HOLD:
                continue
            ends_us = _NEVER if flight.until_us is None else flight.until_us
            heard_us = next((us for sent_us, us in heard if flight.since_us <= sent_us < ends_us), None)
            if heard_us is None:
                yield from self._unheard(flight)
            elif heard_us - flight.since_us <= 1_000_000 and ends_us >= heard_us + after_us - 300_000:
                yield from self._slows(heard_us, heard_us + after_us)

    def _slows(self, at_us: int, then_us: int) -> Iterator[JudgedFailure]:
        """Check that an undisturbed vehicle slows down after a stop."""
        if self._is_others(then_us) or self._before(then_us, *_DECEIVES, *_DISTURBS):
            return
        fast, left = self._sample(at_us).speed_mm_s, self._sample(then_us).speed_mm_s
        if fast >= _FAST_MM_S and left > max(fast - _LOST_MM_S, _SLOW_MM_S):
            text = f"a stop at {fast / 1000:.1f} m/s left {left / 1000:.1f} m/s"
            yield JudgedFailure("no-stop", then_us, text, left)

    def _unheard(self, flight: LoggedCommand) -> Iterator[JudgedFailure]:
        """Check that a stop that did not reach the vehicle was sent again while the link worked."""
        ends_us = flight.until_us
        if ends_us is None or ends_us - flight.since_us < _AGAIN_US or self._is_others(ends_us):
            return
        deaf = (faults.LinkFault, faults.Stall, faults.Reboot, faults.HostStall, faults.MessageSilence)
        sent = any(flight.since_us <= frame.sent_us < ends_us for frame, _ in self._motion)
        if sent and not self._during(ends_us - _AGAIN_US, ends_us, *deaf):
            yield JudgedFailure("no-stop", ends_us, "no stop reached the vehicle, and none was sent again")

    def _left(self) -> Iterator[JudgedFailure]:
        """Check that the run did not end with the vehicle in the air although it had control and a working link."""
        flown = self._flown
        last, ended_us = flown.samples[-1], flown.ended_us
        if not last.in_air or self._is_others(last.at_us):
            return
        if flown.ending in (None, "link-lost") or flown.left:
            return
        deaf = (faults.LinkFault, faults.Stall, faults.Reboot, faults.HostStall, faults.MessageSilence, faults.Freeze)
        if not self._during(ended_us - _HELD_OUT_US, ended_us, *deaf):
            yield JudgedFailure("not-ended", ended_us, f"the run ended as `{flown.ending}` with the vehicle in the air")

    # -------------------------------------------------------- supervision

    def _watched(
        self, life: Life, records: Sequence[Record], flights: Sequence[LoggedCommand]
    ) -> Iterator[JudgedFailure]:
        steps = [each for each in flights if each.kind == STEP]
        decision = next((record for record in records if record["type"] == "decision"), None)
        if not steps or decision is None:
            return
        silences = list(self._silences(records))
        judged = [(since_us, until_us) for since_us, until_us, _ in silences]
        waited = [(since_us, until_us + more_us) for since_us, until_us, more_us in silences]
        late = self._supervised(life, decision, steps, waited)
        early = late if judged == waited else self._supervised(life, decision, steps, judged)
        for step, watched in zip(steps, late, strict=True):
            yield from self._ignored(life, step, watched.sure, waited)
        for step, watched in zip(steps, early, strict=True):
            if step.how == "violated" and watched.doubtful is None and watched.looked_us == step.until_us:
                text = f"{step_words(step.step)} was aborted, but by the readings this holds: {step.detail}"
                yield JudgedFailure("needless", watched.looked_us, text)

    def _supervised(
        self, life: Life, decision: Record, steps: Sequence[LoggedCommand], silences: Sequence[Span]
    ) -> Sequence[RunningStep]:
        """Supervise the steps by the readings; nothing is judged in the silences."""
        policy, mission, start_us = self._flown.policy, self._flown.mission, self._flown.start_us
        ahead_us = start_us + decision["utc_us"] - decision["at_us"]
        watched = [RunningStep(policy, mission, each.step, (each.since_us, each.until_us), silences) for each in steps]
        supervise(policy, watched, life.turns, lambda us: Now(us + start_us, us + ahead_us, decision["utc_error_us"]))
        return watched

    def _ignored(
        self, life: Life, step: LoggedCommand, broken: tuple[int, str] | None, silences: Sequence[Span]
    ) -> Iterator[JudgedFailure]:
        """Check that a step was aborted within a turn or two after a condition failed."""
        if broken is None:
            return
        (at_us, what), bound_us = broken, self._bound_us
        if (life.ended_us if step.until_us is None else step.until_us) <= at_us + bound_us:
            return
        # an unanswered link is not recorded as a silence, but does not count for the duration either
        mute = what.startswith(DURATION) and self._before(at_us, faults.LinkFault, faults.Stall)
        silent = any(since_us <= at_us + 2 * bound_us and at_us <= until_us for since_us, until_us in silences)
        if not mute and not silent:
            end = "did not end" if step.until_us is None else f"ended {(step.until_us - at_us) / 1e6:.2f} s later"
            yield JudgedFailure("not-watched", at_us, f"{step_words(step.step)} violated `{what}` and {end}")

    def _silences(self, records: Sequence[Record]) -> Iterator[tuple[int, int, int]]:
        """Yield the intervals from a lost link or a stall until fresh state, each with the time after it in which the
        runtime may still wait for missing reports.
        """
        since_us: int | None = None
        back_us = 0
        for record in records:
            if record["type"] != "effect":
                continue
            if record["event"] == "link-lost" and since_us is None:
                since_us = self._at(record)
            elif record["event"] == "link-back":
                back_us = self._at(record)
            elif record["event"] == _STOOD_STILL:
                back_us = self._at(record)
                stood_us = int(record["detail"].split()[1]) * 1_000
                began_us = back_us - stood_us + _STALLED_US
                since_us = began_us if since_us is None else since_us
            elif record["event"] in ("fresh", "not-fresh") and since_us is not None:
                yield since_us, self._at(record), max(0, back_us + _FRESH_US - self._at(record))
                since_us = None
        if since_us is not None:
            yield since_us, _NEVER, 0

    # -------------------------------------------------------- chains

    def _chains(self, records: Sequence[Record], flights: Sequence[LoggedCommand]) -> Iterator[JudgedFailure]:
        airborne = [record for record in records if self._sample(self._at(record)).in_air]
        for number, (record, after) in enumerate(pairwise(airborne)):
            if record["type"] == "decision":
                yield from self._denied(record, airborne[number + 1 :])
                continue
            match record.get("event"):
                case "violated" if after["type"] == "decision" and after["kind"] == FALLBACK_LINK:
                    yield from self._first(after)
                case "recall" | "cancellation":
                    yield from self._recalled(self._at(record), flights, records)
                case "stranded":
                    yield from self._stranded(record, flights)
                case "not-fresh":
                    yield from self._hasty(record, records)

    def _denied(self, record: Record, later: Sequence[Record]) -> Iterator[JudgedFailure]:
        """Check that a denied step does not use its own fallback."""
        if record["kind"] == STEP and record["outcome"] == "deny":
            asked = next((each for each in later if each["type"] == "decision"), None)
            if asked is not None and asked["kind"] == FALLBACK_LINK:
                text = f"{step_words(record['step'])} was denied, but its own fallback was used"
                yield JudgedFailure("chain", self._at(record), text)

    def _went_on(self, records: Sequence[Record]) -> Iterator[JudgedFailure]:
        """Check that no decision or dispatch follows a reported takeover or crash."""
        told: Record | None = None
        for record in records:
            effect = record["type"] == "effect"
            if effect and record["event"] in ("taken-over", "crashed"):
                told = told or record
            elif told is not None and (record["type"] == "decision" or (effect and record["event"] == "dispatched")):
                yield JudgedFailure(
                    "went-on", self._at(record), f"the run continued after `{told['event']}: {told['detail']}`"
                )
                return

    def _first(self, asked: Record) -> Iterator[JudgedFailure]:
        """Check that a fallback begins with the first possible link."""
        now = Now(asked["at_us"], asked["utc_us"], asked["utc_error_us"])
        said, policy = asked["state"], self._flown.policy
        monitors = [_TRUTHS[truth] for truth in said.get("monitors", ())]
        situation = JudgedState(policy, said["values"], said["ages"], monitors, now)
        link = situation.first_link(WatchedStep(policy, self._flown.mission, asked["step"]))
        if link is None or link == asked["link"] or situation.doubtful:
            return
        of = step_words(asked["step"])
        text = f"the fallback of {of} begins with link {asked['link']}, but link {link} is possible"
        yield JudgedFailure("chain", self._at(asked), text)

    def _recalled(
        self, at_us: int, flights: Sequence[LoggedCommand], records: Sequence[Record]
    ) -> Iterator[JudgedFailure]:
        """Check that a recall or cancellation ends a step at once, unless the step lands or returns."""
        bound_us = self._bound_us
        silent = any(
            since_us <= at_us + bound_us and at_us <= until_us for since_us, until_us, _ in self._silences(records)
        )
        for flight in flights:
            if flight.kind != STEP or flight.motion in _HOMEWARD or silent:
                continue
            if flight.since_us <= at_us and flight.until_us is not None and flight.until_us > at_us + bound_us:
                lasted_s = (flight.until_us - at_us) / 1e6
                text = f"{step_words(flight.step)} continued for {lasted_s:.1f} s after it was called off"
                yield JudgedFailure("chain", at_us, text)

    def _stranded(self, record: Record, flights: Sequence[LoggedCommand]) -> Iterator[JudgedFailure]:
        """Check that the last link was tried often enough."""
        last = len(self._flown.policy.contingency) - 1
        tried = sum(each.kind == CONTINGENCY_LINK and each.link == last for each in flights)
        if tried < 1 + _TRIES:
            yield JudgedFailure("chain", self._at(record), f"gave up after {tried} tries of the last link")

    def _hasty(self, record: Record, records: Sequence[Record]) -> Iterator[JudgedFailure]:
        """Check that the runtime waited long enough for fresh state."""
        before = [each for each in records if each["type"] == "effect" and each["at_us"] <= record["at_us"]]
        backs = [each for each in before if each["event"] in ("link-back", _STOOD_STILL)]
        ends = [each for each in before if each["event"] in ("fresh", "not-fresh") and each is not record]
        in_this = [each for each in backs if not ends or each["at_us"] > ends[-1]["at_us"]]
        if len(in_this) == 1 and record["at_us"] - in_this[0]["at_us"] < _FRESH_US:
            yield JudgedFailure("chain", self._at(record), f"did not wait for fresh state: {record['detail']}")

    # -------------------------------------------------------- releases and records

    def _released(self, records: Sequence[Record]) -> Iterator[JudgedFailure]:
        """Check that each step was released by the end of the step before."""
        released: int | None = None
        for record in records:
            if record["type"] == "effect":
                ends = record["event"] in ("succeeded", "skipped") and record["kind"] == STEP
                if ends or (record["event"] == "ready" and released is None):
                    released = record["at_us"]
            elif record["type"] == "decision" and record["kind"] == STEP and released is not None:
                given = record["context"]["released_us"]
                if given != released:
                    late_s = (given - released) / 1e6
                    text = f"{step_words(record['step'])} was released {late_s:.1f} s after the step before ended"
                    yield JudgedFailure("release", self._at(record), text, abs(given - released))

    def _recorded(self, life: Life, records: Sequence[Record]) -> Iterator[JudgedFailure]:
        """Check that a frame that only a step sends was sent after the record of its decision was stored."""
        allowed = list(self._allowed(life, records))
        decided = [decided_us for decided_us, _, _ in allowed]
        only_steps = _ONLY_STEPS - self._kinds_of_links()
        for frame, parts in self._motion:
            if not life.began_us <= frame.sent_us <= life.ended_us or not parts or not parts <= only_steps:
                continue
            # in a turn frames are sent first: one of the running step may leave at the moment when the next is allowed
            first, end = bisect_left(decided, frame.sent_us), bisect_right(decided, frame.sent_us)
            possible = allowed[max(first - 1, 0) : end]
            if not any(kept_us <= frame.sent_us and kind in parts for _, kept_us, kind in possible):
                text = "a frame of a step was sent before the record of its decision was stored"
                yield JudgedFailure("unrecorded", frame.sent_us, text)
                return

    def _allowed(self, life: Life, records: Sequence[Record]) -> Iterator[tuple[int, int, MotionKind]]:
        """Yield the time of each allowed step, the time its record was stored, and its motion."""
        for record, kept_us in zip(records, life.kept_us, strict=False):
            if record["type"] == "decision" and record["kind"] == STEP and record["outcome"] == "allow":
                kind = self._flown.mission.invocations[record["step"]].contract.motion.kind
                yield self._at(record), kept_us, MotionKind(kind)

    def _kinds_of_links(self) -> set[int]:
        """Return the motions of all fallback links and rule targets."""
        policy = self._flown.policy
        links = [*policy.contingency, *(link for contract in policy.contracts for link in contract.fallback)]
        links += [rule.target for rule in policy.rules if rule.target is not None]
        return {policy.contracts[link.skill].motion.kind for link in links}
