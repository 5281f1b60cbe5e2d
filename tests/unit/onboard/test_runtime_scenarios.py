"""Whole runs over a fake vehicle: the mission's reaction to each outcome (design section 4.4)."""

from collections.abc import Iterator
from typing import Any

import pytest
from msgspec.structs import replace

from reference.documents import hand, replacement
from reference.flat_case import (
    BATTERY,
    CONTRACTS,
    FIX,
    GOTO,
    HOVER,
    INVOCATIONS,
    MISSION,
    OBSTACLE,
    POLICY,
    RULES,
    TAKEOFF,
    WIND,
    M,
    S,
)
from reference.world import TICK, FakeVehicle, Run, assert_audited, loaded
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.contract import QUANTITY, Motion, MotionKind, Parameter
from rtshcua.model.flat.mission import Mission, OnInadmissible, Plan
from rtshcua.model.flat.policy import Policy, RuleKind
from rtshcua.onboard.enforcement.executor import Executor
from rtshcua.onboard.enforcement.load import EnforcementMode
from rtshcua.onboard.ports import AirState, CommandFailed, Ending, Hindered, Readings, Ready, Succeeded
from rtshcua.onboard.runtime.limits import Limits
from rtshcua.onboard.runtime.view import RunStage

RUNS: list[Run] = []


@pytest.fixture(autouse=True)
def all_covered() -> Iterator[None]:
    """Each command of every run in this file is covered by an earlier record."""
    yield
    while RUNS:
        assert_audited(RUNS.pop())


def start(*args: object, **options: object) -> Run:
    run = Run(*args, **options)  # type: ignore[arg-type]
    RUNS.append(run)
    return run


def without_permit(*skills: int) -> Policy:
    rules = tuple(r for r in RULES if r.kind != RuleKind.PERMIT or not set(skills) & set(r.skills))
    return replace(POLICY, rules=rules)


def on_inadmissible(step: int, behaviour: OnInadmissible) -> Mission:
    changed = tuple(replace(each, on_inadmissible=behaviour) if each.step == step else each for each in INVOCATIONS)
    return replace(MISSION, invocations=changed)


# ------------------------------------------------------------------------------------------------ all is well


def test_a_normal_flight_completes() -> None:
    run = start().until_over()
    assert run.ending is Ending.COMPLETED
    assert run.flown == ["takeoff", "goto", "inspect_area", "return_home"]
    assert run.decisions == [(0, step, -1, "allow", "admitted") for step in range(4)]
    assert run.events == ["ready", *["dispatched", "succeeded"] * 4]
    assert run.step() == [], "nothing is done after the end"


def test_the_same_events_give_the_same_bytes() -> None:
    first, second = start(), start()
    assert first.until_over().lines == second.until_over().lines


def test_dispatch_latency_is_measured() -> None:
    run = start().until_over()
    remaining = [record["context"]["remaining_us"] for record in run.records if record["type"] == "decision"]  # type: ignore[index]
    assert remaining == [20_000] * 4, "conservative until there are enough measurements"


def test_a_hold_of_the_mission_ends_by_its_time() -> None:
    time = Parameter("time", QUANTITY, "duration", 0, S, 60 * S, ())
    hover = replace(CONTRACTS[HOVER], parameters=(time,), motion=Motion(MotionKind.HOLD, -1, -1, 0), reads=(FIX,))
    chain = tuple(replace(link, arguments=(S,)) if link.skill == HOVER else link for link in POLICY.contingency)
    contracts = tuple(
        replace(
            hover if contract.name == "hover" else contract,
            fallback=tuple(
                replace(link, arguments=(S,)) if link.skill == HOVER else link for link in contract.fallback
            ),
        )
        for contract in CONTRACTS
    )
    policy = replace(POLICY, contracts=contracts, contingency=chain)
    step = replace(
        INVOCATIONS[1],
        skill=HOVER,
        arguments=(30 * S,),
        contract=contracts[HOVER],
        plan=Plan(MotionKind.HOLD, (), 0, 0),
    )
    again = tuple(replace(each, contract=contracts[each.skill]) for each in INVOCATIONS)
    mission = replace(MISSION, invocations=(again[0], step, *again[2:]))
    vehicle = FakeVehicle()
    run = start(loaded(policy, mission), vehicle).until_flies("hover")
    began = run.clock.now().monotonic_us
    vehicle.values |= {5: 110 * M, 6: -20 * M}
    run.until_flies("inspect_area")
    assert run.clock.now().monotonic_us - began == 30 * S, "success is what the vehicle is seen to do"
    assert run.until_over().ending is Ending.COMPLETED


