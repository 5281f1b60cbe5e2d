"""Minimised defects that campaigns found: each of these scenarios failed once."""

import json

import pytest

from campaign.flying import SKILLS, flown
from campaign.test_wrong import at, of, slugs
from rtshcua.campaign.scenario_source import incident_text
from rtshcua.model import faults
from rtshcua.model.faults import Direction, Fault, FlightMode
from rtshcua.model.scenario import AtTime, Incident
from rtshcua.virtual.flight_record import ScenarioFlown
from rtshcua.virtual.judge import judge

S = 1_000_000


def test_target_during_a_copter_takeoff_is_a_takeover() -> None:
    """Regression: in a takeoff no target was expected, so the run overrode a pilot's go-to."""
    was = flown(of("ardupilot", at(7, faults.PilotGoto(0, -32_000, 17_000, 21_000))))
    assert next(each for each in was.samples if each.at_us >= 7 * S).climb_mm_s > 1_000, "it no longer climbs then"
    assert (was.ending, slugs(was)) == ("stood-down", set())


@pytest.mark.slow
def test_frame_refused_as_late_is_not_taken_for_the_next() -> None:
    """Regression of the judge: it took the following stop for the late frame. The step is tried again."""
    was = flown(of("px4", at(26.5, faults.MessageSilence(0, "HEARTBEAT", 3 * S))))
    assert any("frame/late" in str(record(line).get("detail")) for life in was.lives for line in life.lines)
    assert (was.ending, slugs(was)) == ("completed", set())


@pytest.mark.slow
def test_supervision_waits_for_fresh_state_after_a_silence() -> None:
    """Regression of the judge: a grace ran on although frozen readings were not fresh yet."""
    for_good = flown(of("px4", at(9.5, faults.Freeze(0)), at(13.2, faults.Stall(0, 5_300_000, 638))))
    assert {"fresh", "violated"} <= events(for_good)
    assert slugs(for_good) == set()
    silence = at(50.1, faults.LinkSilence(0, 1_500_000, Direction.BOTH, held=True))
    for_a_while = flown(of("ardupilot", silence, at(50, faults.Freeze(0, 7 * S))))
    assert "fresh" in events(for_a_while)
    assert slugs(for_a_while) == set()


def events(was: ScenarioFlown) -> set[str]:
    return {record(line).get("event") for life in was.lives for line in life.lines}


def record(line: bytes) -> dict[str, object]:
    found: dict[str, object] = json.loads(line)
    return found


def test_motor_stop_low_in_a_takeoff_is_not_a_landing() -> None:
    """Regression: below 3 m a slow vehicle counted as landed, also at the top of its path."""
    for kills_s in (6.3, 6.68, 7.3):
        assert slugs(flown(of("ardupilot", at(kills_s, faults.Kill(0))))) == set()


@pytest.mark.slow
def test_px4_failsafe_in_the_current_mode_is_a_takeover() -> None:
    """Regression: the fence holds the vehicle in Hold, the mode of the runtime's stop, and the run overrode it."""
    for lost, jump_s in (
        (at(22, faults.MessageSilence(0, "GPS_RAW_INT", 8 * S)), 27), (at(30, faults.GpsLoss(0, 4 * S)), 31),
    ):  # fmt: skip
        was = flown(of("px4", lost, at(jump_s, faults.GpsJump(0, 60_000, 0))))
        assert any(each.taken_over_by == "failsafe" for each in was.samples), "nothing took over"
        assert (was.ending, slugs(was)) == ("stood-down", set())


@pytest.mark.slow
def test_standing_down_on_a_stuck_mode_is_excused() -> None:
    """It cannot be distinguished from a pilot who chose the previous mode again."""
    was = flown(of("ardupilot", at(41.2, faults.MessageStuck(0, "HEARTBEAT", 4 * S))))
    assert (was.ending, slugs(was)) == ("stood-down", set())
    assert {each.cause for each in judge(was).exceptions} == {"report"}


