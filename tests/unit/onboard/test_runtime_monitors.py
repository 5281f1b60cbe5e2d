"""Whole runs under a policy with temporal monitors: each step of the runtime is one observation, before it decides."""

from collections.abc import Iterator
from typing import Any

import pytest
from msgspec.structs import replace

from reference.asking import loaded as prepared
from reference.flat_case import (
    CONTRACTS,
    GOTO,
    HEIGHT,
    INSPECT,
    MISSION,
    POLICY,
    TAKEOFF,
    WIND,
    M,
    S,
    apply,
    clause,
    const,
    signal,
)
from reference.world import START, TICK, Run, assert_audited, loaded
from rtshcua.decision.tree import slots_read
from rtshcua.model.flat.code import Clause, Op
from rtshcua.model.flat.limits import MAX_GAP
from rtshcua.model.flat.mission import OnInadmissible
from rtshcua.model.flat.policy import Monitor, MonitorKind
from rtshcua.model.flat.situation import Now
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import Ending, Readings
from rtshcua.onboard.runtime.monitor import StateMonitor

T, F, U = 1, 2, 4
GUSTY, MILD = 9 * M, 4 * M
BREEZE = clause("wind.speed < 8 m/s", apply(Op.LT, signal(WIND), const(8 * M)))
UP = clause("height > 10 m", apply(Op.GT, signal(HEIGHT), const(10 * M)))
CALM_FOR_3_S, ROSE = Monitor(MonitorKind.FOR_LAST, 3 * S, BREEZE), Monitor(MonitorKind.RISING, 0, UP)
FOR_3_S = clause("wind.speed < 8 m/s for the last 3 s", (Op.MONITOR, 0, 0))
ROSE_NOW = clause("rising height > 10 m", (Op.MONITOR, 1, 0))

RUNS: list[Run] = []


@pytest.fixture(autouse=True)
def all_audited() -> Iterator[None]:
    """Every decision of these runs derives again from its record, including the truths of the monitors."""
    yield
    while RUNS:
        assert_audited(RUNS.pop())