# ----------------------------------------------------------------------------------------- while a skill runs


def test_battery_falling_returns_by_the_degrade_rule() -> None:
    run = start().until_flies("inspect_area")
    run.vehicle.values[BATTERY] = 2_000
    run.until_over()
    assert run.flown[-2:] == ["inspect_area", "return_home"]
    assert run.decisions[-1] == (1, 2, -1, "allow", "admitted"), "the rule's target, before the step's own chain"
    assert "violated" in run.events
    assert run.ending is Ending.ABORTED


def test_brief_breach_between_steps_is_detected() -> None:
    """A backlog brings many states at once: each is watched, not only the last."""
    run = start().until_flies("inspect_area")
    at_us, far = run.clock.now().monotonic_us, run.vehicle.values[OBSTACLE]
    run.step(*(Readings(at_us, ((OBSTACLE, value),)) for value in (far, 1 * M, far)))
    assert run.events[-2:] == ["violated", "dispatched"]
    assert run.flown[-1] == "hover"


def test_wind_over_the_limit_holds_for_its_time_and_then_returns() -> None:
    run = start().until_flies("goto")
    run.vehicle.values[WIND] = 12 * M
    run.until_flies("hover")
    began = run.clock.now().monotonic_us
    run.until_flies("return_home")
    assert run.clock.now().monotonic_us - began == 20 * S
    assert run.until_over().ending is Ending.ABORTED
    assert run.events[-5:] == ["violated", "dispatched", "time-over", "dispatched", "landed"]


def test_a_signal_may_be_missing_within_the_grace() -> None:
    run = start().until_flies("inspect_area")
    run.vehicle.values[OBSTACLE] = None
    for _ in range(9):  # 450 ms of the 500 ms that are granted
        run.tick()
    run.vehicle.values[OBSTACLE] = 20 * M
    assert run.until_over().ending is Ending.COMPLETED


def test_a_signal_that_stays_away_longer_counts_as_false() -> None:
    run = start().until_flies("inspect_area")
    run.vehicle.values[OBSTACLE] = None
    run.until_over()
    assert run.ending is Ending.ABORTED
    assert run.flown[-2:] == ["hover", "return_home"]
    (detail,) = [str(record["detail"]) for record in run.records if record.get("event") == "violated"]
    assert detail.endswith(": unknown for longer than its grace of 500 ms"), "it is told from what was false"


def test_a_signal_that_falls_silent_grows_stale_without_an_event() -> None:
    run = start().until_flies("inspect_area")
    run.vehicle.silent = {OBSTACLE}
    run.vehicle.deaf = {"inspect_area"}
    assert run.until_over().ending is Ending.ABORTED


def test_a_skill_that_lasts_too_long_is_given_up() -> None:
    run = start(vehicle=FakeVehicle(deaf={"goto"}))
    run.until_over(400)
    assert run.flown == ["takeoff", "goto", "hover", "return_home"]
    assert [record["detail"] for record in run.records if record.get("event") == "violated"] == [
        "exceeded its maximum duration"
    ]


def test_timeout_names_the_hindrance() -> None:
    run = start(vehicle=FakeVehicle(deaf={"goto"})).until_flies("goto")
    token = run.vehicle.commands[-1].token
    run.step(Hindered(0, token - 1, "of the one before"))
    run.step(Hindered(0, token, "it flies at 1.0 m/s instead of 5.0 m/s"))
    run.until_over(400)
    details = [record["detail"] for record in run.records if record.get("event") in ("violated", "noted")]
    assert details == [
        "it flies at 1.0 m/s instead of 5.0 m/s",
        "exceeded its maximum duration: it flies at 1.0 m/s instead of 5.0 m/s",
    ]
    assert run.flown == ["takeoff", "goto", "hover", "return_home"]


def test_uncommanded_descent_ends_mission() -> None:
    run = start().until_flies("goto")
    run.tick(AirState(0, False, False))
    assert run.ending is Ending.ABORTED
    assert run.flown[-1] == "goto"


# ------------------------------------------------------------------------------------- not admitted in the air


