"""The judge: hand-made true states, and changed copies of a real flight, for each kind of failure."""

import json
import pickle
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace as with_fields
from pymavlink.dialects.v20 import ardupilotmega as dialect

from reference import imaged_flight
from reference.payload_case import emission
from rtshcua.model import faults
from rtshcua.model.faults import Fault, FlightMode
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.zone import AREA, Zone, unproject
from rtshcua.model.scenario import Start
from rtshcua.virtual.flight_record import (
    HeardReadings,
    IncidentOccurrence,
    Reaction,
    ScenarioFlown,
    SentFrame,
    TrueImage,
    TruthSample,
)
from rtshcua.virtual.judge import SLUGS, Judgement, judge, moves
from rtshcua.virtual.zone_truth import inside_mm
from virtual import case
from virtual.once import once
from virtual.rows import rows
from virtual.scenarios import flown, incident, scenario

S, M = case.S, case.M


@pytest.fixture(scope="module")
def good() -> ScenarioFlown:
    was = once("judged-flight", lambda: flown(scenario()))
    # true states are made by hand here, so `runtime_checks`, which need readings, do not apply
    return replace(was, lives=tuple(replace(life, turns=()) for life in was.lives))


def sample(at_s: float, east_m: float = 0, north_m: float = 0, up_m: float = 10, **fields: Any) -> TruthSample:
    latitude, longitude = unproject(case.policy().projection, round(east_m * M), round(north_m * M))
    plain = TruthSample(
        round(at_s * S),
        latitude,
        longitude,
        round(up_m * M),
        0,
        0,
        True,
        True,
        False,
        FlightMode.GUIDED,
        9_000,
        None,
        None,
        None,
    )
    return plain._replace(**fields)


def judged(good: ScenarioFlown, samples: Sequence[TruthSample], *happened: Fault, **fields: Any) -> Judgement:
    """Judge these true states, with the logs and frames of a good flight."""
    incidents = tuple(IncidentOccurrence(number, fault.at_us, fault, "") for number, fault in enumerate(happened))
    given: dict[str, Any] = {"frames": (), "lives": (replace(good.lives[0], ending="aborted"),), **fields}
    return judge(replace(good, samples=tuple(samples), happened=incidents, **given))


def slugs(judgement: Judgement) -> list[str]:
    return [failure.slug for failure in judgement.failures]


def causes(judgement: Judgement) -> list[tuple[str, str | None]]:
    return [(failure.slug, failure.cause) for failure in judgement.exceptions]


# ---------------------------------------------------------------- nothing, and plain values


@pytest.mark.slow
def test_good_flight_has_no_failures(good: ScenarioFlown) -> None:
    found = judge(good)
    assert (found.failures, found.exceptions) == ((), ())
    assert found.margins.fence_mm is not None
    assert found.margins.fence_mm > 0
    assert found.margins.ended_us == 0
    assert pickle.loads(pickle.dumps(good)) == good


# ---------------------------------------------------------------- outside-fence

SQUARE = (0, 0, 10, 0, 10, 10, 0, 10)


@rows(
    ("zone", "place", "inside"),
    [
        (Zone("box", 1, -100, 100, SQUARE), (5, 5, 0), 5),
        (Zone("box", 1, -100, 100, SQUARE), (13, 14, 0), -5),
        (Zone("box", 1, -2, 100, SQUARE), (5, 5, 0), 2),
        (Zone("box", 1, -100, 4, SQUARE), (5, 5, 7), -3),
        (Zone("box", 1, -100, 4, SQUARE), (13, 5, 8), -5),
        (Zone("round", 0, -100, 100, (0, 0, 100)), (3, 4, 0), 5),
        (Zone("round", 0, -100, 100, (0, 0, 100)), (0, 12, 0), -2),
        (Zone("ring", AREA, -100, 100, (2, 4, 4, *SQUARE, 4, 4, 4, 6, 6, 6, 6, 4)), (5, 5, 0), -1),
        (Zone("ring", AREA, -100, 100, (2, 4, 4, *SQUARE, 4, 4, 4, 6, 6, 6, 6, 4)), (2, 5, 0), 2),
    ],
)
def test_distance_inside_a_zone(zone: Zone, place: tuple[int, int, int], inside: float) -> None:
    assert inside_mm(zone, *place) == pytest.approx(inside)


def test_leaving_the_airspace_is_a_failure(good: ScenarioFlown) -> None:
    found = judged(good, [sample(10, 490), sample(11, 503), sample(12, 507), sample(13, 480)])
    first, worst = found.failures
    assert (first.slug, first.at_us, worst.at_us) == ("outside-fence", 11 * S, 12 * S)
    assert found.margins.fence_mm == worst.amount * -1 == pytest.approx(-7_000, abs=20)
    assert slugs(judged(good, [sample(10, 499)])) == []
    assert slugs(judged(good, [sample(10, up_m=119)])) == []
    assert slugs(judged(good, [sample(10, up_m=121)])) == ["outside-fence"]
    assert slugs(judged(good, [sample(10, north_m=250)])) == ["outside-fence"]  # over the school
    assert slugs(judged(good, [sample(10, 700, in_air=False)])) == []


