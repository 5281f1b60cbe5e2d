"""A silence of the vehicle, in every stage: nothing is judged on the state from before it."""

from collections.abc import Callable
from itertools import permutations
from random import Random

import pytest
from msgspec.structs import replace

from reference.flat_case import (
    BATTERY,
    CONTRACTS,
    FIX,
    HEIGHT,
    INSPECT,
    LINK,
    MIN,
    MISSION,
    OBSTACLE,
    POLICY,
    POSITION_X,
    POSITION_Y,
    WIND,
    M,
    S,
)
from reference.world import TICK, FakeVehicle, Run, assert_audited, loaded, renewed
from rtshcua.model.flat.policy import AfterSilence
from rtshcua.onboard.ports import (
    AirState,
    CommandFailed,
    Ending,
    Event,
    Interrupted,
    LinkBack,
    LinkLost,
    Readings,
    Succeeded,
    TakenOver,
    VehicleAnswers,
)
from rtshcua.onboard.runtime.limits import Limits
from rtshcua.onboard.runtime.view import RunStage
from virtual.rows import rows

LOST_US = S  # a link counts as lost when it was silent for so long
EACH_US = 50_000  # the first messages after a silence come so far apart
SILENCES = [0.5, 1, 2.5, 3.5, 5, 8, 20, 45]
ORDERS = range(3)

#: as in the shipped policy: most signals are stale after 2 s, and a step may wait for a minute
STALE = {BATTERY: 5 * S, WIND: 10 * S, LINK: 5 * S}
SIGNALS = tuple(replace(one, stale_us=STALE.get(one.slot, 2 * S)) for one in POLICY.signals)
PATIENT = tuple(replace(one, deadline_us=10 * MIN) for one in CONTRACTS)
#: the vehicle's endurance, which limits the wait for it: short, to keep the tests fast
SHORT = replace(POLICY.vehicle, endurance_us=4 * MIN)
GRACE_US = CONTRACTS[INSPECT].grace_us


def world(after: AfterSilence = AfterSilence.CONTINGENCY) -> object:
    policy = replace(POLICY, vehicle=SHORT, signals=SIGNALS, contracts=PATIENT, after_silence=after)
    invocations = tuple(replace(one, contract=PATIENT[one.skill]) for one in MISSION.invocations)
    return loaded(policy, replace(MISSION, invocations=invocations))


OF = {after: world(after) for after in AfterSilence}


def start(after: AfterSilence = AfterSilence.CONTINGENCY, **more: object) -> Run:
    return Run(renewed(OF[after]), **more)  # type: ignore[arg-type]


# ------------------------------------------------------------------------------------------------------- stages


def waiting(after: AfterSilence) -> Run:
    return start(after, ready=False).until(lambda run: run.clock.now().monotonic_us > 501 * S)


def deferred_on_the_ground(after: AfterSilence) -> Run:
    vehicle = FakeVehicle()
    vehicle.values[FIX] = None
    return start(after, vehicle=vehicle)


def taking_off(after: AfterSilence) -> Run:
    run = start(after, vehicle=FakeVehicle(deaf={"takeoff"}))
    run.tick(AirState(0, True, True))
    return run


def running(after: AfterSilence) -> Run:
    run = start(after, vehicle=FakeVehicle(deaf={"inspect_area"})).until_flies("inspect_area")
    run.tick()
    return run


def holding(after: AfterSilence) -> Run:
    run = start(after).until_flies("goto")
    run.vehicle.values[OBSTACLE] = None
    run.until_flies("hover")
    return run


def falling(after: AfterSilence) -> Run:
    run = start(after).until_flies("goto")
    run.vehicle.values[WIND] = 12 * M
    return run.until_flies("hover")


def returning(after: AfterSilence) -> Run:
    run = falling(after)
    run.vehicle.deaf = {"return_home"}
    return run.until_flies("return_home")


GROUND = (waiting, deferred_on_the_ground)
MISSION_FLIES = (taking_off, running, holding)
AIR = (*MISSION_FLIES, falling, returning)