def world(skill: int, on_inadmissible: OnInadmissible = OnInadmissible.ABORT, **clauses: tuple[Clause, ...]) -> Loaded:
    """The bundle in which a skill has other clauses, 30 s to be decided, and wind that is stale after 500 ms."""
    contract = replace(CONTRACTS[skill], deadline_us=30 * S, **clauses)
    monitors = (CALM_FOR_3_S, ROSE)
    read = slots_read((*contract.require, *contract.assume, *contract.maintain), POLICY.vehicle, monitors)
    contract = replace(contract, reads=read)
    signals = tuple(replace(one, stale_us=S // 2) if one.slot == WIND else one for one in POLICY.signals)
    policy = replace(
        POLICY,
        monitors=monitors,
        signals=signals,
        contracts=(*CONTRACTS[:skill], contract, *CONTRACTS[skill + 1 :]),
    )
    invocations = tuple(
        replace(one, contract=contract, on_inadmissible=on_inadmissible) if one.skill == skill else one
        for one in MISSION.invocations
    )
    return loaded(policy, replace(MISSION, invocations=invocations))


def start(of: Loaded) -> Run:
    run = Run(of)
    RUNS.append(run)
    return run


def seconds(run: Run) -> float:
    return (run.clock.now().monotonic_us - START.monotonic_us) / S


def recorded(run: Run) -> list[Any]:
    """The truths of the monitors at each recorded decision."""
    return [record["state"]["monitors"] for record in run.records if record["type"] == "decision"]  # type: ignore[index]


def test_a_take_off_waits_until_the_wind_was_calm_for_three_seconds() -> None:
    run = start(world(TAKEOFF, require=(FOR_3_S,))).until_flies("takeoff")
    assert seconds(run) == 3.0
    assert run.decisions == [(0, 0, -1, "defer", "state/unknown"), (0, 0, -1, "allow", "admitted")]
    assert recorded(run) == [[U, F], [T, F]]
    assert run.until_over().ending is Ending.COMPLETED


def test_a_gust_begins_the_three_seconds_again() -> None:
    run = start(world(TAKEOFF, OnInadmissible.HOLD, require=(FOR_3_S,)))
    run.until(lambda run: seconds(run) >= 2.0)
    run.vehicle.values[WIND] = GUSTY
    run.tick()
    run.vehicle.values[WIND] = MILD
    run.until_flies("takeoff")
    gust_is_over = 2.0 + 2 * TICK / S
    assert seconds(run) == pytest.approx(gust_is_over + 3.0)
    assert [decision[3:] for decision in run.decisions] == [
        ("defer", "state/unknown"),
        ("fallback", "state/violated"),
        ("allow", "admitted"),
    ]
    assert recorded(run) == [[U, F], [F, F], [T, F]]


def test_a_gap_of_telemetry_is_not_calm() -> None:
    """The wind is not reported for a second and stale after half a second, so it is unknown."""
    run = start(world(TAKEOFF, require=(FOR_3_S,)))
    run.until(lambda run: seconds(run) >= 2.0)
    run.vehicle.silent.add(WIND)
    run.until(lambda run: seconds(run) >= 3.0)
    run.vehicle.silent.clear()
    run.until_flies("takeoff")
    assert seconds(run) == pytest.approx(3.0 + TICK / S + 3.0)
    assert [decision[3] for decision in run.decisions] == ["defer", "allow"]


def test_unobserved_time_is_not_calm() -> None:
    run = start(world(TAKEOFF, require=(FOR_3_S,)))
    run.until(lambda run: seconds(run) >= 2.0)
    run.clock.advance(MAX_GAP + 1 - TICK)
    run.tick()
    begun = seconds(run)
    run.until_flies("takeoff")
    assert seconds(run) - begun == pytest.approx(3.0)
    assert [decision[3] for decision in run.decisions] == ["defer", "allow"]


def test_a_gust_of_one_observation_ends_a_skill_that_assumes_calm() -> None:
    run = start(world(INSPECT, assume=(FOR_3_S,))).until_flies("inspect_area")
    run.vehicle.values[WIND] = GUSTY
    run.tick()
    assert "violated" in run.events
    assert run.until_over().ending is Ending.ABORTED


def test_an_edge_is_seen_by_the_decisions_of_its_own_step_and_by_no_other() -> None:
    """To continue, the vehicle must rise above 10 m at this observation."""
    run = start(world(GOTO, OnInadmissible.HOLD, require=(ROSE_NOW,))).until_flies("goto")
    edges = [monitors[1] for monitors in recorded(run)]
    assert [decision[1] for decision in run.decisions][-2:] == [-1, 1], "it held until then"
    assert edges == [F] * (len(edges) - 1) + [T]
    run.tick()
    assert run.runtime.step(run.clock.now(), []) == []


def test_each_step_observes_once(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[int] = []
    observe = StateMonitor.observe

    def counted(self: StateMonitor, now: Now) -> None:
        seen.append(now.monotonic_us)
        observe(self, now)

    monkeypatch.setattr(StateMonitor, "observe", counted)
    run = Run(world(TAKEOFF, require=(FOR_3_S,)))
    moments = list(seen)
    for number in range(100):
        now = run.clock.now()
        moments.append(now.monotonic_us)
        run.runtime.step(now, run.vehicle.poll(now.monotonic_us) if number % 3 else [])
        assert seen == moments
        run.clock.advance(TICK * (number % 2))


def test_policy_without_monitors_records_no_monitor_field() -> None:
    run = start(loaded()).until_flies("takeoff")
    decided = [record["state"] for record in run.records if record["type"] == "decision"]
    assert decided
    assert all("monitors" not in state for state in decided)  # type: ignore[operator]


def test_an_edge_lasts_from_one_observation_to_the_next() -> None:
    monitor = StateMonitor(prepared(replace(POLICY, monitors=(ROSE,))))
    assert monitor.state(0).monitors == (U,)
    said = []
    for number, height in enumerate((0, 20 * M, 20 * M, 0)):
        now = replace(START, monotonic_us=START.monotonic_us + number * TICK)
        monitor.update(Readings(now.monotonic_us, ((HEIGHT, height),)))
        monitor.observe(now)
        assert monitor.state(now.monotonic_us).monitors == monitor.state(now.monotonic_us + TICK - 1).monitors
        said.append(monitor.state(now.monotonic_us).monitors)
    assert said == [(F,), (T,), (F,), (F,)]