#: when each kind of command flies in the field mission: kind and seconds, by flavour
FLIES = {
    ("px4", "climb"): 5, ("px4", "leg"): 13, ("px4", "cover"): 30, ("px4", "hold"): 43, ("px4", "home"): 48,
    ("ardupilot", "climb"): 5, ("ardupilot", "leg"): 13, ("ardupilot", "cover"): 30, ("ardupilot", "hold"): 40,
    ("ardupilot", "home"): 46,
}  # fmt: skip
PAUSE, GOTO, HOME, TAKEOFF = (
    faults.PilotPause(0),
    faults.PilotGoto(0, -20_000, 20_000, 10_000),
    faults.PilotMode(0, FlightMode.RETURN),
    faults.PilotMode(0, FlightMode.TAKEOFF),
)
#: how many of these `make test` flies
_OFTEN = {
    ("px4", "climb", PAUSE),
    ("px4", "leg", PAUSE),
    ("ardupilot", "leg", GOTO),
    ("ardupilot", "cover", HOME),
    ("px4", "hold", TAKEOFF),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("flavour", "kind", "does"),
    [
        pytest.param(
            flavour, kind, does, id=f"{flavour} {kind} {incident_text(AtTime(0, 0), does, SKILLS)}",
            marks=[] if (flavour, kind, does) in _OFTEN else [pytest.mark.soak],
        )
        for flavour, kind in FLIES
        for does in (PAUSE, GOTO, HOME, TAKEOFF)
        # ArduCopter reports no pause and has no takeoff mode; PX4 reports no pause of a stopped vehicle, and selecting
        # the
        # current mode is invisible
        if not (does is PAUSE and (flavour == "ardupilot" or kind == "hold")) and not (does is HOME and kind == "home")
        if not (does is TAKEOFF and (flavour == "ardupilot" or kind == "climb"))
    ],
)  # fmt: skip
def test_takeover_while_the_runtime_is_dead_is_respected(flavour: str, kind: str, does: Fault) -> None:
    """Regression: the mode was one of the runtime's, so the restarted run took the flight for its own."""
    at_s = FLIES[flavour, kind]
    was = flown(of(flavour, at(at_s, faults.RuntimeKilled(0, 3 * S)), at(at_s + 1, does)))
    assert was.samples[-1].taken_over_by == "pilot"
    assert (was.ending, slugs(was), judge(was).exceptions) == ("stood-down", set(), ())


@pytest.mark.slow
@pytest.mark.parametrize(("killed_s", "taken_s", "dead_s"), [(9, 11, 6), (43, 44, 10)], ids=["climb", "hold"])
def test_pilot_takeoff_in_the_air_is_detected_at_its_end(killed_s: int, taken_s: int, dead_s: int) -> None:
    """It ends in Hold, 2.5 m above the runtime's target."""
    was = flown(of("px4", at(killed_s, faults.RuntimeKilled(0, dead_s * S)), at(taken_s, TAKEOFF)))
    assert next(each.mode for each in was.samples if each.at_us >= (killed_s + dead_s) * S) is FlightMode.LOITER
    assert (was.ending, slugs(was), was.samples[-1].taken_over_by) == ("stood-down", set(), "pilot")


@pytest.mark.slow
def test_takeoff_pause_is_excused_after_a_mode_change_without_effect() -> None:
    """Regression of the judge: it took the selection of ArduCopter's current mode for the takeover, not the pause."""
    was = flown(of("ardupilot", at(7, faults.PilotMode(0, FlightMode.GUIDED)), at(7, PAUSE)))
    assert (was.samples[-1].taken_over_by, slugs(was)) == ("pilot", set())
    assert {each.cause for each in judge(was).exceptions} == {"unseen"}


@pytest.mark.slow
def test_paused_return_is_not_taken_for_the_previous_hold() -> None:
    """The return is not acknowledged yet, and the place is centimetres from the hold's."""
    was = flown(of("px4", at(44.58, faults.RuntimeKilled(0, 200_000)), at(44.8, PAUSE)))
    assert was.samples[-1].taken_over_by == "pilot"
    assert (was.ending, slugs(was)) == ("stood-down", set())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("flavour", "kind"),
    [
        pytest.param(*each, marks=[] if each in {("px4", "hold"), ("ardupilot", "leg")} else [pytest.mark.soak])
        for each in FLIES
    ],
)
def test_restarted_run_brings_down_an_untouched_vehicle(flavour: str, kind: str) -> None:
    was = flown(of(flavour, at(FLIES[flavour, kind], faults.RuntimeKilled(0, 3 * S))))
    assert (was.ending, slugs(was), was.samples[-1].in_air) == ("aborted", set(), False)