def is_tried(at: int, row: int, order: int) -> bool:
    return (at + row) % 2 == 0 and order == (at + row) // 2 % len(ORDERS)


#: every other silence in every situation, each in one order of what comes first after it; the others are for soak
TRIED = [
    pytest.param(situation, seconds, order, marks=() if is_tried(at, row, order) else pytest.mark.soak)
    for at, situation in enumerate((*GROUND, *AIR))
    for row, seconds in enumerate(SILENCES)
    for order in ORDERS
]
Situation = Callable[[AfterSilence], Run]


def pass_time(run: Run, us: int) -> None:
    """The vehicle is silent."""
    until_us = run.clock.now().monotonic_us + us
    while run.clock.now().monotonic_us < until_us:
        run.clock.advance(min(TICK, until_us - run.clock.now().monotonic_us))
        run.step()


def be_silent(run: Run, seconds: float) -> None:
    """Nothing is received for this time; after a second the link counts as lost."""
    whole_us = int(seconds * S)
    pass_time(run, min(whole_us, LOST_US))
    if whole_us > LOST_US:
        run.step(LinkLost(run.clock.now().monotonic_us, "silent"))
        pass_time(run, whole_us - LOST_US)


def come_back(run: Run, order: int, missing: frozenset[int] = frozenset()) -> None:
    """The first messages, one by one in any order, after the one that shows that the link is back."""
    if run.runtime.view(run.clock.now()).linked is False:
        run.step(LinkBack(run.clock.now().monotonic_us))
    slots = [(POSITION_X, POSITION_Y), *((slot,) for slot in (BATTERY, HEIGHT, WIND, LINK, FIX, OBSTACLE))]
    Random(order).shuffle(slots)
    for group in slots:
        run.clock.advance(EACH_US)
        values = tuple((slot, run.vehicle.values[slot]) for slot in group if slot not in missing)
        run.step(Readings(run.clock.now().monotonic_us, values))


def after_it(run: Run) -> list[str]:
    """The records from the loss of the link on."""
    return run.events[run.events.index("link-lost") :] if "link-lost" in run.events else []


# --------------------------------------------------------------------------- a silence, and all is well afterwards


@pytest.mark.parametrize(("situation", "seconds", "order"), TRIED)
def test_silence_is_not_a_violation(situation: Situation, seconds: float, order: int) -> None:
    run = situation(AfterSilence.CONTINUE)
    flown, stage = list(run.flown), run.runtime.view(run.clock.now()).stage
    be_silent(run, seconds)
    if situation in GROUND and seconds > LOST_US / S + Limits().silent_us / S:
        assert run.ending is Ending.LINK_LOST, "on the ground nothing is lost by giving up"
        return
    assert run.ending is None
    assert run.flown == flown, "nothing is sent that would not arrive"
    come_back(run, order)
    for _ in range(40):
        run.tick()
    assert "violated" not in after_it(run)
    assert "emergency_land" not in run.flown
    if situation is falling:
        assert set(run.flown[len(flown) :]) <= {"return_home"}, "its hover may have taken its time"
    else:
        assert run.flown == flown
        assert run.runtime.view(run.clock.now()).stage is stage
    if seconds > 1:
        (back,) = (record["detail"] for record in run.records if record.get("event") == "link-back")
        assert back == f"after {int(seconds * S - LOST_US) // 1_000} ms"
        assert run.events.count("fresh") == 1
        assert "not-fresh" not in run.events
    assert_audited(run)


@rows("order", ORDERS)
@rows("situation", MISSION_FLIES)
def test_after_a_long_silence_the_contingency_flies(situation: Situation, order: int) -> None:
    run = situation(AfterSilence.CONTINGENCY)
    flown = list(run.flown)
    run.vehicle.deaf = {"inspect_area", "takeoff"}
    be_silent(run, 45)
    assert run.flown == flown
    come_back(run, order)
    (detail,) = (record["detail"] for record in run.records if record.get("event") == "long-silence")
    assert detail == "44000 ms, more than 30000 ms"
    assert run.decisions[-1][:4] == (2, -1, 0, "allow"), "the contingency, from its first link"
    assert run.flown == [*flown, "hover"]
    run.until_over()
    assert run.ending is Ending.ABORTED
    assert "emergency_land" not in run.flown
    assert_audited(run)