HOUR = 3_600 * S
NOON = 1_780_315_200 * S  # UTC; the policy's local time is that of its offset


def _with_times(good: ScenarioFlown, number: int, **times: tuple[int, int]) -> Any:
    zones = list(good.policy.zones)
    zones[number] = with_fields(zones[number], **times)
    vehicle = with_fields(good.policy.vehicle, utc_offset_us=2 * HOUR)
    return with_fields(good.policy, zones=tuple(zones), vehicle=vehicle)


@pytest.mark.parametrize(
    ("times", "there"),
    [
        ({"daily": (13 * HOUR, 15 * HOUR)}, True),
        ({"daily": (11 * HOUR, 13 * HOUR)}, False),
        ({"daily": (22 * HOUR, 15 * HOUR)}, True),  # over midnight
        ({"daily": (15 * HOUR, 13 * HOUR)}, False),
        ({"daily": (14 * HOUR + 11 * S, 15 * HOUR)}, False),  # a second from now
        ({"daily": (14 * HOUR + 8 * S, 15 * HOUR)}, True),
        ({"weekly": (13 * HOUR, 15 * HOUR)}, True),  # a Monday
        ({"weekly": (24 * HOUR, 168 * HOUR)}, False),
        ({"weekly": (14 * HOUR + 11 * S, 15 * HOUR)}, False),
        ({"weekly": (1 * HOUR, 2 * HOUR, 13 * HOUR, 15 * HOUR), "dates": (NOON + HOUR, NOON + 2 * HOUR)}, False),
        ({"dates": (NOON, NOON + HOUR)}, True),
        ({"dates": (NOON + HOUR, NOON + 2 * HOUR)}, False),
        ({"dates": (NOON, NOON + HOUR), "daily": (13 * HOUR, 15 * HOUR)}, True),
        ({"dates": (NOON, NOON + HOUR), "daily": (11 * HOUR, 13 * HOUR)}, False),
    ],
)
def test_exclusion_zone_counts_while_it_exists(good: ScenarioFlown, times: Any, there: bool) -> None:
    policy = _with_times(good, case.flat.SCHOOL, **times)
    found = slugs(judged(good, [sample(10, north_m=250)], policy=policy, utc_us=NOON))
    assert found == ["outside-fence"] * there


@pytest.mark.parametrize(("hours", "there"), [((13, 15), True), ((15, 16), False), ((12, 13), False)])
def test_zone_times_are_local_times(good: ScenarioFlown, hours: tuple[int, int], there: bool) -> None:
    policy = _with_times(good, case.flat.SCHOOL, daily=(hours[0] * HOUR, hours[1] * HOUR))
    offsets = (0, HOUR, NOON - HOUR, 2 * HOUR, NOON + HOUR, HOUR, NOON + 2 * HOUR)
    zoned = with_fields(policy.vehicle, utc_offset_us=0, time_zone="A/B", time_zone_data="1", offsets=offsets)
    found = slugs(judged(good, [sample(10, north_m=250)], policy=with_fields(policy, vehicle=zoned), utc_us=NOON))
    assert found == ["outside-fence"] * there


def test_zone_that_begins_during_the_flight_counts(good: ScenarioFlown) -> None:
    policy = _with_times(good, case.flat.SCHOOL, dates=(NOON + 20 * S, NOON + HOUR))
    samples = [sample(at_s, north_m=250) for at_s in (10, 15, 22, 25)]
    found = judged(good, samples, policy=policy, utc_us=NOON).failures
    assert [(each.slug, each.at_us) for each in found] == [("outside-fence", 22 * S)]


def test_flight_without_its_inclusion_zone_is_outside(good: ScenarioFlown) -> None:
    (inside,) = good.policy.airspace.inside  # type: ignore[union-attr]
    policy = _with_times(good, inside, dates=(NOON, NOON + 15 * S))
    found = judged(good, [sample(10), sample(20)], policy=policy, utc_us=NOON).failures
    assert [(each.slug, each.at_us) for each in found] == [("outside-fence", 20 * S)]


