"""The qualification checks of hand-made observations, at the edge of each limit."""

from typing import Any

import pytest
from msgspec.structs import replace

from rtshcua.adapters.doctor.diagnosis import MissionVerdict, VehicleFinding
from rtshcua.adapters.qualification.checks import ends_after, judge
from rtshcua.adapters.qualification.observed import (
    MotionSample,
    ObservedAnswer,
    ObservedCommand,
    ObservedQualification,
    ObservedSilence,
    ObservedSortie,
    ObservedTakeover,
    TakeoverKind,
)
from rtshcua.model.flat.contract import MotionKind
from rtshcua.wire.qualification import CheckOutcome, Firmware, QualificationCheck
from virtual.policy import POLICY

S, M = 1_000_000, 1_000
HELD, FAILED, TOLD, UNCHECKED = CheckOutcome
#: 2 m/s^2 after 0.5 s: from 4 m/s 6 m, and 1.3 m more for reports that are late and off
BRAKED = replace(POLICY, vehicle=replace(POLICY.vehicle, braking=2_000, reaction_us=S // 2, return_altitude=30 * M))


def place(north_mm: int) -> int:
    return 473_977_400 + round(north_mm / 11.1319)


def checks(policy: Any = BRAKED, *sorties: ObservedSortie, **about: Any) -> dict[str, QualificationCheck]:
    given: dict[str, Any] = {
        "firmware": Firmware("px4", 0x01100000, bytes(8)), "mode_within_us": 300_000, "round_trip_us": 20_000,
        "settings": (), "missing": {},
    }  # fmt: skip
    observed = ObservedQualification(sorties=sorties, **(given | about))
    return {each.slug: each for each in judge(observed, policy)}


def leg(way_mm: int, took_us: int, **about: Any) -> ObservedSortie:
    """A leg at 4 m/s with a stop command at 10 s; the vehicle stands after a time and a distance, and stays."""
    samples = [MotionSample(at, 0, 0, 10 * M, 4 * M, 0) for at in (9_900_000, 10 * S)]
    samples = [each._replace(latitude=place(0)) for each in samples]
    samples += [MotionSample(10 * S + took_us // 2, place(way_mm // 2), 0, 10 * M, 3 * M, 0)]
    samples += [MotionSample(10 * S + took_us + at, place(way_mm), 0, 10 * M, 0, 0) for at in (0, S, 2 * S)]
    flown = ObservedCommand(MotionKind.FLY, "goto", 5 * S, 4 * M, True, 5 * S, 10 * S, "succeeded")
    hold = ObservedCommand(MotionKind.HOLD, "hover", 10 * S, 0, False, 10 * S, 30 * S, "succeeded")
    return ObservedSortie("leg", samples, [flown, hold], ending="completed", down=True, **about)


@pytest.mark.parametrize(
    ("way_mm", "took_us", "outcome"),
    [
        (7_250, 4 * S, HELD),
        (7_400, 4 * S, FAILED),  # further than 4 m/s * 0.5 s + 4 m of braking, and 0.8 m + 0.5 m of reports
        (7_000, 6_500_000, HELD),
        (7_000, 6_600_000, FAILED),  # later than 0.5 s + 2 s of braking, and 4 s of lag
    ],
)
def test_a_stop_is_held_to_the_brakes_that_are_declared(way_mm: int, took_us: int, outcome: CheckOutcome) -> None:
    found = checks(BRAKED, leg(way_mm, took_us))["stop/fly"]
    assert found.outcome == outcome, found
    assert found.limit == 7_300


def test_stop_without_declared_brakes_is_judged_by_default() -> None:
    found = checks(POLICY, leg(7_400, 4 * S))["stop/fly"]
    assert found.outcome == HELD
    assert "no `brakes` declared" in found.expected


def test_moving_vehicle_fails_stop_and_hold() -> None:
    flown = leg(7_000, 4 * S)
    flown.samples[-1] = flown.samples[-1]._replace(speed=900)
    found = checks(BRAKED, flown)
    assert found["stop/fly"].outcome == found["hold/fly"].outcome == FAILED
    assert found["stop/fly"].measured.startswith("the vehicle does not stop")


def test_drift_while_holding_fails_hold() -> None:
    flown = leg(7_000, 4 * S)
    flown.samples[-1] = flown.samples[-1]._replace(latitude=place(10_500))
    assert checks(BRAKED, flown)["hold/fly"].outcome == FAILED


def answered(late_us: int | None, result: int = 0) -> ObservedSortie:
    answer = ObservedAnswer(176, S, None if late_us is None else S + late_us, None if late_us is None else result)
    return ObservedSortie("climb", answers=[answer], ending="completed", down=True)


@pytest.mark.parametrize(
    ("sortie", "failed"),
    [
        (answered(S), set()),
        (answered(S + 1), {"answers/late"}),
        (answered(None), {"answers/come"}),
        (answered(10, result=2), {"answers/accepted"}),
    ],
)
def test_answers_come_in_time_and_accept(sortie: ObservedSortie, failed: set[str]) -> None:
    found = checks(BRAKED, sortie)
    assert {slug for slug, each in found.items() if slug.startswith("answers/") and each.outcome == FAILED} == failed


def taken(kind: TakeoverKind, shown_us: int | None, how: str = "another target", **about: Any) -> ObservedSortie:
    late = None if shown_us is None else S + shown_us
    takeover = ObservedTakeover(kind, S, mode_us=late, shown_us=late, how=how, **about)
    return ObservedSortie(kind, takeover=takeover, ending="stood-down", down=True)


@pytest.mark.parametrize(
    ("sortie", "outcome"),
    [
        (taken(TakeoverKind.MODE, 320_000), HELD),
        (taken(TakeoverKind.MODE, 321_000), FAILED),
        (taken(TakeoverKind.MODE, None), FAILED),
        (taken(TakeoverKind.TARGET, 320_000, moved_us=S + 320_000), HELD),
        (taken(TakeoverKind.TARGET, 320_000, moved_us=S + 400_000), FAILED),
        (taken(TakeoverKind.PAUSE, 6 * S, "paused"), HELD),  # ArduCopter shows only that it stands
        (taken(TakeoverKind.TARGET, 6 * S, "paused"), FAILED),
        (taken(TakeoverKind.PAUSE, 11 * S, "paused"), FAILED),
        (taken(TakeoverKind.PAUSE, 6 * S, "stopped-short"), FAILED),
    ],
)
def test_a_takeover_shows_within_what_is_declared_and_the_links_delay(
    sortie: ObservedSortie, outcome: CheckOutcome
) -> None:
    assert checks(BRAKED, sortie)[f"takeover/{sortie.name}"].outcome == outcome


def test_a_mode_that_shows_late_because_nobody_looked_is_not_late() -> None:
    """Between standing down and watching the landing a run closes its log."""
    flown = taken(TakeoverKind.MODE, 100_000)
    assert flown.takeover is not None
    flown.takeover.mode_us = S + 600_000
    assert checks(BRAKED, flown)["takeover/mode"].outcome == FAILED
    flown.takeover.unwatched_us = 300_000
    assert checks(BRAKED, flown)["takeover/mode"].outcome == HELD
    flown.takeover.mode_us = None
    assert checks(BRAKED, flown)["takeover/mode"].outcome == FAILED


def silenced(**about: Any) -> ObservedSortie:
    given: dict[str, Any] = {
        "for_us": 3 * S, "began_us": S, "ended_us": 4 * S, "lost_us": 2 * S + 50_000, "back_us": 4 * S,
        "fresh_us": 5 * S, "kept": True,
    }  # fmt: skip
    return leg(7_000, 4 * S, silences=[ObservedSilence(**(given | about))])


@pytest.mark.parametrize(
    ("about", "outcome"),
    [
        ({}, HELD),
        ({"fresh_us": 4 * S + 1_500_001}, FAILED),
        ({"fresh_us": None}, FAILED),
        ({"kept": False}, FAILED),
        ({"lost_us": None}, FAILED),
        ({"lost_us": 3 * S}, FAILED),
        ({"back_us": None}, FAILED),
        ({"for_us": 4 * S}, UNCHECKED),
    ],
)
def test_silence_check_requires_prompt_recovery(about: dict[str, Any], outcome: CheckOutcome) -> None:
    assert checks(BRAKED, silenced(**about))["silence/3s"].outcome == outcome


def test_gaps_between_heartbeats_count_but_for_those_of_a_silence() -> None:
    beats = [300_000 * number for number in range(30)]
    flown = leg(7_000, 4 * S)
    flown.beats = beats
    assert checks(BRAKED, flown)["heartbeat/asked"].outcome == HELD
    flown.beats = [400_000 * number for number in range(30)]
    assert checks(BRAKED, flown)["heartbeat/asked"].outcome == FAILED
    flown = silenced()
    flown.beats = [900_000, 5_200_000, 5_400_000]
    assert checks(BRAKED, flown)["heartbeat/asked"].outcome == HELD


def climbed(climb: int, mean: int) -> ObservedSortie:
    samples = [MotionSample(at * S, 0, 0, mean * at, 0, climb) for at in range(1, 5)]
    command = ObservedCommand(MotionKind.CLIMB, "takeoff", S, 0, False, S, 4 * S, "succeeded")
    return ObservedSortie("climb", samples, [command], ending="completed", down=True)


def test_climb_is_judged_by_its_final_speed() -> None:
    """A stock PX4 takes off at MPC_TKO_SPEED, 1.5 m/s, to which it comes slowly; over 3 m its mean is 0.9 m/s."""
    tenth, height, samples = S // 10, 0, []
    for at in range(50):
        climb = min(1_500, 30 * at)
        height += climb // 10
        samples.append(MotionSample(at * tenth, 0, 0, height, 0, climb))
    rising = [each for each in samples if each.climb >= 300]
    passed = rising[-1].at_us - rising[0].at_us
    assert (rising[-1].height - rising[0].height) * S // passed < 990
    command = ObservedCommand(MotionKind.CLIMB, "takeoff", 0, 0, False, 0, 5 * S, "succeeded")
    flown = ObservedSortie("climb", samples, [command], ending="completed", down=True)
    found = checks(BRAKED, flown)["climb/speed"]
    assert (found.outcome, found.measured) == (HELD, "1.2 m/s over 2 s, 1.5 m/s at most")


@pytest.mark.parametrize(
    ("climb", "mean", "outcome"),
    [(3_600, 990, HELD), (3_601, 2_000, FAILED), (1_000, 989, FAILED)],
)
def test_a_climb_is_neither_faster_nor_slower_than_declared(climb: int, mean: int, outcome: CheckOutcome) -> None:
    """At most 3 m/s are declared: a tenth and 0.3 m/s more is of gusts and reports, less than a third is no climb."""
    assert checks(BRAKED, climbed(climb, mean))["climb/speed"].outcome == outcome


def test_settings_that_a_doctor_warns_of_are_told_and_fail_nothing() -> None:
    warned = VehicleFinding("settings/nav_dll_act", MissionVerdict.WARN, "nothing", "return", "set it")
    stopped = VehicleFinding("settings/x", MissionVerdict.STOP, "wrong", "right", "set it")
    well = VehicleFinding("settings/y", MissionVerdict.OK, "fine")
    found = checks(BRAKED, leg(7_000, 4 * S), settings=(warned, stopped, well))
    assert found["settings/nav_dll_act"].outcome == TOLD
    assert found["settings/x"].outcome == FAILED
    assert found["settings/others"].measured.startswith("1 other")


def test_fence_check_requires_the_fence_parameters() -> None:
    flown = leg(7_000, 4 * S, fence="set", fence_read=True, switches={"FENCE_ENABLE": (1, 1.0), "FENCE_TYPE": (4, 3.0)})
    found = checks(BRAKED, flown)
    assert found["fence/read-back"].outcome == HELD
    assert found["fence/on"].measured == "`FENCE_TYPE` is 3"
    flown.switches = {"FENCE_ENABLE": (1, None)}
    assert checks(BRAKED, flown)["fence/on"].measured == "`FENCE_ENABLE` is not reported"
    assert checks(BRAKED, leg(7_000, 4 * S))["fence/on"].outcome == UNCHECKED


def test_unflown_sortie_is_unchecked_with_reason() -> None:
    found = checks(BRAKED, missing={"leg": "not today", "climb": "too windy"})
    assert found["stop/fly"].measured == "not today"
    assert found["land/down"].measured == "too windy"
    assert {each.outcome for slug, each in found.items() if slug != "firmware/told"} == {UNCHECKED}


def test_whatever_does_not_go_as_planned_ends_it() -> None:
    assert ends_after(leg(7_000, 4 * S)) is None
    assert ends_after(taken(TakeoverKind.MODE, 0)) is None
    aloft = leg(7_000, 4 * S)
    aloft.down = False
    assert "not seen on the ground" in (ends_after(aloft) or "")
    ended = leg(7_000, 4 * S)
    ended.ending = "stood-down"
    assert "stood-down" in (ends_after(ended) or "")


def returned(from_mm: int, *heights: int) -> ObservedSortie:
    """A return from so far north, at 12 m, with these heights on its way, each a metre nearer than the one before."""
    way = [
        MotionSample(20 * S + at * S, place(from_mm - 6 * M - at * M), 0, up, 4 * M, 0) for at, up in enumerate(heights)
    ]
    samples = [MotionSample(0, place(0), 0, 0, 0, 0), MotionSample(19 * S, place(from_mm), 0, 12 * M, 0, 0), *way]
    samples += [MotionSample(40 * S, place(0), 0, 5 * M, 0, -M)]
    home = ObservedCommand(MotionKind.HOME, "return_home", 19 * S, 0, True, 19 * S, 50 * S, "succeeded")
    return ObservedSortie("leg", samples, [home], ending="completed", down=True)


@pytest.mark.parametrize(
    ("from_mm", "heights", "outcome"),
    [
        (40 * M, (30 * M, 29 * M, 28 * M), HELD),
        (40 * M, (30 * M, 27_990, 30 * M), FAILED),
        (12_900, (12 * M,), UNCHECKED),  # within 10 m, and 3 m of position error
        (14 * M, (12 * M,), FAILED),
        (40 * M, (), UNCHECKED),
    ],
)
def test_return_check_judges_the_lowest_height(from_mm: int, heights: tuple[int, ...], outcome: CheckOutcome) -> None:
    assert checks(BRAKED, returned(from_mm, *heights))["return/across"].outcome == outcome


def test_without_a_declared_height_a_return_is_not_looked_at() -> None:
    assert checks(POLICY, returned(40 * M, 12 * M))["return/across"].outcome == UNCHECKED