@pytest.mark.parametrize("seconds", [5, 20, 30.9])
def test_short_silence_does_not_abort_the_mission(seconds: float) -> None:
    run = running(AfterSilence.CONTINGENCY)
    be_silent(run, seconds)
    come_back(run, 0)
    assert "long-silence" not in run.events
    assert run.flown[-1] == "inspect_area"


@pytest.mark.parametrize("situation", [falling, returning])
def test_return_or_landing_under_way_continues(situation: Situation) -> None:
    run = situation(AfterSilence.CONTINGENCY)
    be_silent(run, 45)
    come_back(run, 0)
    assert "long-silence" not in run.events
    assert run.flown[-1] == "return_home"


def test_return_home_completes_after_a_long_silence() -> None:
    run = start(vehicle=FakeVehicle(deaf={"return_home"})).until_flies("return_home")
    be_silent(run, 45)
    run.vehicle.deaf = set()
    come_back(run, 0)
    assert run.until_over().ending is Ending.COMPLETED


def test_after_a_long_silence_on_the_ground_the_step_is_decided_as_ever() -> None:
    run = deferred_on_the_ground(AfterSilence.CONTINGENCY)
    run.vehicle.values[FIX] = 3
    be_silent(run, 30.5)
    come_back(run, 0)
    assert "long-silence" not in run.events


# ------------------------------------------------------------------------------- what is really wrong afterwards


@rows("order", range(8))
def test_a_breach_is_judged_once_all_is_fresh_and_not_before(order: int) -> None:
    run = running(AfterSilence.CONTINUE)
    be_silent(run, 5)
    run.vehicle.values[WIND] = 12 * M  # 5 s old wind is not stale, and was calm
    sent = len(run.flown)
    come_back(run, order)
    assert run.flown[sent:] == ["hover"]
    (violated,) = (record for record in run.records if record.get("event") == "violated")
    assert violated["detail"] == "wind.speed < 10 m/s: wind.speed = 12 m/s"
    assert run.events.index("fresh") < run.events.index("violated")


def test_missing_signal_is_awaited_then_gets_grace() -> None:
    run = running(AfterSilence.CONTINUE)
    be_silent(run, 8)
    back_us = run.clock.now().monotonic_us
    missing = frozenset({FIX, OBSTACLE})
    run.vehicle.silent = set(missing)
    come_back(run, 1, missing)
    assert run.flown[-1] == "inspect_area"
    run.until(lambda run: run.flown[-1] != "inspect_area")
    took_us = run.clock.now().monotonic_us - back_us
    assert Limits().fresh_us + GRACE_US < took_us <= Limits().fresh_us + GRACE_US + 2 * TICK
    (detail,) = (record["detail"] for record in run.records if record.get("event") == "not-fresh")
    assert detail == "after 1500 ms without gps.fix, obstacle.distance"
    (violated,) = (record for record in run.records if record.get("event") == "violated")
    assert violated["detail"] == "obstacle.distance > 5 m: unknown for longer than its grace of 500 ms"
    assert run.flown[-1] == "emergency_land", "without a position nothing else can fly"
    assert_audited(run)


def test_signal_missing_before_silence_is_not_awaited() -> None:
    run = start(vehicle=FakeVehicle(deaf={"goto"})).until_flies("goto")
    run.vehicle.silent = {OBSTACLE}
    run.until(lambda run: run.clock.now().monotonic_us > 510 * S)
    be_silent(run, 8)
    come_back(run, 0, frozenset({OBSTACLE}))
    (detail,) = (record["detail"] for record in run.records if record.get("event") == "fresh")
    assert detail in {f"after {count * EACH_US // 1_000} ms" for count in range(8)}, "before its time was over"