@pytest.mark.slow
def test_frame_arriving_after_a_restart_is_not_a_takeover() -> None:
    """Regression: the hold of the recall was in flight when the process died. Its mode showed later, and counted as a
    pilot's.
    """
    late, call = at(19, faults.LinkDelay(0, 900_000)), at(20, faults.Recall(0))
    was = flown(of("ardupilot", late, call, at(20.1, faults.RuntimeKilled(0, 500_000))))
    assert (was.ending, slugs(was), was.samples[-1].in_air) == ("aborted", set(), False)


@pytest.mark.slow
@pytest.mark.parametrize(("flavour", "at_s"), [("px4", 38.283), ("ardupilot", 35.447)])
def test_leg_arriving_after_a_stop_is_not_a_takeover(flavour: str, at_s: float) -> None:
    """Regression: on a slow link the run stood down in the air without a takeover."""
    was = flown(of(flavour, at(1.5, faults.LinkDelay(0, 400_000)), at(at_s, faults.Recall(0))))
    assert (was.ending, slugs(was), was.samples[-1].in_air) == ("recalled", set(), False)


def test_pause_at_the_end_of_a_leg_without_a_runtime_is_detected() -> None:
    """The pause's target is decimetres from the end of the leg."""
    was = flown(of("px4", at(11.3, faults.RuntimeKilled(0, 11 * S)), at(22.27, PAUSE)))
    assert was.samples[-1].taken_over_by == "pilot"
    assert (was.ending, slugs(was), judge(was).exceptions) == ("stood-down", set(), ())


@pytest.mark.parametrize("at_s", [17.8, 18.35])
def test_pause_near_the_target_of_a_leg_is_detected(at_s: float) -> None:
    """Regression: the reported stopping point is decimetres from the leg's target and counted as it, also just after
    the next leg was sent.
    """
    was = flown(of("px4", at(at_s, PAUSE)))
    assert next(each for each in was.samples if each.at_us >= at_s * S).speed_mm_s > 1_500, "it has come to its end"
    assert (was.ending, slugs(was), judge(was).exceptions) == ("stood-down", set(), ())


@pytest.mark.slow
def test_pause_at_the_target_of_a_leg_is_detected_until_the_next() -> None:
    """Two reports before the next leg show it. Later it crosses the next leg's frame and is excused."""
    seen = flown(of("px4", at(26.9, PAUSE)))
    assert (seen.ending, slugs(seen), judge(seen).exceptions) == ("stood-down", set(), ())
    crossed = flown(of("px4", at(27.1, PAUSE)))
    assert slugs(crossed) == set()
    assert {each.cause for each in judge(crossed).exceptions} == {"crossed"}


def test_restart_waits_for_a_late_target_report() -> None:
    mute = at(15.5, faults.MessageSilence(0, "POSITION_TARGET_GLOBAL_INT", 2_300_000))
    was = flown(of("px4", at(13, faults.RuntimeKilled(0, 3 * S)), at(14, GOTO), mute))
    assert (was.ending, slugs(was)) == ("stood-down", set())


@pytest.mark.parametrize(
    "taken",
    [at(468, faults.BatteryLevel(0, 900)), at(513.5, faults.PilotMode(0, FlightMode.LAND))],
    ids=["failsafe", "pilot"],
)
@pytest.mark.soak  # each flies for nine minutes
def test_landing_is_not_repeated_after_others_landed_the_vehicle(taken: Incident) -> None:
    """The runtime's frame was lost, but the mode was the one that it requests."""
    was = flown(of("ardupilot", at(35, faults.LinkSilence(0, None, Direction.UP)), taken))
    assert (was.ending, slugs(was), was.samples[-1].in_air) == ("aborted", set(), False)
    assert judge(was).exceptions == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hides", "cause"),
    [
        (faults.Freeze(0), "unseen"),
        (faults.MessageStuck(0, "POSITION_TARGET_GLOBAL_INT"), "unseen"),
        (faults.MessageStuck(0, "GPS_RAW_INT"), None),
    ],
)
def test_px4_pause_during_a_stuck_target_is_excused(hides: Fault, cause: str | None) -> None:
    """The mode is Hold as before. Only a fault that hides the target is an excuse."""
    was = flown(of("px4", at(23, hides), at(24, PAUSE), at(24.7, faults.Recall(0))))
    motion = [each for each in judge(was).exceptions if each.slug == "motion-after-takeover"]
    assert "motion-after-takeover" not in slugs(was)
    assert {each.cause for each in motion} == ({cause} if cause else set())