def test_missing_and_back_before_the_deadline_goes_on_from_a_hold() -> None:
    run = start().until_flies("goto")
    run.vehicle.values[OBSTACLE] = None
    run.until_flies("hover")
    for _ in range(20):
        run.tick()
    run.vehicle.values[OBSTACLE] = 20 * M
    run.until_over()
    assert run.flown == ["takeoff", "goto", "hover", "inspect_area", "return_home"]
    assert run.ending is Ending.COMPLETED
    deferred = [decision for decision in run.decisions if decision[3] == "defer"]
    assert deferred == [(0, 2, -1, "defer", "state/unknown")], "the same answer is recorded once"
    assert "repeated" in run.events


def test_missing_past_the_deadline_falls_back() -> None:
    run = start().until_flies("goto")
    run.vehicle.values[OBSTACLE] = None
    run.until_over()
    assert run.flown == ["takeoff", "goto", "hover", "hover", "return_home"]
    assert (0, 2, -1, "fallback", "timing/no-slack") in run.decisions
    assert run.ending is Ending.ABORTED


def test_denied_in_the_air_flies_the_contingency() -> None:
    run = start(loaded(without_permit(GOTO))).until_over()
    assert run.flown == ["takeoff", "hover", "return_home"]
    assert (0, 1, -1, "deny", "authority/not-permitted") in run.decisions
    assert (2, -1, 0, "allow", "admitted") in run.decisions
    assert run.ending is Ending.ABORTED


def test_denied_in_the_air_ignores_what_the_step_says() -> None:
    run = start(loaded(without_permit(GOTO), on_inadmissible(1, OnInadmissible.SKIP))).until_over()
    assert run.flown == ["takeoff", "hover", "return_home"]
    assert "skipped" not in run.events


def test_inadmissible_may_be_skipped() -> None:
    vehicle = FakeVehicle()
    run = start(loaded(mission=on_inadmissible(2, OnInadmissible.SKIP)), vehicle).until_flies("goto")
    vehicle.values[OBSTACLE] = M
    run.until_over()
    assert run.flown == ["takeoff", "goto", "return_home"]
    assert "skipped" in run.events
    assert run.ending is Ending.COMPLETED


def test_inadmissible_may_be_held_for() -> None:
    run = start(loaded(mission=on_inadmissible(2, OnInadmissible.HOLD))).until_flies("goto")
    run.vehicle.values[OBSTACLE] = M
    run.until_flies("hover")
    run.vehicle.values[OBSTACLE] = 20 * M
    run.until_over()
    assert run.flown == ["takeoff", "goto", "hover", "inspect_area", "return_home"]
    assert run.ending is Ending.COMPLETED


def test_held_for_in_vain_falls_back_at_the_deadline() -> None:
    run = start(loaded(mission=on_inadmissible(2, OnInadmissible.HOLD))).until_flies("goto")
    run.vehicle.values[OBSTACLE] = M
    run.until_over()
    assert run.flown == ["takeoff", "goto", "hover", "hover", "return_home"]
    assert run.ending is Ending.ABORTED


def waiting_to_be_replaced() -> Run:
    """The inspection is not admitted, and its mission requests another step."""
    run = start(loaded(mission=on_inadmissible(2, OnInadmissible.REPLAN))).until_flies("goto")
    run.vehicle.values[OBSTACLE] = M
    run.until_flies("hover")
    assert run.events.count("replan") == 1
    return run


def test_replacement_is_requested_for_a_refused_step() -> None:
    run = waiting_to_be_replaced()
    assert hand(run, replacement(run.loaded, 1)) == "already-released", "what was flown stays"
    assert hand(run, replacement(run.loaded)) == "accepted"
    began_us = run.clock.now().monotonic_us
    run.until_over()
    assert run.flown == ["takeoff", "goto", "hover", "return_home"]
    assert run.ending is Ending.COMPLETED
    (decided,) = [
        each for each in run.records if (each.get("kind"), each.get("step"), each.get("outcome")) == (0, 2, "allow")
    ]
    assert decided["context"]["released_us"] >= began_us, "it has its own time from when it came"  # type: ignore[index]


def test_run_falls_back_at_the_deadline_without_a_replacement() -> None:
    run = waiting_to_be_replaced().until_over()
    assert run.flown == ["takeoff", "goto", "hover", "hover", "return_home"]
    assert (run.ending, run.events.count("replan")) == (Ending.ABORTED, 1)