def test_value_measured_before_loss_is_not_fresh() -> None:
    """A slow link delivers buffered values."""
    run = running(AfterSilence.CONTINUE)
    be_silent(run, 5)
    run.step(LinkBack(0))
    old_us = run.clock.now().monotonic_us - 4_500_000
    run.step(Readings(old_us, tuple(run.vehicle.values.items())))
    assert "fresh" not in run.events
    run.tick()
    assert "fresh" in run.events
    assert run.flown[-1] == "inspect_area"


def test_a_position_that_is_not_vouched_for_yet_is_waited_for() -> None:
    """After a silence the estimator's report on a position comes after the position, which is unknown until then."""
    run = falling(AfterSilence.CONTINUE)
    be_silent(run, 45)
    where = {slot: run.vehicle.values[slot] for slot in (POSITION_X, POSITION_Y, HEIGHT)}
    run.vehicle.values.update(dict.fromkeys(where))
    come_back(run, 0)
    assert "fresh" not in run.events
    assert run.flown[-1] == "hover", "not the landing that needs no position"
    run.vehicle.values.update(where)
    run.tick()
    assert "fresh" in run.events
    assert run.flown[-1] == "return_home"


def test_a_position_that_was_not_known_before_is_not_waited_for() -> None:
    run = falling(AfterSilence.CONTINUE)
    run.vehicle.values.update(dict.fromkeys((POSITION_X, POSITION_Y)))
    run.tick()
    be_silent(run, 8)
    come_back(run, 0)
    assert "fresh" in run.events, "before its time was over"


def test_a_signal_that_is_stale_a_moment_later_is_waited_for_too() -> None:
    """The link is back just before most signals are stale; nothing has come again when they are."""
    run = running(AfterSilence.CONTINUE)
    be_silent(run, 1.98)
    run.step(LinkBack(0))
    assert "fresh" in run.events
    pass_time(run, S)
    assert run.flown[-1] == "inspect_area"
    assert "violated" not in run.events
    come_back(run, 2)
    for _ in range(40):
        run.tick()
    assert run.flown[-1] == "inspect_area"
    assert "violated" not in run.events


# ------------------------------------------------------------------------------------ a link that comes and goes


def test_single_message_does_not_end_a_silence() -> None:
    run = falling(AfterSilence.CONTINUE)
    flown = list(run.flown)
    be_silent(run, 25)  # the time of its hover is over
    for _ in range(2):
        run.step(LinkBack(0))
        be_silent(run, 2)
    run.step(LinkBack(0))
    assert run.flown == flown, "no link is chosen on what was known before"
    come_back(run, 0)
    assert run.flown == [*flown, "return_home"]
    assert run.events.count("fresh") == 1
    assert "not-fresh" not in run.events


@pytest.mark.parametrize("up_us", [50_000, 300_000, 1_200_000])
def test_flapping_link_delays_judgement_boundedly(up_us: int) -> None:
    run = running(AfterSilence.CONTINUE)
    be_silent(run, 5)
    back_us = run.clock.now().monotonic_us
    while "not-fresh" not in run.events:
        run.step(LinkBack(0))
        pass_time(run, up_us)
        run.step(LinkLost(0))
        pass_time(run, S)
        assert run.clock.now().monotonic_us - back_us < Limits().flapping_us + 3 * S
    assert run.clock.now().monotonic_us - back_us > Limits().fresh_us


def test_grace_counts_only_the_time_in_which_the_link_is_up() -> None:
    run = running(AfterSilence.CONTINUE)
    run.vehicle.values[OBSTACLE] = None
    for _ in range(3):
        run.tick()
    for _ in range(2):  # part of its grace period is used, and the rest remains
        run.step(LinkLost(0))
        pass_time(run, 4 * S)
        run.step(LinkBack(0))
        come_back(run, 0)
    assert run.flown[-1] == "inspect_area" or "violated" in run.events
    began_us = run.clock.now().monotonic_us
    run.until(lambda run: run.flown[-1] == "hover")
    assert run.clock.now().monotonic_us - began_us <= GRACE_US


