"""The computer stands still in flight: it does not judge the state from before that; its log names the stall."""

import pytest
from msgspec.structs import replace

from reference.flat_case import (
    BATTERY,
    CONTRACTS,
    FIX,
    HEIGHT,
    INSPECT,
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
from reference.flat_case import LINK as QUALITY
from reference.world import TICK, FakeVehicle, Run, assert_audited, loaded, renewed
from rtshcua.onboard.ports import Ending, Event, LinkBack, LinkLost, Readings, Succeeded
from rtshcua.onboard.runtime.limits import Limits
from rtshcua.onboard.runtime.link import STOOD_STILL
from rtshcua.onboard.runtime.view import RunStage
from virtual.rows import rows

#: as in the shipped policy: most signals are stale after 2 s, and a step may wait for minutes
STALE = {BATTERY: 5 * S, WIND: 10 * S, QUALITY: 5 * S}
SIGNALS = tuple(replace(one, stale_us=STALE.get(one.slot, 2 * S)) for one in POLICY.signals)
PATIENT = tuple(replace(one, deadline_us=10 * MIN) for one in CONTRACTS)
OF = loaded(
    replace(POLICY, signals=SIGNALS, contracts=PATIENT),
    replace(MISSION, invocations=tuple(replace(one, contract=PATIENT[one.skill]) for one in MISSION.invocations)),
)
SLOTS = ((POSITION_X, POSITION_Y), (BATTERY,), (HEIGHT,), (WIND,), (QUALITY,), (FIX,), (OBSTACLE,))
STALLS_S = (3, 14, 60)
#: the step of the area
INSPECT_STEP = 2


def start(vehicle: FakeVehicle | None = None) -> Run:
    return Run(renewed(OF), vehicle)


def running() -> Run:
    run = start(FakeVehicle(deaf={"inspect_area"})).until_flies("inspect_area")
    run.tick()
    return run


def holding() -> Run:
    """A run that waits for a step in a hold."""
    run = start().until_flies("goto")
    run.vehicle.values[OBSTACLE] = None
    run.until_flies("hover")
    run.vehicle.values[OBSTACLE] = 20 * M
    return run


def falling() -> Run:
    run = start().until_flies("goto")
    run.vehicle.values[WIND] = 12 * M
    return run.until_flies("hover")


def stand_still(run: Run, for_us: int, *events: Event) -> None:
    """It continues after `for_us`, and reads `events` first."""
    run.clock.advance(for_us)
    run.step(*events)


def pass_time(run: Run, us: int) -> None:
    """The vehicle is silent."""
    for _ in range(us // TICK):
        run.clock.advance(TICK)
        run.step()


def report(run: Run, *, but: tuple[int, ...] = (), measured_us: int | None = None) -> None:
    """One message after the other, 50 ms apart, each as of now; or as of a time of the past."""
    for group in SLOTS:
        run.clock.advance(50_000)
        values = tuple((slot, run.vehicle.values[slot]) for slot in group if slot not in but)
        run.step(Readings(run.clock.now().monotonic_us if measured_us is None else measured_us, values))


def details(run: Run, event: str) -> list[str]:
    return [record["detail"] for record in run.records if record.get("event") == event]


@rows("for_s", STALLS_S)
@rows("situation", (running, holding, falling))
def test_nothing_is_decided_after_a_stall_before_fresh_reports(situation: object, for_s: int) -> None:
    run = situation()  # type: ignore[operator]
    flown, stage, decided = list(run.flown), run.runtime.view(run.clock.now()).stage, len(run.decisions)
    stand_still(run, for_s * S)
    assert details(run, STOOD_STILL) == [f"for {for_s * 1_000} ms"]
    report(run, but=(FIX,))
    assert (run.flown, len(run.decisions)) == (flown, decided), "its fix may still come"
    run.clock.advance(50_000)
    run.step(Readings(run.clock.now().monotonic_us, ((FIX, run.vehicle.values[FIX]),)))
    assert details(run, "fresh") == ["after 400 ms"]
    for _ in range(10):
        run.tick()
    assert "violated" not in run.events[run.events.index(STOOD_STILL) :]
    assert "emergency_land" not in run.flown, "a chain is not chosen on a part of the state"
    if situation is running:
        assert (run.flown, run.runtime.view(run.clock.now()).stage) == (flown, stage)
    assert_audited(run)


def test_old_buffered_state_is_not_fresh() -> None:
    run = running()
    before_us = run.clock.now().monotonic_us
    stand_still(run, 20 * S)
    report(run, measured_us=before_us + 2 * S)  # the socket kept what came first
    assert details(run, "fresh") == []
    report(run)
    assert len(details(run, "fresh")) == 1
    assert "violated" not in run.events


def test_current_buffered_state_is_judged_at_once() -> None:
    run = running()
    now_us = run.clock.now().monotonic_us
    values = tuple((slot, run.vehicle.values[slot]) for group in SLOTS for slot in group)
    stand_still(run, 5 * S, Readings(now_us + 5 * S - TICK, values))
    assert details(run, "fresh") == ["after 0 ms"]


def test_wait_after_stall_is_as_long_as_after_silence() -> None:
    run = running()
    run.vehicle.values[POSITION_X] = None
    stand_still(run, 5 * S)
    resumed_us = run.clock.now().monotonic_us
    run.until(lambda run: "violated" in run.events)
    (missing,) = details(run, "not-fresh")
    assert missing == f"after {Limits().fresh_us // 1_000} ms without position"
    assert run.events.index(STOOD_STILL) < run.events.index("not-fresh") < run.events.index("violated")
    assert run.clock.now().monotonic_us - resumed_us > Limits().fresh_us + CONTRACTS[INSPECT].grace_us


@rows("awake_s", (0, 1))
def test_repeated_stalls_delay_judgement_boundedly(awake_s: int) -> None:
    """Even if it does nothing but stall."""
    run = running()
    run.vehicle.values[POSITION_X] = None
    stalls = 0
    while "not-fresh" not in run.events:
        stand_still(run, 4 * S)
        stalls += 1
        for _ in range(awake_s * S // TICK):
            run.tick()
        assert stalls <= 1 + Limits().flapping_us // Limits().stalled_us
    assert stalls > 1 + Limits().flapping_us // (Limits().stalled_us * (2 + awake_s))


def test_a_stall_takes_none_of_a_skills_own_time() -> None:
    """The manoeuvre does not progress meanwhile: its time counts only time with a link, too."""
    run = running()
    limit_us = max(contract.duration_us for contract in CONTRACTS)
    stand_still(run, limit_us + 2 * S)
    report(run)
    run.tick()
    assert "violated" not in run.events
    assert run.flown[-1] == "inspect_area"


def test_a_stall_counts_for_no_long_silence() -> None:
    """The vehicle's messages of that time were received, though late."""
    run = running()
    stand_still(run, POLICY.silence_us + 20 * S)
    report(run)
    assert details(run, "long-silence") == []


@pytest.mark.parametrize("back", [False, True])
def test_a_stall_within_a_silence(back: bool) -> None:
    run = running()
    pass_time(run, S)
    run.step(LinkLost(run.clock.now().monotonic_us, "silent", run.clock.now().monotonic_us - S))
    pass_time(run, 2 * S)
    if back:
        run.step(LinkBack(run.clock.now().monotonic_us))
    stand_still(run, 10 * S)
    if not back:
        assert not run.runtime.view(run.clock.now()).linked
        run.step(LinkBack(run.clock.now().monotonic_us))
    assert details(run, "fresh") + details(run, "not-fresh") == []
    report(run)
    assert len(details(run, "fresh")) == 1
    assert "violated" not in run.events
    assert_audited(run)


def test_short_pause_is_not_a_stall() -> None:
    run = running()
    stand_still(run, Limits().stalled_us)
    assert STOOD_STILL not in run.events


def test_ended_run_reports_no_stall() -> None:
    run = start().until_over()
    assert run.ending is Ending.COMPLETED
    stand_still(run, 10 * S)
    assert run.runtime.view(run.clock.now()).stage is RunStage.ENDED
    assert STOOD_STILL not in run.events


def test_end_of_wait_on_ground_is_recorded() -> None:
    """Between two steps no command ends by it."""
    run = start(FakeVehicle(deaf={"goto"})).until_flies("goto")
    for slot in (POSITION_X, OBSTACLE, FIX):  # the next step is deferred, and no hold may fly
        run.vehicle.values[slot] = None
    run.tick(Succeeded(0, run.vehicle.commands[-1].token))
    run.until(lambda run: "violated" in run.events)
    (violated,) = [record for record in run.records if record.get("event") == "violated"]
    assert (violated["step"], violated["token"]) == (INSPECT_STEP, -1)
    assert "unknown for longer than its grace" in violated["detail"]
    assert_audited(run)