@rows(
    ("fault", "cause"),
    [
        (faults.GpsJump(5 * S, 0, 10 * M), "position"),
        (faults.GpsJump(5 * S, 0, 5 * M), None),
        (faults.GpsDrift(5 * S, 0, 2 * M), "position"),
        (faults.GpsDrift(5 * S, 0, 2 * M, S), None),
        (faults.GpsGlitch(5 * S, 0, 10 * M, 10 * S), "position"),
        (faults.GpsLoss(3 * S), "position"),
        (faults.GpsLoss(10 * S), None),
        (faults.WindStep(5 * S, 13 * M), "wind"),
        (faults.WindStep(5 * S, 8 * M), None),
        (faults.PilotSticks(5 * S, 8 * S), "pilot"),
        (faults.PilotSticks(5 * S, S), None),
        (faults.LinkSilence(5 * S), None),
        (faults.Kill(5 * S), "motors"),
    ],
)  # fmt: skip
def test_faults_that_excuse_leaving_the_airspace(good: ScenarioFlown, fault: Fault, cause: str | None) -> None:
    found = judged(good, [sample(5), sample(11, 508), sample(12, 480)], fault)
    assert slugs(found) == ([] if cause else ["outside-fence"])
    assert causes(found) == ([("outside-fence", cause)] if cause else [])


@rows(
    ("fault", "flavour", "from_s", "cause"),
    [
        (faults.GpsGlitch(5 * S, 0, 10 * M, 10 * S), "ardupilot", 20, "position"),
        (faults.GpsGlitch(5 * S, 0, 10 * M, 10 * S), "ardupilot", 27, None),
        (faults.GpsGlitch(5 * S, 0, 10 * M, 10 * S), "px4", 20, None),
        (faults.GpsLoss(5 * S, 10 * S), "ardupilot", 20, "position"),
        (faults.GpsLoss(5 * S, 10 * S), "ardupilot", 27, None),
        (faults.GpsGlitch(5 * S, 0, M, 23 * S), "ardupilot", 27, "position"),
        (faults.GpsGlitch(5 * S, 0, M, 23 * S), "ardupilot", 30, None),
    ],
)
def test_copter_landing_begun_without_position_is_excused(
    good: ScenarioFlown, fault: Fault, flavour: str, from_s: int, cause: str | None
) -> None:
    """The wind carries it away long after the receiver has recovered (`ModeLand::init`)."""
    modes = [(at_s, FlightMode.LAND if at_s >= from_s else FlightMode.BRAKE) for at_s in range(18, 29)]
    samples = [
        *(sample(at_s, mode=mode) for at_s, mode in modes),
        sample(29, 508, mode=FlightMode.LAND if from_s < 30 else FlightMode.BRAKE),
        sample(30, 480),
    ]
    found = judged(good, samples, fault, flavour=flavour)
    assert (slugs(found), causes(found)) == (([], [("outside-fence", cause)]) if cause else (["outside-fence"], []))


def test_takeover_excuses_leaving_the_airspace(good: ScenarioFlown) -> None:
    taken: dict[str, Any] = {"taken_over_us": 10 * S, "taken_over_by": "pilot"}
    samples = [sample(9), sample(12, 508, **taken), sample(13, 480, **taken)]
    assert causes(judged(good, samples)) == [("outside-fence", "pilot")]
    before = [sample(9, 508), sample(12, 480, **taken)]
    assert slugs(judged(good, before)) == ["outside-fence"]


def test_initial_wind_is_an_excuse(good: ScenarioFlown) -> None:
    windy = replace(good.scenario, start=Start(wind_mm_s=9 * M, gust_mm_s=2 * M))
    assert causes(judged(good, [sample(12, 508)], scenario=windy)) == [("outside-fence", "wind")]


# ---------------------------------------------------------------- collision


def crash(speed_mm_s: int = 3 * M, near_mm: int | None = 0) -> list[TruthSample]:
    near = {"obstacle_mm": near_mm}
    return [
        sample(5, **near), sample(9, speed_mm_s=speed_mm_s, **near),
        sample(10, speed_mm_s=speed_mm_s, crashed=True, in_air=False, **near),
    ]  # fmt: skip


def pillar(at_us: int, speed_mm_s: int = 0) -> faults.Pillar:
    return faults.Pillar(at_us, 0, 20 * M, 3 * M, 30 * M, speed_mm_s=speed_mm_s)


def test_collision_is_a_failure(good: ScenarioFlown) -> None:
    assert slugs(judged(good, crash())) == ["collision"]
    assert "hit an obstacle" in judged(good, crash()).failures[0].text
    assert "too hard" in judged(good, crash(near_mm=None)).failures[0].text
    assert judged(good, crash()).margins.obstacle_mm == 0


@rows(
    ("fault", "cause"),
    [
        (faults.Kill(5 * S), "motors"),
        (faults.Reboot(5 * S), "motors"),
        (faults.WindStep(5 * S, 15 * M), "wind"),
        (faults.LinkSilence(8 * S, 5 * S), "link"),
        (faults.LinkSilence(S, S), None),
        (faults.HostStall(8 * S, 3 * S), "process"),
        (faults.HostStall(2 * S, S), None),
        (faults.Obstacle(5 * S, 3 * M), None),
    ],
)
def test_faults_that_excuse_a_collision(good: ScenarioFlown, fault: Fault, cause: str | None) -> None:
    found = judged(good, crash(), fault)
    assert causes(found) == ([("collision", cause)] if cause else [])
    assert slugs(found) == ([] if cause else ["collision"])