def test_step_awaiting_replacement_flies_when_admitted() -> None:
    run = waiting_to_be_replaced()
    run.vehicle.values[OBSTACLE] = 20 * M
    run.until_flies("inspect_area")
    assert hand(run, replacement(run.loaded)) == "already-released"
    assert run.until_over().ending is Ending.COMPLETED


def test_the_first_step_is_replaced_on_the_ground() -> None:
    vehicle = FakeVehicle()
    vehicle.values[WIND] = None
    run = start(loaded(mission=on_inadmissible(0, OnInadmissible.REPLAN)), vehicle)
    mission = run.loaded.bundle.mission
    assert hand(run, replacement(run.loaded, 0, replace(mission, issued_at_us=mission.issued_at_us + 1))) == "accepted"
    vehicle.values[WIND] = 2 * M
    assert run.until_over().ending is Ending.COMPLETED


def test_a_step_that_awaits_an_approval_is_not_timed_by_its_deadline() -> None:
    low = INVOCATIONS[2]
    step = replace(low, arguments=(low.arguments[0], 8 * M, *low.arguments[2:]), plan=replace(low.plan, altitude=8 * M))
    run = start(loaded(mission=replace(MISSION, invocations=(*INVOCATIONS[:2], step, INVOCATIONS[3]))))
    run.until_flies("hover")
    began = run.clock.now().monotonic_us
    run.until(lambda run: (0, 2, -1, "deny", "approval/timed-out") in run.decisions)
    assert run.clock.now().monotonic_us - began >= 30 * S
    assert run.until_over().flown == ["takeoff", "goto", "hover", "hover", "return_home"]


# -------------------------------------------------------------------------------------------------- on the ground


@pytest.mark.parametrize(
    ("policy", "values", "reason"),
    [
        (without_permit(TAKEOFF), {}, "authority/not-permitted"),
        (POLICY, {BATTERY: 2_000}, "state/violated"),
        (POLICY, {WIND: 12 * M}, "state/violated"),
    ],
)
def test_refused_on_the_ground_sends_nothing(policy: Policy, values: dict[int, int], reason: str) -> None:
    vehicle = FakeVehicle()
    vehicle.values |= values
    run = start(loaded(policy), vehicle)
    assert run.ending is Ending.REFUSED
    assert run.flown == []
    assert run.decisions[0][4] == reason


def test_deferred_on_the_ground_waits_for_the_deadline_and_is_refused() -> None:
    vehicle = FakeVehicle()
    vehicle.values[FIX] = None
    run = start(vehicle=vehicle)
    for _ in range(39):
        run.tick()
    assert run.ending is None
    run.until_over()
    assert run.ending is Ending.REFUSED
    assert run.flown == []


def test_deferred_on_the_ground_may_still_start() -> None:
    vehicle = FakeVehicle()
    vehicle.values[FIX] = None
    run = start(vehicle=vehicle)
    run.tick()
    vehicle.values[FIX] = 3
    assert run.until_over().ending is Ending.COMPLETED


def test_a_vehicle_that_refuses_to_arm_ends_refused() -> None:
    run = start(vehicle=FakeVehicle(fails={"takeoff"}))
    run.until_over()
    assert run.flown == ["takeoff"]
    assert run.ending is Ending.REFUSED


def test_an_airborne_vehicle_is_left_alone() -> None:
    run = start(vehicle=FakeVehicle(airborne=True, armed=True))
    assert run.ending is Ending.REFUSED
    assert run.flown == []


def test_a_vehicle_that_is_never_ready() -> None:
    run = start(ready=False, limits=Limits(ready_us=5 * S))
    run.until_over()
    assert run.ending is Ending.REFUSED
    assert "never-ready" in run.events


def test_ready_vehicle_without_air_state_waits() -> None:
    run = start(ready=False)
    run.tick(Ready(0))
    assert run.flown == []
    run.tick(Ready(0), AirState(0, False, False))
    assert run.flown == ["takeoff"]


@pytest.mark.parametrize(("airborne", "flown"), [(True, ["hover", "return_home"]), (False, [])])
def test_a_restart_brings_down_what_flies_and_starts_nothing(airborne: bool, flown: list[str]) -> None:
    vehicle = FakeVehicle(airborne=airborne, armed=airborne)
    run = start(vehicle=vehicle, resumed=True).until_over()
    assert run.flown == flown
    assert run.ending is (Ending.ABORTED if airborne else Ending.REFUSED)