LIMIT_US = 40 * S


def limited() -> Run:
    """The third step runs, and may take 40 s."""
    contracts = tuple(replace(one, duration_us=LIMIT_US) for one in PATIENT)
    policy = replace(POLICY, vehicle=SHORT, signals=SIGNALS, contracts=contracts, after_silence=AfterSilence.CONTINUE)
    invocations = tuple(replace(one, contract=contracts[one.skill]) for one in MISSION.invocations)
    run = Run(loaded(policy, replace(MISSION, invocations=invocations))).until_flies("inspect_area")
    run.vehicle.deaf = {"inspect_area"}
    return run


def violations(run: Run) -> list[str]:
    return [record["detail"] for record in run.records if record.get("event") == "violated"]


@pytest.mark.slow
@pytest.mark.parametrize("gaps", [(0,), (8,), (3, 3, 3), (2, 2, 2, 2, 2, 2, 2, 2)])
def test_step_time_limit_excludes_silence_and_names_it(gaps: tuple[int, ...]) -> None:
    """The flight waits in link time too: a limit by wall-clock time once ended a hover of 20 s because of a silence."""
    run = limited()
    began_us = run.clock.now().monotonic_us
    away_us = 0
    for gap in gaps:
        if gap:
            run.step(LinkLost(0))
            lost_us = run.clock.now().monotonic_us
            pass_time(run, gap * S)
            come_back(run, 0)
            run.tick()
            away_us += run.clock.now().monotonic_us - lost_us
    run.until(lambda run: "violated" in run.events)
    lasted_us = run.clock.now().monotonic_us - began_us
    assert abs(lasted_us - away_us - LIMIT_US) <= S * (len(gaps) + 1) // 2
    (reason,) = violations(run)
    assert reason.startswith("exceeded its maximum duration")
    assert ("without a link" in reason) == (gaps != (0,))


def test_step_time_limit_excludes_unresponsive_time() -> None:
    run = limited()
    run.step(VehicleAnswers(0, answers=False))
    for _ in range(20):
        run.clock.advance(S)
        run.tick()
        if "violated" in run.events:
            break
    run.step(VehicleAnswers(0, answers=True))
    assert run.runtime.view(run.clock.now()).left_us > LIMIT_US - 10 * S
    assert violations(run) == []
    run.until(lambda run: "violated" in run.events)
    (reason,) = violations(run)
    assert "ms without a link" in reason


def test_grace_of_a_waiting_step_does_not_run_through_silence() -> None:
    run = holding(AfterSilence.CONTINUE)
    run.vehicle.values[BATTERY] = None  # the way home is not known
    run.tick()
    run.step(LinkLost(0))
    pass_time(run, 6 * S)
    run.vehicle.values[BATTERY] = 9_000
    come_back(run, 0)
    for _ in range(20):
        run.tick()
    assert "violated" not in run.events
    assert run.runtime.view(run.clock.now()).stage is RunStage.DECIDING


# ---------------------------------------------------------------------------------------- what comes in between


@pytest.mark.parametrize("order", ORDERS)
def test_a_step_that_fails_in_the_silence_falls_back_on_fresh_state(order: int) -> None:
    run = running(AfterSilence.CONTINUE)
    token = run.vehicle.commands[-1].token
    be_silent(run, 5)
    run.step(LinkBack(0), CommandFailed(0, token, "no-progress"))
    assert run.flown[-1] == "inspect_area", "the next link is chosen on fresh state"
    come_back(run, order)
    assert run.flown[-1] == "hover"
    assert run.until_over().flown[-1] == "return_home"


@pytest.mark.parametrize("order", ORDERS)
def test_a_step_that_succeeds_in_the_silence_is_followed_on_fresh_state(order: int) -> None:
    run = start(vehicle=FakeVehicle(deaf={"goto"})).until_flies("goto")
    token = run.vehicle.commands[-1].token
    be_silent(run, 5)
    run.step(LinkBack(0), Succeeded(0, token))
    assert run.flown[-1] == "goto"
    come_back(run, order)
    assert run.flown[-1] == "inspect_area"
    assert run.until_over().ending is Ending.COMPLETED