def test_visible_pillar_does_not_excuse_a_collision(good: ScenarioFlown) -> None:
    contracts = tuple(with_fields(each, reads=(case.flat.OBSTACLE,)) for each in good.policy.contracts)
    looks_out = with_fields(good.policy, contracts=contracts)
    far = [sample(5, obstacle_mm=60 * M), *crash()[1:]]
    excused = [("collision", "obstacle")]

    def found(samples: Sequence[TruthSample], *happened: Fault) -> list[tuple[str, str | None]]:
        return causes(judged(good, samples, *happened, policy=looks_out))

    assert found(far, pillar(5 * S)) == []
    assert found(crash(), pillar(5 * S)) == excused  # appears within the stopping distance
    assert found(far, pillar(5 * S, speed_mm_s=M)) == excused
    assert found([far[0], *crash(speed_mm_s=0)[1:]], pillar(5 * S)) == excused
    assert found(far, pillar(5 * S), faults.MessageStuck(2 * S, "DISTANCE_SENSOR")) == excused
    assert found(far, pillar(5 * S), faults.MessageStuck(2 * S, "ATTITUDE")) == []
    assert causes(judged(good, far, pillar(5 * S))) == excused  # no range finder signal is read


def test_empty_battery_is_an_excuse_only_after_a_fault(good: ScenarioFlown) -> None:
    empty = [each._replace(battery=0) for each in crash(near_mm=None)]
    assert slugs(judged(good, empty)) == ["collision"]
    assert causes(judged(good, empty, faults.BatteryLevel(5 * S, 0))) == [("collision", "battery")]


# ---------------------------------------------------------------- not-ended


def after(good: ScenarioFlown, **fields: Any) -> list[TruthSample]:
    end_s = good.ended_us / S
    return [sample(end_s + tenths / 10, **fields) for tenths in range(1, 60)]


def test_vehicle_must_rest_or_hover_at_the_end(good: ScenarioFlown) -> None:
    lives = (replace(good.lives[0], ending="aborted"),)
    assert slugs(judged(good, after(good, speed_mm_s=300), lives=lives)) == []
    assert slugs(judged(good, after(good, speed_mm_s=3 * M), lives=lives)) == ["not-ended"]
    assert slugs(judged(good, after(good, climb_mm_s=-M), lives=lives)) == ["not-ended"]
    assert slugs(judged(good, after(good, speed_mm_s=3 * M, in_air=False), lives=lives)) == []
    assert slugs(judged(good, after(good), lives=good.lives)) == [
        "not-ended"
    ]  # the run ended as `completed` in the air


def test_faults_that_excuse_flying_on(good: ScenarioFlown) -> None:
    lives = (replace(good.lives[0], ending="stood-down"),)
    taken = after(good, speed_mm_s=3 * M, taken_over_us=S, taken_over_by="pilot")
    assert causes(judged(good, taken, lives=lives)) == [("not-ended", "pilot")]
    moving = after(good, speed_mm_s=3 * M)
    assert causes(judged(good, moving, lives=lives, left="no-vehicle")) == [("not-ended", "process")]
    assert "not-ended" in slugs(judged(good, moving, lives=lives, left="replayed"))


# ---------------------------------------------------------------- frames

SYSTEM, OURS = 1, 191


def packed(message: Any) -> bytes:
    sender = dialect.MAVLink(None, SYSTEM, OURS)
    octets: bytes = message.pack(sender)
    return octets


def long(number: int, *parameters: float) -> bytes:
    filled = (*parameters, *(0.0,) * (7 - len(parameters)))
    return packed(dialect.MAVLink_command_long_message(1, 1, number, 0, *filled))


def reposition(x: int, y: int) -> bytes:
    return packed(dialect.MAVLink_command_int_message(1, 1, 0, 192, 0, 0, -1, 1, 0, float("nan"), x, y, 10))


