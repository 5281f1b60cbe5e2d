"""Live missions: a replacement supersedes the running step if it is admitted, and only then; between steps the vehicle
holds. Each run's log passes the audit.
"""

from collections.abc import Iterator

import pytest
from msgspec.structs import replace

from reference.documents import cancellation, hand, recall, replacement
from reference.flat_case import (
    BATTERY,
    BRIDGE,
    GOTO,
    HOME,
    INSPECT,
    INSPECTION,
    LAND,
    MISSION,
    OBSTACLE,
    PATH,
    POLICY,
    WIND,
    M,
    S,
    invocation,
)
from reference.world import FakeVehicle, Run, assert_audited, assert_covered, loaded
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import Invocation, OnInadmissible, Plan
from rtshcua.model.flat.policy import Policy, WithoutEvidence
from rtshcua.onboard.ports import (
    AirState,
    CommandFailed,
    Ending,
    EvidenceFailed,
    EvidenceKept,
    Interrupted,
    LinkBack,
    LinkLost,
    Presented,
    Ready,
    Succeeded,
    TakenOver,
)

IDLE_US = 30 * S
REPLAN = OnInadmissible.REPLAN
START = replace(MISSION, invocations=MISSION.invocations[:1])  # a take-off
RUNS: list[Run] = []


@pytest.fixture(autouse=True)
def audited() -> Iterator[None]:
    """Every run that ended is audited."""
    RUNS.clear()
    yield
    for run in RUNS:
        if run.ending is not None:
            assert_covered(run)
            assert_audited(run)


def live(policy: Policy = POLICY) -> Run:
    """A live run, on the ground."""
    run = Run(loaded(policy, START), FakeVehicle(), idle_us=IDLE_US)
    RUNS.append(run)
    return run


def go(step: int, x: int = 110 * M, altitude: int = 20 * M, on: OnInadmissible = OnInadmissible.ABORT) -> Invocation:
    y = -20 * M
    plan = Plan(MotionKind.FLY, (x, y), altitude, 0)
    return invocation(step, INSPECTION, GOTO, plan, x, y, altitude, on_inadmissible=on)


def inspect(step: int, altitude: int = 20 * M, on: OnInadmissible = OnInadmissible.ABORT) -> Invocation:
    plan = Plan(MotionKind.COVER, PATH, altitude, 4 * M)
    return invocation(step, INSPECTION, INSPECT, plan, BRIDGE, altitude, 0, 4 * M, on_inadmissible=on)


def come(step: int, skill: int = HOME) -> Invocation:
    kind = MotionKind.HOME if skill == HOME else MotionKind.LAND
    return invocation(step, INSPECTION, skill, Plan(kind, (0, 0) if skill == HOME else (), 0, 0))


def document(run: Run, kept: int, *steps: Invocation) -> bytes:
    mission = run.loaded.bundle.mission
    issued_us = mission.issued_at_us + 1
    new = [replace(each, issued_at_us=issued_us) for each in steps]
    return replacement(
        run.loaded, kept, replace(mission, issued_at_us=issued_us, invocations=(*mission.invocations[:kept], *new))
    )


def give(run: Run, kept: int, *steps: Invocation) -> str:
    return hand(run, document(run, kept, *steps))


def aloft(*steps: Invocation) -> Run:
    """A live run that flies the first of these after its take-off."""
    run = live()
    run.until(lambda run: "idle" in run.events)
    if steps:
        assert give(run, 1, *steps) == "accepted"
    return run


def legs(run: Run) -> list[int]:
    """How far east each leg went."""
    return [command.path[0] for command in run.vehicle.commands if command.kind == MotionKind.FLY]


def wait(run: Run, us: int) -> Run:
    until_us = run.clock.now().monotonic_us + us
    return run.until(lambda run: run.clock.now().monotonic_us >= until_us or run.ending is not None)


def home(run: Run) -> None:
    """End the run as its client would."""
    step = len(run.loaded.bundle.mission.invocations)
    assert give(run, step, come(step)) == "accepted"
    assert run.until_over().ending is Ending.COMPLETED


# ---------------------------------------------------------------- superseding