def test_a_vehicle_that_landed_in_the_silence_has_landed() -> None:
    run = returning(AfterSilence.CONTINUE)
    be_silent(run, 8)
    run.step(LinkBack(0), AirState(0, False, False))
    assert run.ending is Ending.ABORTED
    assert run.events[-1] == "landed"


@rows("moment", ["lost", "back"])
@rows("situation", AIR)
def test_pilot_takeover_during_silence_ends_run(situation: Situation, moment: str) -> None:
    run = situation(AfterSilence.CONTINGENCY)
    flown = list(run.flown)
    be_silent(run, 45)
    run.step(*([LinkBack(0)] if moment == "back" else []), TakenOver(0, "POSCTL"))
    assert run.ending is Ending.STOOD_DOWN
    assert run.vehicle.released
    assert run.flown == flown


def test_lost_takeoff_waits_for_the_flight_state() -> None:
    """The last report was on the ground: the vehicle may have risen, so no landing is commanded."""
    run = start(vehicle=FakeVehicle(deaf={"takeoff"}))
    run.tick(AirState(0, True, False))
    be_silent(run, 45)
    come_back(run, 0)
    assert run.flown == ["takeoff"]
    run.tick(AirState(0, True, True))
    assert run.flown == ["takeoff", "hover"]


# ------------------------------------------------------------------------------------------------ the long wait


@pytest.mark.parametrize("situation", AIR)
def test_a_vehicle_that_can_still_fly_is_waited_for(situation: Situation) -> None:
    run = situation(AfterSilence.CONTINUE)
    began_us = run.clock.now().monotonic_us
    flown = list(run.flown)
    run.step(LinkLost(0))
    pass_time(run, SHORT.endurance_us)
    assert run.ending is None
    pass_time(run, Limits().silent_us + 2 * TICK)
    assert run.ending is Ending.LINK_LOST
    assert run.flown == flown
    assert run.clock.now().monotonic_us - began_us > SHORT.endurance_us + Limits().silent_us


@pytest.mark.parametrize("before", [0, 5, 120])
def test_stop_request_during_silence_is_bounded(before: int) -> None:
    """The vehicle may still return; then it is given up, as on the ground."""
    run = running(AfterSilence.CONTINUE)
    run.step(LinkLost(0))
    pass_time(run, before * S)
    run.step(Interrupted(0))
    assert run.ending is None
    pass_time(run, Limits().silent_us)
    assert run.ending is None
    pass_time(run, 2 * TICK)
    assert run.ending is Ending.LINK_LOST
    assert run.flown[-1] == "inspect_area"


def test_interrupted_in_a_silence_falls_back_once_the_state_is_fresh() -> None:
    run = running(AfterSilence.CONTINUE)
    be_silent(run, 5)
    run.step(Interrupted(0))
    come_back(run, 0)
    assert run.flown[-1] == "hover"
    assert run.until_over().ending is Ending.INTERRUPTED


# ------------------------------------------------------------------------------- heard, but answers nothing

DEAF = {"takeoff", "goto", "inspect_area", "hover", "return_home", "emergency_land"}


def mute(run: Run) -> Run:
    """Commands do not arrive any more; the vehicle is heard all the while."""
    run.vehicle.deaf = DEAF
    run.tick(VehicleAnswers(0, answers=False))
    return run


def go_on(run: Run, us: int) -> None:
    until_us = run.clock.now().monotonic_us + us
    while run.clock.now().monotonic_us < until_us and run.ending is None:
        run.tick()