# ------------------------------------------------------------------------------------------- how a chain goes on


def test_a_link_that_fails_gives_way_to_the_next() -> None:
    run = start(vehicle=FakeVehicle(fails={"hover", "return_home"})).until_flies("goto")
    run.vehicle.values[WIND] = 12 * M
    run.until_flies("return_home")
    run.until_over()
    assert run.flown[-3:] == ["hover", "return_home", "emergency_land"]
    assert run.ending is Ending.ABORTED


def test_a_link_that_may_not_fly_is_passed_over() -> None:
    run = start().until_flies("goto")
    run.vehicle.values[FIX] = 0
    run.vehicle.fails = {"goto"}
    run.until_over()
    assert run.flown[-1] == "emergency_land"


def test_a_chain_that_is_used_up_is_followed_by_the_contingency() -> None:
    run = start(vehicle=FakeVehicle(fails={"hover", "return_home", "emergency_land"})).until_flies("goto")
    run.vehicle.values[WIND] = 12 * M
    run.until(lambda run: run.flown.count("emergency_land") == 2)
    assert run.flown[2:] == ["hover", "return_home", "emergency_land"] * 2
    run.vehicle.fails = set()
    assert run.until_over().ending is Ending.ABORTED


def test_the_last_link_is_tried_again_and_then_the_run_stands_down() -> None:
    run = start(
        vehicle=FakeVehicle(fails={"hover", "return_home", "emergency_land"}), limits=Limits(tries=3, retry_us=S)
    )
    run.until_flies("goto")
    run.vehicle.values[WIND] = 12 * M
    run.until_over()
    assert run.flown[-5:] == ["return_home", *["emergency_land"] * 4]
    assert run.events[-2:] == ["stranded", "stood-down"]
    assert run.vehicle.released
    assert run.ending is Ending.ABORTED


def test_a_mission_that_ends_in_the_air_is_brought_down() -> None:
    run = start(loaded(mission=replace(MISSION, invocations=INVOCATIONS[:2]))).until_over()
    assert run.flown == ["takeoff", "goto", "hover", "return_home"]
    assert run.ending is Ending.ABORTED


def test_reports_about_ended_commands_are_ignored() -> None:
    run = start().until_flies("goto")
    token = run.vehicle.commands[0].token
    run.tick(Succeeded(0, token), CommandFailed(0, token, "late"), Succeeded(0, 10**9))
    assert run.flown[-1] == "goto"
    assert run.until_over().ending is Ending.COMPLETED


@pytest.mark.parametrize("reason", ["late", "frame/late"])
@pytest.mark.parametrize("skill", ["takeoff", "goto"])
def test_unsent_late_step_is_tried_again(skill: str, reason: str) -> None:
    run = start().until_flies(skill)
    step, released_us = run.runtime.view(run.clock.now()).step, released(run)
    run.tick(CommandFailed(0, run.vehicle.commands[-1].token, reason))
    assert run.flown[-2:] == [skill, skill]
    assert run.decisions[-2:] == [(0, step, -1, "allow", "admitted")] * 2
    assert [each["detail"] for each in run.records if each.get("event") == "refused"] == ["permit/unsent"]
    assert released(run) == released_us, "its deadline stays"
    assert run.until_over().ending is Ending.COMPLETED


def released(run: Run) -> int:
    """When the last decided step was released."""
    context = [record["context"] for record in run.records if record["type"] == "decision"][-1]
    assert isinstance(context, dict)
    return int(context["released_us"])


@pytest.mark.parametrize(("skill", "flown", "ending"), [
    ("takeoff", ["takeoff"], Ending.REFUSED), ("goto", ["takeoff", "goto", "hover"], Ending.ABORTED),
])  # fmt: skip
def test_late_step_is_retried_until_its_deadline(skill: str, flown: list[str], ending: Ending) -> None:
    run = start().until_flies(skill)
    began_us, tries = run.clock.now().monotonic_us, 0
    while run.ending is None and run.flown[-1] == skill:
        tries += 1
        run.tick(CommandFailed(0, run.vehicle.commands[-1].token, "late"))
    waited_us = run.clock.now().monotonic_us - began_us
    assert waited_us <= INVOCATIONS[0].contract.deadline_us + TICK
    assert 2 < tries <= waited_us // TICK + 1
    (last,) = run.decisions[-1:] if ending is Ending.REFUSED else run.decisions[-2:-1]
    assert last[3:] == ("fallback", "timing/no-slack"), run.decisions
    assert list(dict.fromkeys(run.flown)) == flown
    assert run.until_over().ending is ending