@rows(
    ("frame", "flavour", "kinds"),
    [
        (long(512, 0), "px4", None),
        (long(511, 33, 1e5), "px4", None),
        (packed(dialect.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)), "px4", None),
        (packed(dialect.MAVLink_mission_count_message(1, 1, 5, 1)), "px4", None),
        (packed(dialect.MAVLink_mission_count_message(1, 1, 5, 0)), "px4", set()),
        (packed(dialect.MAVLink_manual_control_message(1, 0, 0, 0, 0, 0)), "px4", set()),
        (long(400, 1), "px4", {MotionKind.CLIMB}),
        (long(400, 0), "px4", set()),
        (long(400, 1, 21196), "px4", set()),
        (long(176, 1, 4, 5), "px4", {MotionKind.HOME}),
        (long(176, 1, 6), "ardupilot", {MotionKind.HOME}),
        (long(176, 1, 9), "ardupilot", {MotionKind.LAND}),
        (long(22), "px4", {MotionKind.CLIMB}),
        (long(185, 1), "px4", set()),
        (long(2000, 0, 0, 1), "px4", None),
        (long(211, 1), "ardupilot", None),
        (reposition(473_977_400, 85_455_900), "px4", {MotionKind.FLY, MotionKind.COVER}),
        (reposition(0x7FFFFFFF, 0x7FFFFFFF), "px4", {MotionKind.HOLD}),
        (b"\xfd\x00garbage is nothing", "px4", None),
    ],
)
def test_frames_are_mapped_to_kinds_of_motion(frame: bytes, flavour: str, kinds: set[MotionKind] | None) -> None:
    assert moves(frame, flavour) == kinds


def motion(good: ScenarioFlown) -> list[SentFrame]:
    return [frame for frame in good.frames if moves(frame.octets, good.flavour) is not None]


def test_motion_frame_after_a_takeover_is_a_failure(good: ScenarioFlown) -> None:
    frame = motion(good)[-1]

    def taken(before_us: int, *happened: Fault, more: Sequence[SentFrame] = (), **fields: Any) -> Judgement:
        since_us = frame.sent_us - before_us
        samples = [
            each._replace(taken_over_us=since_us if each.at_us >= since_us else None, taken_over_by="pilot")
            for each in good.samples
        ]
        return judged(good, samples, *happened, frames=(*more, frame), **fields)

    def is_late(found: Judgement) -> bool:
        return "motion-after-takeover" in slugs(found)

    assert is_late(taken(2 * S))
    assert taken(2 * S).margins.takeover_us == 2 * S
    assert not is_late(taken(200_000))
    assert not is_late(taken(2 * S, faults.LinkDelay(S, 2 * S)))
    over_us = frame.sent_us - 3 * S  # a second before the takeover, queued behind delayed frames
    assert not is_late(taken(2 * S, faults.LinkDelay(over_us - S, 3 * S, S)))
    assert is_late(taken(2 * S, faults.LinkDelay(over_us - S, 2 * S, S)))  # it arrives a second after, not two
    assert is_late(taken(2 * S, faults.LinkDelay(over_us - 3 * S, 3 * S, S)))
    assert not is_late(taken(2 * S, faults.LinkSilence(S, held=True)))
    assert is_late(taken(2 * S, faults.LinkSilence(S)))  # no later frame
    assert is_late(taken(2 * S, faults.PilotPause(S)))  # visible on PX4
    under_way = frame._replace(sent_us=frame.sent_us - 2 * S - 1, heard_us=frame.sent_us - 2 * S + 1)
    assert causes(taken(2 * S, more=[under_way])) == [("motion-after-takeover", "crossed")]
    at_once = frame._replace(sent_us=frame.sent_us - 2 * S, heard_us=frame.sent_us - 2 * S)
    assert causes(taken(2 * S, more=[at_once])) == [("motion-after-takeover", "crossed")]