@pytest.mark.slow
@pytest.mark.parametrize("situation", AIR)
def test_unresponsive_vehicle_is_awaited_while_it_can_fly(situation: Situation) -> None:
    """Its chain flies meanwhile, as far as commands may arrive, and its end does not end the run."""
    run = mute(situation(AfterSilence.CONTINUE))
    go_on(run, SHORT.endurance_us + Limits().silent_us - TICK)
    assert run.ending is None
    go_on(run, 3 * TICK)
    assert run.ending is Ending.LINK_LOST
    assert [record["detail"] for record in run.records if record.get("event") == "link-lost"] == [
        "the vehicle is heard, but answers nothing"
    ]
    assert "stranded" not in run.events
    assert_audited(run)


def test_vehicle_that_answers_again_is_brought_down() -> None:
    run = mute(returning(AfterSilence.CONTINUE))
    run.vehicle.deaf, run.vehicle.fails = set(), {"return_home", "emergency_land"}
    run.until(lambda run: run.flown.count("emergency_land") > 2 * Limits().tries + 4)
    run.vehicle.fails = set()
    run.tick(VehicleAnswers(0, answers=True))
    run.until_over()
    assert run.ending is Ending.ABORTED
    assert run.flown[-1] == "emergency_land"
    assert_audited(run)


def test_wait_restarts_when_vehicle_answers_again() -> None:
    run = mute(running(AfterSilence.CONTINUE))
    go_on(run, SHORT.endurance_us)
    run.tick(VehicleAnswers(0, answers=True), VehicleAnswers(0, answers=True))
    mute(run)
    go_on(run, SHORT.endurance_us)
    assert run.ending is None


@pytest.mark.parametrize("situation", GROUND)
def test_unresponsive_vehicle_on_ground_is_awaited_like_silent_one(situation: Situation) -> None:
    run = mute(situation(AfterSilence.CONTINUE))
    go_on(run, Limits().silent_us - TICK)
    assert run.ending is None
    go_on(run, 3 * TICK)
    assert run.ending is Ending.LINK_LOST
    assert run.flown == []


@pytest.mark.parametrize("silent", [False, True])
def test_silence_and_no_answer_share_one_wait(silent: bool) -> None:
    run = mute(running(AfterSilence.CONTINUE))
    go_on(run, SHORT.endurance_us)
    run.step(*([LinkLost(0)] if silent else []), VehicleAnswers(0, answers=False))
    pass_time(run, Limits().silent_us + TICK)
    assert run.ending is Ending.LINK_LOST


@pytest.mark.parametrize("situation", AIR)
def test_landed_or_taken_over_vehicle_is_not_awaited(
    situation: Situation,
) -> None:
    run = mute(situation(AfterSilence.CONTINUE))
    run.tick(TakenOver(0, "AUTO.RTL"))
    assert run.ending is Ending.STOOD_DOWN
    run = mute(situation(AfterSilence.CONTINUE))
    run.tick(AirState(0, False, False))
    assert run.ending is Ending.ABORTED


def test_stop_request_for_unresponsive_vehicle_is_bounded() -> None:
    run = mute(running(AfterSilence.CONTINUE))
    go_on(run, 60 * S)
    run.step(Interrupted(0))
    go_on(run, Limits().silent_us)
    assert run.ending is None
    go_on(run, 2 * TICK)
    assert run.ending is Ending.LINK_LOST


# --------------------------------------------------------------------------------------- whatever comes at once


BATCH: tuple[Callable[[Run], Event], ...] = (
    lambda run: LinkBack(0),
    lambda run: Readings(run.clock.now().monotonic_us, tuple(run.vehicle.values.items())),
    lambda run: AirState(0, True, True),
    lambda run: LinkLost(0),
)


@rows("order", list(permutations(range(len(BATCH)))))
def test_order_of_simultaneous_events_does_not_matter(order: tuple[int, ...]) -> None:
    run = running(AfterSilence.CONTINUE)
    be_silent(run, 6)
    run.step(*(BATCH[number](run) for number in order))
    pass_time(run, S)
    run.step(LinkBack(0))
    come_back(run, 0)
    run.tick()
    assert run.flown[-1] == "inspect_area"
    assert "violated" not in run.events
    assert run.vehicle.values[HEIGHT] == 20 * M