@pytest.mark.parametrize("skill", ["takeoff", "goto"])
def test_step_with_a_sent_frame_is_not_repeated(skill: str) -> None:
    run = start().until_flies(skill)
    assert isinstance(run.loaded.executor, Executor)
    run.loaded.executor.frames.let_out = True
    run.tick(CommandFailed(0, run.vehicle.commands[-1].token, "late"))
    assert run.flown.count(skill) == 1
    assert [each["detail"] for each in run.records if each.get("event") == "refused"] == ["permit/sent"]
    run.until_over()


def test_late_hold_does_not_count_as_step() -> None:
    run = start().until_flies("goto")
    run.vehicle.values[WIND] = 12 * M
    run.until_flies("hover")
    run.tick(CommandFailed(0, run.vehicle.commands[-1].token, "late"))
    assert "refused" not in run.events


@pytest.mark.parametrize("again", [False, True])
def test_late_permit_by_boundary_clock_is_withdrawn(again: bool) -> None:
    """The process stood still between decision and dispatch: in the same moment nothing can be done about it."""
    run = start(ready=False)
    executor: Any = run.loaded.executor
    dispatch, slow = executor.dispatch, [Refusal("time-apart", "")]

    def apart(sealed: bytes, now_us: int) -> Any:
        return slow.pop() if slow else dispatch(sealed, now_us)

    executor.dispatch = apart
    if not again:
        executor.withdraw = lambda *_: Refusal("permit/sent", "")
    run.step(AirState(0, False, False), *run.vehicle.poll(run.clock.now().monotonic_us), Ready(0))
    assert (run.flown, run.ending) == ([], None)
    run.tick()
    assert run.flown == ["takeoff"] * again
    assert [each["detail"] for each in run.records if each.get("event") == "refused"] == [
        "time-apart", "permit/unsent" if again else "permit/sent",
    ]  # fmt: skip
    assert run.until_over().ending is (Ending.COMPLETED if again else Ending.REFUSED)


def test_invalid_readings_are_unknown_or_ignored() -> None:
    run = start().until_flies("inspect_area")
    run.tick(Readings(run.clock.now().monotonic_us + TICK, ((99, 1), (-1, 1), (OBSTACLE, 1 << 80))))
    reading = next(r for r in run.runtime.view(run.clock.now()).signals if r.name == "obstacle.distance")
    assert reading.values == (None,)


# --------------------------------------------------------------------------------------------------- mode none


def test_mode_none_records_unenforced_decisions() -> None:
    run = Run(loaded(without_permit(GOTO), mode=EnforcementMode.NONE)).until_over()
    assert (0, 1, -1, "deny", "authority/not-permitted") in run.decisions
    assert run.flown == ["takeoff", "goto", "inspect_area", "return_home"]
    assert run.ending is Ending.COMPLETED


# -------------------------------------------------------------------------------------------------------- view


def test_the_view_follows_the_run() -> None:
    run = start(ready=False)
    view = run.runtime.view(run.clock.now())
    assert (view.stage, view.contract, view.left_us, view.airborne) == (RunStage.WAITING, "takeoff", None, None)
    run.tick(AirState(0, False, False), Ready(0))
    run.until_flies("goto")
    run.tick()
    view = run.runtime.view(run.clock.now())
    assert (view.stage, view.phase, view.step, view.steps) == (RunStage.RUNNING, "inspection", 1, 4)
    assert view.contract == "goto"
    assert view.left_us == 5 * 60 * S - TICK
    assert view.decisions[-1].outcome == "allow"
    assert next(r for r in view.signals if r.name == "battery").values == (9_000,)
    run.vehicle.values[OBSTACLE] = None
    run.until_flies("hover")
    view = run.runtime.view(run.clock.now())
    assert view.stage is RunStage.DECIDING
    assert view.left_us == 2 * S
    assert view.decisions[-2].reason == "state/unknown"
    run.until_over()
    view = run.runtime.view(run.clock.now())
    assert (view.stage, view.left_us, view.ending) == (RunStage.ENDED, None, Ending.ABORTED)