def test_takeover_by_the_mode_of_a_lost_frame_is_excused(good: ScenarioFlown) -> None:
    """It looks as if the lost frame had arrived. Another mode, or a frame that arrived, is no excuse."""
    land, hold = long(176, 1, 9), long(176, 1, 17)
    since_us, again_us = 30 * S, 33 * S

    def sent_again(before: SentFrame, *modes: tuple[float, FlightMode], heard_us: int | None = None) -> Judgement:
        samples = [
            sample(at_us / S, mode=next((mode for to_s, mode in modes if at_us < to_s * S), FlightMode.LAND))._replace(
                taken_over_us=since_us if at_us >= since_us else None, taken_over_by="failsafe"
            )
            for at_us in range(0, 40 * S, S // 10)
        ]
        return judged(good, samples, frames=(before, SentFrame(again_us, heard_us, land)), flavour="ardupilot")

    def taken(found: Judgement) -> list[tuple[str, str | None]]:
        return [each for each in causes(found) if each[0] == "motion-after-takeover"]

    lost = SentFrame(20 * S, None, land)
    assert taken(sent_again(lost)) == [("motion-after-takeover", "unseen")]
    assert "motion-after-takeover" in slugs(sent_again(SentFrame(20 * S, 20 * S, land)))
    assert "motion-after-takeover" in slugs(sent_again(SentFrame(20 * S, None, hold)))
    assert "motion-after-takeover" in slugs(sent_again(lost, (60, FlightMode.POSITION)))
    assert "motion-after-takeover" in slugs(sent_again(lost, (31, FlightMode.LAND), (60, FlightMode.POSITION)))


def test_invisible_pause_is_excused(good: ScenarioFlown) -> None:
    frame = motion(good)[-1]

    def paused(flavour: str, up_m: float, *others: Fault, frames: tuple[SentFrame, ...] = (frame,)) -> Judgement:
        since_us = frame.sent_us - 5 * S
        before = sample(since_us / S, up_m=up_m, mode=FlightMode.TAKEOFF)
        after = [each for each in good.samples if each.at_us > since_us]
        samples = [before, *(each._replace(taken_over_us=since_us, taken_over_by="pilot") for each in after)]
        happened = (faults.PilotPause(since_us), *others)
        return judged(good, samples, *happened, frames=frames, flavour=flavour)

    assert causes(paused("px4", 4.5)) == [("motion-after-takeover", "unseen")]
    assert "motion-after-takeover" in slugs(paused("px4", 3))
    stop = SentFrame(S, S, reposition(0x7FFFFFFF, 0x7FFFFFFF))
    assert causes(paused("px4", 1, frames=(stop, frame))) == [("motion-after-takeover", "unseen")]
    assert "motion-after-takeover" in slugs(paused("px4", 4.5, faults.PilotMode(frame.sent_us - 4 * S)))
    assert causes(paused("px4", 4.5, faults.PilotGoto(S, 0, 0, 0))) == [
        ("motion-after-takeover", "unseen")
    ]  # before the pause


@pytest.mark.parametrize(
    ("fault", "after_s", "seen"),
    [
        (faults.PilotGoto(0, 1_500, -1_500, 6_000), 5, False),
        (faults.PilotGoto(0, 1_500, -3_500, 6_000), 5, True),
        (faults.PilotGoto(0, 0, 0, 9_000), 5, True),
        (faults.PilotVelocity(0, -2_000, 0, 40 * S), 12, False),
        (faults.PilotVelocity(0, -2_000, 0, 40 * S), 14, True),
    ],
)
def test_invisible_takeovers_in_a_copter_takeoff_are_excused(
    good: ScenarioFlown, fault: Fault, after_s: int, *, seen: bool
) -> None:
    """A go-to to its end looks like the end itself; a velocity shows once the climb stops."""
    frame = motion(good)[-1]
    since_us = frame.sent_us - after_s * S
    after = [each for each in good.samples if each.at_us > since_us]
    samples = [
        sample(0),
        sample(since_us / S, up_m=2, mode=FlightMode.GUIDED),
        *(each._replace(taken_over_us=since_us, taken_over_by="pilot") for each in after),
    ]
    found = judged(good, samples, replace(fault, at_us=since_us), frames=(frame,), flavour="ardupilot")
    assert ("motion-after-takeover" in slugs(found)) is seen


@pytest.mark.parametrize(("climb_mm_s", "cause"), [(600, "unseen"), (700, None), (800, None)])
def test_pause_of_a_stopping_vehicle_is_excused(good: ScenarioFlown, climb_mm_s: int, cause: str | None) -> None:
    """A pilot stops a vehicle that still climbs after the runtime's stop: no report shows that while it slows down."""
    frame = motion(good)[-1]
    since_us = frame.sent_us - 5 * S
    stop = SentFrame(since_us - S // 10, since_us - S // 10, reposition(0x7FFFFFFF, 0x7FFFFFFF))
    told = sample(stop.sent_us / S, up_m=2, mode=FlightMode.TAKEOFF, climb_mm_s=700)
    paused = sample(since_us / S, up_m=2, mode=FlightMode.LOITER, climb_mm_s=climb_mm_s)
    after = [each for each in good.samples if each.at_us > since_us]
    samples = [told, *(each._replace(taken_over_us=since_us, taken_over_by="pilot") for each in (paused, *after))]
    found = judged(good, samples, faults.PilotPause(since_us), frames=(stop, frame), flavour="px4")
    assert [each.cause for each in (*found.failures, *found.exceptions) if each.slug == "motion-after-takeover"] == [
        cause
    ]


@pytest.mark.parametrize("left", ["replayed", "no-vehicle"])
def test_airborne_vehicle_without_a_run_is_a_failure(good: ScenarioFlown, left: str) -> None:
    """A run that did not start because the vehicle was on the ground is no excuse: it was about to take off."""
    hovers = [sample(at_us / S, up_m=5.0) for at_us in range(90 * S, 96 * S, S // 2)]
    found = judge(replace(good, samples=(*good.samples, *hovers), left=left, lives=()))
    ended = [each.cause for each in (*found.failures, *found.exceptions) if each.slug == "not-ended"]
    assert ended == ([None] if left == "replayed" else [])


def test_unlogged_frame_is_a_failure(good: ScenarioFlown) -> None:
    frame = motion(good)[0]
    early = SentFrame(S // 10, S // 10, frame.octets)
    assert slugs(judge(replace(good, frames=(early,)))) == ["unlogged-effect"]
    land = long(176, 1, 4, 6)
    other = [*good.frames, SentFrame(frame.sent_us + S, frame.sent_us + S, land)]
    assert "the last command was" in judge(replace(good, frames=tuple(other))).failures[0].text
    over = [*good.frames, SentFrame(good.ended_us + S, good.ended_us + S, land)]
    assert slugs(judge(replace(good, frames=tuple(over)))) == ["unlogged-effect"]
    ended = frame._replace(sent_us=good.ended_us - 1)
    assert "unlogged-effect" in slugs(judge(replace(good, frames=(ended,))))
    full = (IncidentOccurrence(0, 0, faults.DiskFull(0), ""),)
    assert causes(judge(replace(good, frames=(early,), happened=full))) == [("unlogged-effect", "disk")]


def test_command_to_payload_belongs_to_a_running_step_that_emits_it(good: ScenarioFlown) -> None:
    goto = next(each for each in motion(good) if moves(each.octets, "px4") == {MotionKind.FLY, MotionKind.COVER})
    last_us = motion(good)[-1].sent_us
    take, stop, point, control, release = 2000, 2001, 1000, 1001, 211

    def told(sent_us: int, number: int, *parameters: float, emits: tuple[int, ...] = (take, point)) -> list[str]:
        made = tuple(emission(each) for each in emits)
        policy = with_fields(
            good.policy,
            contracts=tuple(
                with_fields(each, emits=made if each.motion.kind in {MotionKind.FLY, MotionKind.COVER} else ())
                for each in good.policy.contracts
            ),
        )
        frame = SentFrame(sent_us, sent_us, long(number, *parameters))
        found = judge(replace(good, policy=policy, frames=(*good.frames, frame)))
        return [each.text for each in found.failures if each.slug == "unlogged-effect"]

    soon_us = goto.sent_us + S // 10
    outside, ended = "was sent outside of a step that emits it", good.ended_us + S
    assert told(soon_us, take) == told(soon_us, point) == told(soon_us, control, 1, 191) == []
    assert told(soon_us, take, emits=()) == [f"MAV_CMD_IMAGE_START_CAPTURE {outside}"]
    assert told(soon_us, control, 1, 191, emits=(take,)) == [f"MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE {outside}"]
    assert told(soon_us, release) == [f"MAV_CMD_DO_GRIPPER {outside}"]
    assert told(last_us, take) == [f"MAV_CMD_IMAGE_START_CAPTURE {outside}"]
    assert told(last_us, stop) == told(last_us, control, -3, -3) == []
    assert told(last_us, stop, emits=(point,)) == [f"MAV_CMD_IMAGE_STOP_CAPTURE {outside}"]
    assert told(last_us, control, 1, 191) == [f"MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE {outside}"]
    assert told(ended, take) == ["MAV_CMD_IMAGE_START_CAPTURE was sent while no process ran"]


def test_frame_may_belong_to_either_of_two_simultaneous_commands() -> None:
    """ArduCopter refuses to brake without a position: the landing is sent in the same turn, and both are logged."""
    found = judge(flown(scenario(incident(13.4, faults.EstimatorUnhealthy(0, 5 * S))), "ardupilot", seed=5))
    assert found.failures == ()


def test_frame_of_a_step_may_leave_at_the_moment_when_the_next_is_allowed() -> None:
    """A leg to where the vehicle is succeeds in the turn in which its target is sent."""
    up, there, back = case.low_steps()
    steps = (up, there, with_fields(there, step=2), with_fields(back, step=3))
    was = flown(scenario(), bundle=case.seal(case.mission(steps)))
    assert was.ending == "completed"
    assert judge(was).failures == ()


def test_late_fallback_is_a_failure(good: ScenarioFlown) -> None:
    frame = motion(good)[-1]

    def reacts(in_us: int, *happened: Fault, questions: tuple[SentFrame, ...] = ()) -> Judgement:
        reaction = Reaction(frame.sent_us - in_us, frame.sent_us)
        life = replace(good.lives[0], reactions=(reaction,))
        incidents = tuple(IncidentOccurrence(number, fault.at_us, fault, "") for number, fault in enumerate(happened))
        return judge(replace(good, lives=(life,), happened=incidents, frames=(*questions, *good.frames)))

    def asked(came_us: int, obeyed_us: int | None, message: int = 0) -> SentFrame:
        return SentFrame(frame.sent_us - S, frame.sent_us - came_us, long(512, message), obeyed_us)

    assert slugs(reacts(100_000)) == []
    assert reacts(100_000).margins.stop_us == 100_000
    assert slugs(reacts(S, questions=(asked(900_000, frame.sent_us),))) == []
    assert slugs(reacts(S, questions=(asked(800_000, frame.sent_us),))) == ["late"]  # it came late
    assert slugs(reacts(S, questions=(asked(900_000, frame.sent_us - S),))) == ["late"]  # answered before
    assert slugs(reacts(S, questions=(asked(900_000, frame.sent_us, 33),))) == ["late"]  # something else was asked
    assert slugs(reacts(S, questions=(asked(900_000, None),))) == ["late"]
    assert slugs(reacts(S)) == ["late"]
    assert causes(reacts(S, faults.LinkSilence(2 * S))) == [] == slugs(reacts(S, faults.LinkDelay(2 * S, S)))


def test_frame_after_permit_or_deadline_is_a_failure(good: ScenarioFlown) -> None:
    takes_off = next(each for each in motion(good) if moves(each.octets, "px4") == {MotionKind.CLIMB})
    late = [
        each._replace(sent_us=each.sent_us + 20 * S) if each is takes_off else each
        for each in good.frames
        if each is takes_off or moves(each.octets, good.flavour) is None
    ]
    found = judge(replace(good, frames=tuple(late)))
    assert "late" in slugs(found)
    assert any("deadline" in each.text or "permit" in each.text for each in found.failures)


# ---------------------------------------------------------------- logs


def test_log_that_does_not_verify_is_a_failure(good: ScenarioFlown) -> None:
    lines = list(good.lives[0].lines)

    def logged(changed: Sequence[bytes], *happened: Fault) -> Judgement:
        incidents = tuple(IncidentOccurrence(number, fault.at_us, fault, "") for number, fault in enumerate(happened))
        return judge(replace(good, lives=(replace(good.lives[0], lines=tuple(changed)),), happened=incidents))

    assert "log" in slugs(logged(lines[:3] + lines[4:]))
    assert slugs(logged(lines[:-1])) == ["log"]
    assert causes(logged(lines[:-1], faults.DiskFull(S))) == [("log", "disk")]
    assert "log" in slugs(logged(lines[:3] + lines[4:], faults.DiskFull(S)))


def test_underived_decision_is_a_failure(good: ScenarioFlown, monkeypatch: pytest.MonkeyPatch) -> None:
    from rtshcua.evidence.finding import Flaw
    from rtshcua.ground.audit.record_audit import RecordAudit

    flaw = Flaw("decision/differs", "it decides otherwise")
    monkeypatch.setattr(RecordAudit, "check", lambda self, record: flaw if record.seq == 4 else None)
    assert slugs(judge(good)) == ["derive"]


def test_exception_of_the_runtime_is_a_failure(good: ScenarioFlown) -> None:
    assert slugs(judge(replace(good, fault="ZeroDivisionError"))) == ["fault"]


@pytest.mark.parametrize(
    ("signal", "by", "words"),
    [("position", 5_000, "place"), ("height", 2_000, "height"), ("battery", 300, "charge")],
)
def test_readings_are_compared_with_the_truth(signal: str, by: int, words: str) -> None:
    was = once("judged-flight", lambda: flown(scenario()))
    slot = getattr(was.policy.vehicle, signal)

    def off(heard: HeardReadings) -> HeardReadings:
        return heard._replace(
            values=tuple(
                (each, value + by if each == slot and value is not None else value) for each, value in heard.values
            )
        )

    turns = tuple(turn._replace(heard=tuple(map(off, turn.heard))) for turn in was.lives[0].turns)
    untrue = [
        each.text
        for each in judge(replace(was, lives=(replace(was.lives[0], turns=turns),))).failures
        if each.slug == "untrue"
    ]
    assert untrue
    assert all(each.startswith(f"a received {words}") for each in untrue)
    assert not [each for each in judge(was).failures if each.slug == "untrue"]


def test_every_slug_has_a_test() -> None:
    text = Path(__file__).read_text(encoding="utf-8")
    assert all(f'"{slug}"' in text for slug in SLUGS)


def test_an_image_that_was_never_stored_or_elsewhere_is_untrue(good: ScenarioFlown) -> None:
    records = [json.loads(line) for line in imaged_flight.flown()]
    details = [json.loads(each["detail"]) for each in records if each.get("event") == "image"]
    taken = [each for each in details if each["index"] is not None]
    stored = tuple(TrueImage(each["utc_us"], each["latitude"], each["longitude"]) for each in taken)
    lived = replace(good, lives=(replace(good.lives[0], lines=tuple(imaged_flight.flown())),))

    def untrue(*images: TrueImage) -> list[str]:
        found = judge(replace(lived, images=images)).failures
        return [each.text for each in found if each.slug == "untrue" and "image" in each.text]

    assert untrue(*stored) == []
    assert untrue(*stored[:3], *stored[4:]) == [f"image {taken[3]['index']} was recorded and never stored"]
    elsewhere = stored[3]._replace(latitude=stored[3].latitude + 1)
    assert untrue(*stored[:3], elsewhere, *stored[4:]) == [f"image {taken[3]['index']} was recorded with another place"]