def test_admitted_step_supersedes_the_running_one_at_once() -> None:
    run = aloft(go(1))
    wait(run, S)
    assert give(run, 2, go(2, 150 * M)) == "accepted"
    assert run.flown[-2:] == ["goto", "goto"]
    assert [event for event in run.events if event != "obeyed"][-3:] == ["replacement", "superseded", "dispatched"]
    assert run.vehicle.commands[-1].path == (150 * M, -20 * M)
    run.until(lambda run: run.events.count("idle") == 2)
    assert "violated" not in run.events
    home(run)


def test_superseded_step_lasts_no_longer_and_its_late_report_is_ignored() -> None:
    run = aloft(go(1))
    first = run.vehicle.commands[-1].token
    give(run, 2, go(2, 150 * M))
    run.tick(Succeeded(0, first), CommandFailed(0, first, "no-effect", ""))
    assert run.events.count("succeeded") == 1, "the take-off"
    assert "failed" not in run.events
    home(run)


@pytest.mark.parametrize("on", [OnInadmissible.ABORT, OnInadmissible.SKIP, OnInadmissible.HOLD, REPLAN])
@pytest.mark.parametrize("why", ["denied", "fallback", "outside"])
def test_refused_step_leaves_the_running_one_alone_and_is_never_requested_again(why: str, on: OnInadmissible) -> None:
    run = aloft(go(1))
    wait(run, S // 2)
    run.vehicle.values[BATTERY] = 3_000  # enough for a leg, too little for an inspection
    new = {"denied": inspect(2, 40 * M, on), "fallback": inspect(2, on=on), "outside": go(2, 700 * M, on=on)}[why]
    assert give(run, 2, new) == "accepted"
    assert run.events[-1] == "declined"
    decided = [each for each in run.decisions if each[:2] == (0, 2)]
    assert len(decided) == 1
    run.until(lambda run: run.events.count("idle") == 2)
    assert run.flown[:2] == ["takeoff", "hover"], "between the first two steps"
    assert run.flown[2:] in (["goto"], ["goto", "hover"])
    wait(run, 5 * S)
    assert [each for each in run.decisions if each[:2] == (0, 2)] == decided
    run.vehicle.values[BATTERY] = 9_000
    replaceable = why == "denied" or (on is REPLAN)
    kept = 2 if replaceable else 3
    assert give(run, kept, go(kept, 150 * M)) == "accepted"
    assert run.flown[-1] == "goto", "the next one is flown"
    home(run)


def test_deferred_step_is_requested_until_it_is_admitted_while_the_running_one_flies() -> None:
    run = aloft(go(1))
    run.vehicle.deaf.add("goto")
    run.vehicle.silent.add(OBSTACLE)
    wait(run, 2 * S)
    assert give(run, 2, inspect(2)) == "accepted"
    wait(run, S)
    assert run.flown[-1] == "goto"
    assert run.decisions[-1][3] == "defer"
    assert "declined" not in run.events
    run.vehicle.silent.clear()
    run.until_flies("inspect_area")
    assert run.events.count("superseded") == 1
    run.until(lambda run: run.events.count("idle") == 2)
    home(run)


def test_deferred_step_is_declined_at_its_deadline() -> None:
    run = aloft(go(1))
    run.vehicle.deaf.add("goto")
    run.vehicle.silent.add(OBSTACLE)
    wait(run, 2 * S)
    give(run, 2, inspect(2))
    run.until(lambda run: "declined" in run.events)
    assert (0, 2, -1, "fallback", "timing/no-slack") in run.decisions
    assert run.flown[-1] == "goto"
    assert run.ending is None
    run.vehicle.deaf.clear()
    run.until(lambda run: run.events.count("idle") == 2)
    home(run)


def test_step_that_waits_when_the_running_one_ends_keeps_its_release_and_holds_the_vehicle() -> None:
    run = aloft(go(1))
    run.vehicle.silent.add(OBSTACLE)
    wait(run, S)
    give(run, 2, inspect(2))
    given_us = run.clock.now().monotonic_us
    run.until(lambda run: run.events.count("succeeded") == 2)
    assert run.ending is None
    run.until(lambda run: "declined" in run.events)
    waited_us = run.clock.now().monotonic_us - given_us
    assert 2 * S - 100_000 <= waited_us <= 2 * S + 100_000, "of its deadline nothing was given back"
    run.until(lambda run: run.events.count("idle") == 2)
    home(run)


# ---------------------------------------------------------------- the running step ends otherwise meanwhile


def waits_for_approval() -> Run:
    """A leg flies, and an inspection waits for a supervisor."""
    run = aloft(go(1))
    run.vehicle.deaf.add("goto")
    assert give(run, 2, inspect(2, 8 * M)) == "accepted"
    assert run.decisions[-1][3:] == ("defer", "approval/awaited")
    return run


def test_violated_step_falls_back_by_its_own_chain_while_a_new_one_waits() -> None:
    run = waits_for_approval()
    run.vehicle.values[WIND] = 20 * M
    run.until(lambda run: "violated" in run.events)
    assert (1, 1, 0, "allow", "admitted") in run.decisions, "the boundary decides on its links as ever"
    assert "undecided" not in run.events
    assert hand(run, document(run, 3, go(3))) == "falling-back"
    assert run.until_over().flown[2:] == ["goto", "hover", "return_home"]
    assert run.ending is Ending.ABORTED


def test_degrade_rule_of_the_running_step_flies_its_target_while_a_new_one_waits() -> None:
    run = waits_for_approval()
    run.vehicle.values[BATTERY] = 2_400
    run.until(lambda run: "violated" in run.events)
    assert (1, 1, -1, "allow", "admitted") in run.decisions
    assert run.until_over().flown[2:] == ["goto", "return_home"]


def test_failed_step_falls_back_while_a_new_one_waits() -> None:
    run = waits_for_approval()
    run.tick(CommandFailed(0, run.vehicle.commands[-1].token, "no-effect", ""))
    assert run.until_over().ending is Ending.ABORTED
    assert run.flown[2:5] == ["goto", "hover", "return_home"]


@pytest.mark.parametrize("paper", [recall, cancellation])
def test_recall_and_cancellation_end_a_flight_with_a_waiting_step(paper: object) -> None:
    run = waits_for_approval()
    assert hand(run, paper(run.loaded, now=run.clock.now())) == "accepted"  # type: ignore[operator]
    expected = Ending.RECALLED if paper is recall else Ending.CANCELLED
    assert run.until_over().ending is expected
    assert run.flown[-2:] == ["hover", "return_home"]


def test_takeover_ends_a_flight_with_a_waiting_step() -> None:
    run = waits_for_approval()
    run.tick(TakenOver(0, "POSHOLD"))
    assert run.ending is Ending.STOOD_DOWN


def test_interruption_brings_a_flight_with_a_waiting_step_down() -> None:
    run = waits_for_approval()
    run.tick(Interrupted(0))
    assert run.until_over().ending is Ending.INTERRUPTED


# ---------------------------------------------------------------- several replacements


def test_newest_of_two_replacements_of_one_moment_flies() -> None:
    run = aloft(go(1))
    first = document(run, 2, go(2, 150 * M))
    run.tick(Presented(0, first, 1))
    assert give(run, 3, go(3, 130 * M)) == "accepted"
    assert run.events.count("superseded") == 2
    assert legs(run) == [110 * M, 150 * M, 130 * M]
    home(run)


@pytest.mark.parametrize(("on", "kept"), [(REPLAN, 2), (OnInadmissible.ABORT, 3)])
def test_waiting_step_is_itself_superseded(on: OnInadmissible, kept: int) -> None:
    """A step with `on inadmissible replan` may be replaced; another one is kept, and passed over."""
    run = aloft(go(1))
    run.vehicle.deaf.add("goto")
    give(run, 2, inspect(2, 8 * M, on))
    if on is REPLAN:
        assert give(run, 2, go(2, 150 * M)) == "accepted"
    else:
        assert give(run, 2, go(2, 150 * M)) == "already-released"
        assert give(run, 3, go(3, 150 * M)) == "accepted"
    assert run.flown[-2:] == ["goto", "goto"]
    run.vehicle.deaf.clear()
    run.until(lambda run: run.events.count("idle") == 2)
    assert not [each for each in run.decisions if each[:4] == (0, 2, -1, "allow")] or kept == 2
    home(run)


def test_steps_that_a_replacement_keeps_are_flown_first() -> None:
    run = aloft(go(1), go(2, 150 * M))
    assert give(run, 3, go(3, 130 * M)) == "accepted"
    assert "superseded" not in run.events
    run.until(lambda run: run.events.count("idle") == 2)
    assert legs(run) == [110 * M, 150 * M, 130 * M]
    home(run)


def test_whole_mission_supersedes_and_its_later_steps_behave_as_in_any_mission() -> None:
    run = aloft(go(1))
    give(run, 2, go(2, 150 * M), inspect(3))
    run.vehicle.values[BATTERY] = 3_000
    run.until(lambda run: (0, 3, -1, "fallback", "state/violated") in run.decisions)
    assert run.until_over().ending is Ending.ABORTED, "it is not a request of this moment: its fallback flies"


def test_declined_replacement_takes_all_its_steps_with_it() -> None:
    run = aloft(go(1))
    give(run, 2, inspect(2, 40 * M), go(3, 150 * M))
    run.until(lambda run: run.events.count("idle") == 2)
    assert legs(run) == [110 * M]
    assert give(run, 2, come(2)) == "accepted", "a denied step may be replaced, and those after it were never requested"
    assert run.until_over().ending is Ending.COMPLETED


# ---------------------------------------------------------------- between steps


def test_hold_between_steps_is_bounded_and_ends_with_the_contingency() -> None:
    run = aloft()
    began_us = run.clock.now().monotonic_us
    run.until(lambda run: "idle-over" in run.events)
    assert run.clock.now().monotonic_us - began_us == pytest.approx(IDLE_US, abs=200_000)
    assert run.until_over().flown == ["takeoff", "hover", "hover", "return_home"]
    assert run.ending is Ending.ABORTED


def test_idle_time_begins_anew_with_each_step() -> None:
    run = aloft()
    for step in range(1, 4):
        wait(run, IDLE_US - 2 * S)
        assert give(run, step, go(step, 110 * M + step * M)) == "accepted"
        run.until(lambda run, step=step: run.events.count("idle") == step + 1)
    assert "idle-over" not in run.events
    home(run)


def test_degrade_rule_is_watched_between_steps() -> None:
    run = aloft(go(1))
    run.until(lambda run: run.events.count("idle") == 2)
    run.vehicle.values[BATTERY] = 2_400
    run.until(lambda run: "violated" in run.events)
    assert (1, 1, -1, "allow", "admitted") in run.decisions
    assert run.until_over().ending is Ending.ABORTED


def test_declined_step_between_steps_leaves_the_vehicle_holding() -> None:
    run = aloft(go(1))
    run.until(lambda run: run.events.count("idle") == 2)
    holds = run.flown[-1] == "hover"
    assert give(run, 2, inspect(2, 40 * M)) == "accepted"
    wait(run, 5 * S)
    assert run.ending is None
    assert run.events.count("declined") == 1
    assert (run.flown[-1] == "hover") or not holds
    run.vehicle.values[BATTERY] = 2_400
    run.until(lambda run: "violated" in run.events)
    assert (1, 1, -1, "allow", "admitted") in run.decisions, "by the chain of the step that flew last"
    assert run.until_over().flown[-1] == "return_home"


def test_step_that_waits_between_steps_is_superseded_by_a_newer_one() -> None:
    run = aloft(inspect(1, 8 * M))
    assert run.decisions[-1][3] == "defer"
    assert give(run, 2, go(2)) == "accepted"
    assert run.flown[-1] == "goto"
    run.until(lambda run: run.events.count("idle") == 2)
    home(run)


def test_cancellation_between_steps_flies_the_contingency() -> None:
    run = aloft()
    assert hand(run, cancellation(run.loaded, now=run.clock.now())) == "accepted"
    assert run.until_over().ending is Ending.CANCELLED
    assert run.flown[-1] == "return_home"


def test_silence_between_steps_does_not_count_as_waiting() -> None:
    run = aloft()
    wait(run, IDLE_US - 5 * S)
    run.vehicle.mute = True
    run.tick(LinkLost(0))
    wait(run, 10 * S)
    run.vehicle.mute = False
    run.tick(LinkBack(0))
    wait(run, 3 * S)
    assert "idle-over" not in run.events
    run.until(lambda run: "idle-over" in run.events)
    run.until_over()


# ---------------------------------------------------------------- the ground, and the way there


def test_landing_completes_the_mission() -> None:
    run = aloft(come(1, LAND))
    assert run.until_over().ending is Ending.COMPLETED


def test_return_that_a_client_commanded_may_be_superseded() -> None:
    run = aloft(go(1))
    run.until(lambda run: run.events.count("idle") == 2)
    assert give(run, 2, come(2)) == "accepted"
    wait(run, S)
    assert run.flown[-1] == "return_home"
    assert give(run, 3, go(3)) == "accepted"
    assert run.flown[-1] == "goto"
    run.until(lambda run: run.events.count("idle") == 3)
    home(run)


def test_return_of_a_fallback_is_not_superseded() -> None:
    run = aloft(go(1))
    run.vehicle.deaf.add("goto")
    run.vehicle.values[BATTERY] = 2_400
    run.until_flies("return_home")
    assert give(run, 2, go(2)) == "falling-back"
    assert run.until_over().ending is Ending.ABORTED


def test_step_that_waits_at_a_landing_is_declined_and_the_mission_is_completed() -> None:
    run = aloft(come(1, LAND))
    run.vehicle.silent.add(OBSTACLE)
    wait(run, S + S // 2)
    assert give(run, 2, inspect(2, 8 * M)) == "accepted"
    assert run.until_over().ending is Ending.COMPLETED
    assert run.events.count("declined") == 1
    assert run.flown[-1] == "emergency_land"


def test_step_waits_until_the_take_off_is_in_the_air() -> None:
    run = live()
    run.until_flies("takeoff")
    wait(run, S)
    assert give(run, 1, go(1)) == "accepted"
    assert not [each for each in run.decisions if each[:2] == (0, 1)], "the vehicle is on the ground"
    run.until_flies("goto")
    (decided,) = [each for each in run.records if (each.get("kind"), each.get("step")) == (0, 1) and "context" in each]
    assert decided["at_us"] - decided["context"]["released_us"] < S, "its time begins in the air"  # type: ignore
    run.until(lambda run: run.events.count("idle") == 1)
    home(run)


def test_refusal_on_the_ground_ends_the_run_as_ever() -> None:
    on_ground = Run(loaded(mission=START), FakeVehicle(), ready=False, idle_us=IDLE_US)
    on_ground.vehicle.values[BATTERY] = 3_000
    on_ground.step(AirState(0, False, False), *on_ground.vehicle.poll(0), Ready(0))
    assert on_ground.until_over().ending is Ending.REFUSED
    assert on_ground.flown == []


# ---------------------------------------------------------------- evidence, time, restart


def test_no_step_supersedes_while_records_cannot_be_stored() -> None:
    run = live(replace(POLICY, without_evidence=WithoutEvidence.REFUSE))
    run.until(lambda run: "idle" in run.events)
    give(run, 1, go(1))
    run.until_flies("goto")
    run.vehicle.deaf.add("goto")
    run.tick(EvidenceFailed(0, "disk full"))
    assert give(run, 2, go(2, 150 * M)) == "accepted"
    wait(run, S)
    assert run.flown.count("goto") == 1
    run.tick(EvidenceKept(0))
    run.until(lambda run: run.flown.count("goto") == 2)
    run.vehicle.deaf.clear()
    run.until(lambda run: run.events.count("idle") == 2)
    home(run)


def test_superseding_step_that_was_too_late_is_requested_again() -> None:
    run = aloft(go(1))
    run.vehicle.deaf.add("goto")
    give(run, 2, go(2, 150 * M))
    run.tick(CommandFailed(0, run.vehicle.commands[-1].token, "late", ""))
    run.until(lambda run: run.flown.count("goto") == 3)
    assert run.vehicle.commands[-1].path[:1] == (150 * M,)
    run.vehicle.deaf.clear()
    run.until(lambda run: run.events.count("idle") == 2)
    home(run)


def test_restart_in_the_air_flies_the_contingency_however_live_the_mission_was() -> None:
    vehicle = FakeVehicle(armed=True, airborne=True)
    run = Run(loaded(mission=START), vehicle, resumed=True, idle_us=IDLE_US)
    assert run.until_over().flown == ["hover", "return_home"]


def test_mission_that_is_not_live_is_replaced_as_ever() -> None:
    run = Run(loaded(mission=replace(MISSION, invocations=(*MISSION.invocations[:2], come(2)))))
    run.until_flies("goto")
    assert hand(run, document(run, 2, go(2, 150 * M), come(3))) == "accepted"
    assert "superseded" not in run.events
    assert run.until_over().flown == ["takeoff", "goto", "goto", "return_home"]
