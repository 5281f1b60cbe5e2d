"""Flights of scenarios: times of incidents, and effects of each host and agent fault."""

import json
from collections.abc import Iterator
from typing import Any

import pytest

from reference import flat_case as flat
from reference.low_source import low_source
from rtshcua.app.programs import compile_sources
from rtshcua.model import faults
from rtshcua.model.faults import AgentFault, Fault, HostFault
from rtshcua.model.scenario import (
    AfterStep,
    AtTime,
    Decides,
    EndsInside,
    EndsWith,
    Expected,
    Flies,
    KeepsAway,
    OnCondition,
    ReactsWithin,
    Start,
)
from rtshcua.virtual.expectations import expectations
from rtshcua.virtual.flight_record import ScenarioFlown
from rtshcua.virtual.judge import judge, moves
from virtual import case
from virtual.once import once
from virtual.sampling import each_once
from virtual.scenarios import flown, incident, scenario, when
from virtual.shipped import shipped

S, M = case.S, case.M
FLAVOURS = ("px4", "ardupilot")


def records(of: ScenarioFlown) -> Iterator[dict[str, Any]]:
    return (json.loads(line) for life in of.lives for line in life.lines)


def events(of: ScenarioFlown) -> list[str]:
    return [record["event"] for record in records(of) if record["type"] == "effect"]


def dispatched(of: ScenarioFlown) -> list[str]:
    return [record["detail"] for record in records(of) if record.get("event") == "dispatched"]


def nothing_wrong(of: ScenarioFlown) -> None:
    judgement = judge(of)
    assert judgement.failures == ()
    assert judgement.exceptions == ()


# ---------------------------------------------------------------- determinism and times


def test_the_same_arguments_give_the_same_flight() -> None:
    def once_more(seed: int) -> ScenarioFlown:
        time = AtTime(10 * S, 20 * S)
        return flown(scenario(when(time, faults.RuntimeKilled(0, 2 * S)), when(time, faults.Babble(0, 3))), seed=seed)

    first, other = once_more(1), once_more(2)
    assert once_more(1) == first
    assert [each.at_us for each in first.happened] != [each.at_us for each in other.happened]


@pytest.mark.slow
def test_incidents_follow_steps_and_conditions() -> None:
    high = flat.clause("height > 3 m", flat.apply(flat.Op.GT, flat.signal(flat.HEIGHT), flat.const(3 * M)))
    never = flat.clause("height > 3 km", flat.apply(flat.Op.GT, flat.signal(flat.HEIGHT), flat.const(3_000 * M)))
    found = flown(
        scenario(
            when(AfterStep(1, 2 * S, 2 * S), faults.LinkQuality(0, 9_000)),
            when(OnCondition(high, S, S), faults.ClockStep(0, S)),
            when(OnCondition(never, 0, 0), faults.Kill(0)),
            when(AfterStep(9, 0, 0), faults.Kill(0)),
        )
    )
    assert found.ending == "completed"
    assert [each.number for each in found.happened] == [1, 0]
    times = {each.number: each.at_us for each in found.happened}
    leg = next(r["at_us"] for r in records(found) if r.get("event") == "dispatched" and r["step"] == 1)
    assert times[0] == leg - found.start_us + 2 * S
    rises = next(sample.at_us for sample in found.samples if sample.up_mm > 3 * M)
    assert 0 <= times[1] - rises - S < S


def test_start_conditions_are_applied() -> None:
    found = flown(scenario(start=Start(battery=2_000, wind_mm_s=3 * M)))
    assert found.ending == "refused"
    assert found.samples[0].battery == 2_000


@pytest.mark.parametrize("flavour", FLAVOURS)
def test_shipped_mission_is_flown(flavour: str) -> None:
    fault = faults.WindStep(0, 5 * M)
    found = once(f"short-{flavour}", lambda: flown(scenario(incident(12, fault)), flavour, bundle=shipped("short")))
    assert found.ending == "completed"
    nothing_wrong(found)


# ---------------------------------------------------------------- the host


@pytest.mark.slow
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_killed_runtime_continues_in_another_process(flavour: str) -> None:
    """Regression: state was checked before PX4's readings had an age, and the vehicle landed on the spot."""
    found = flown(scenario(incident(15, faults.RuntimeKilled(0, 3 * S))), flavour)
    killed, after = found.lives
    assert (killed.ending, after.ending) == (None, "aborted")
    assert 18 * S <= after.began_us <= 20 * S
    assert [json.loads(line)["type"] for line in killed.lines[-2:]] == ["recover", "close"]
    assert json.loads(after.lines[0])["before"] is not None
    assert "resumed" in events(found)
    assert dispatched(found)[-2:] == ["hover", "return_home"]
    assert not found.samples[-1].in_air
    nothing_wrong(found)


@pytest.mark.parametrize(
    ("after_ms", "dead_ms", "flavour"), each_once((50, 150, 700, 1_500, 2_500), (500, 1_000, 2_000, 3_000), FLAVOURS)
)
def test_runtime_killed_during_takeoff_brings_the_vehicle_down(after_ms: int, dead_ms: int, flavour: str) -> None:
    """Killed between takeoff command and lift-off: the next process finds the vehicle armed on the ground."""
    killed = when(AfterStep(0, after_ms * 1_000, after_ms * 1_000), faults.RuntimeKilled(0, dead_ms * 1_000))
    found = flown(scenario(killed), flavour, seed=after_ms + dead_ms)
    last = found.samples[-1]
    assert (last.armed, last.in_air) == (False, False)
    if any(sample.armed for sample in found.samples):
        assert [life.ending for life in found.lives] == [None, "aborted"]
        assert dispatched(found)[-1] in ("emergency_land", "return_home")
    else:  # not armed yet: the vehicle stays on the ground
        assert found.left == "replayed"
    nothing_wrong(found)


@pytest.mark.slow
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_killed_boundary_flight_lands_by_frames_signed_ahead(flavour: str) -> None:
    found = flown(scenario(incident(15, faults.BoundaryKilled(0))), flavour)
    assert found.ending == "aborted"
    after = events(found)[events(found).index("boundary-lost") :]
    assert [each for each in after if each in ("dispatched", "failed")] == ["dispatched", "dispatched"]
    assert dispatched(found)[-2:] == ["hover", "return_home"]
    assert not found.samples[-1].in_air
    assert [(each.slug, each.cause) for each in judge(found).exceptions] == [("log", "boundary")]
    assert judge(found).failures == ()


@pytest.mark.slow
def test_next_process_has_its_own_boundary() -> None:
    found = flown(scenario(incident(15, faults.BoundaryKilled(0)), incident(16, faults.RuntimeKilled(0, 2 * S))))
    first, after = found.lives
    assert (first.ending, after.ending) == (None, "aborted")
    assert any(b'"type":"decision"' in line for line in after.lines)
    assert not found.samples[-1].in_air
    assert judge(found).failures == ()


def test_killed_process_may_leave_a_truncated_line() -> None:
    torn = set()
    for seed in range(1, 8):
        found = flown(scenario(incident(1, faults.RuntimeKilled(0, S))), seed=seed)  # on the ground: ends soon
        torn.add(json.loads(found.lives[0].lines[-2])["discarded_bytes"] > 0)
        assert judge(found).failures == ()
    assert torn == {True, False}


def test_no_process_starts_with_the_vehicle_on_the_ground() -> None:
    found = flown(scenario(incident(0.2, faults.RuntimeKilled(0, S))))
    assert len(found.lives) == 1
    assert found.left == "replayed"
    assert not found.samples[-1].in_air
    nothing_wrong(found)


@pytest.mark.slow
def test_process_starts_when_the_disk_accepts_records_again() -> None:
    found = flown(
        scenario(incident(14, faults.DiskFull(0, 6 * S)), incident(15, faults.RuntimeKilled(0, S))), "ardupilot"
    )
    assert [life.ending for life in found.lives] == [None, "aborted"]
    assert found.lives[1].began_us > 20 * S
    assert any("no space left" in note for note in found.notes)


@pytest.fixture(scope="module")
def bothered() -> ScenarioFlown:
    """A flight with several harmless faults, one for each test."""
    return flown(
        scenario(
            incident(5, faults.Approval(0, "supervisor")),
            incident(6, faults.Approval(0, "nobody")),
            incident(12, faults.Babble(0, 20)),
            incident(14, faults.ClockStep(0, -3_600 * S)),
            incident(15, faults.HostStall(0, 2 * S)),
        )
    )


@pytest.mark.slow
def test_stalled_host_reads_frames_later(bothered: ScenarioFlown) -> None:
    assert [frame for frame in bothered.frames if 14 * S < frame.sent_us < 15 * S]
    assert not [frame for frame in bothered.frames if 15_050_000 < frame.sent_us < 17 * S]
    assert [frame for frame in bothered.frames if 17 * S <= frame.sent_us < 18 * S]


def test_harmless_faults_do_not_end_the_flight(bothered: ScenarioFlown) -> None:
    assert [each.number for each in bothered.happened] == [0, 1, 2, 3, 4]
    assert bothered.ending == "completed"
    nothing_wrong(bothered)


@pytest.mark.slow
def test_full_disk_ends_the_flight() -> None:
    for_good = flown(scenario(incident(15, faults.DiskFull(0))))
    assert for_good.ending == "evidence-lost"
    judgement = judge(for_good)
    assert judgement.failures == ()
    assert {each.cause for each in judgement.exceptions} == {"disk"}
    a_while = flown(scenario(incident(17, faults.DiskFull(0, 2 * S))))
    assert {"gap", "gap-over"} <= set(events(a_while))
    nothing_wrong(a_while)


@pytest.mark.slow
def test_step_waits_for_a_slow_disk() -> None:
    slow = flown(scenario(incident(17, faults.DiskStall(0, 2 * S))))
    (life,) = slow.lives
    assert slow.ending == "completed"
    assert len(life.kept_us) == len(life.lines)
    kept_us = min(each for each in life.kept_us if each >= 17 * S)
    assert kept_us >= 19 * S
    sent = [frame.sent_us for frame in slow.frames if (moves(frame.octets, "px4") or ()) and frame.sent_us > 17 * S]
    assert sent[0] >= kept_us, "the step that came due waits"
    nothing_wrong(slow)


def test_clock_step_is_recorded(bothered: ScenarioFlown) -> None:
    assert "clock-stepped" in events(bothered)


# ---------------------------------------------------------------- those who hand in documents

LOW = low_source()


@pytest.fixture(scope="module")
def low(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    source = tmp_path_factory.mktemp("low") / "low.rts"
    source.write_text(LOW)
    compiled, _ = compile_sources([source], mission=None, issued_at_us=flat.ISSUED)
    assert compiled.mission is not None, compiled.diagnostics
    return case.seal(compiled.mission, compiled.policy)


@pytest.mark.slow
def test_approval_is_given(low: bytes) -> None:
    awaited = when(AfterStep(1, 2 * S, 2 * S), faults.Approval(0, "supervisor", 2))
    found = flown(scenario(awaited), bundle=low)
    assert "approval" in events(found)
    assert "inspect_area" in dispatched(found)
    nothing_wrong(found)


@pytest.mark.slow
def test_approval_is_refused(low: bytes) -> None:
    found = flown(scenario(when(AfterStep(1, S, S), faults.Disapproval(0, "supervisor"))), "ardupilot", bundle=low)
    assert "inspect_area" not in dispatched(found)
    assert found.ending == "aborted"
    nothing_wrong(found)


def test_approval_that_no_step_requires_is_noted(bothered: ScenarioFlown) -> None:
    notes = [each.note for each in bothered.happened]
    assert notes[1] == "no step of the mission requires it"


@pytest.mark.slow
@pytest.mark.parametrize("flavour", FLAVOURS)
def test_repeated_recall_ends_the_flight_once(flavour: str) -> None:
    found = flown(scenario(incident(15, faults.Recall(0, 2))), flavour)
    assert found.ending == "recalled"
    assert events(found).count("recall") == 1
    nothing_wrong(found)


@pytest.mark.slow
def test_repeated_replacement_is_accepted_once() -> None:
    found = flown(scenario(incident(12, faults.Replacement(0, 2))))
    assert events(found).count("replacement") == 1
    assert "document-refused" in events(found)
    assert found.ending == "completed"
    nothing_wrong(found)


def test_babble_is_refused_without_effect(bothered: ScenarioFlown) -> None:
    refused = [r["detail"] for r in records(bothered) if r.get("event") == "document-refused"]
    assert refused


@pytest.mark.slow
def test_documents_for_a_dead_process_are_lost() -> None:
    found = flown(scenario(incident(15, faults.RuntimeKilled(0, 3 * S)), incident(16, faults.Recall(0))))
    assert [type(each.fault).__name__ for each in found.happened] == ["RuntimeKilled"]
    assert found.ending == "aborted"


# ---------------------------------------------------------------- found by flights with random faults, and shrunken


def test_go_to_in_a_copter_takeoff_is_detected() -> None:
    """Regression: in a takeoff there is no target to compare, so the run followed the pilot's target."""
    pilot = incident(7.7, faults.PilotGoto(0, -20_000, 0, 10_000))
    found = flown(scenario(pilot), "ardupilot", bundle=shipped("short"), seed=0)
    assert found.ending == "stood-down"
    nothing_wrong(found)


@pytest.mark.parametrize(("at_s", "seed"), [(8.8, 6), (9.2, 3)])
def test_pause_near_the_end_of_a_px4_climb_is_detected(at_s: float, seed: int) -> None:
    """Regression: a stop 1.4 or 1 m below the end of the climb was taken for that end."""
    found = flown(scenario(incident(at_s, faults.PilotPause(0))), seed=seed)
    assert found.ending == "stood-down"
    nothing_wrong(found)


@pytest.mark.slow
def test_pause_undone_by_the_next_step_is_excused() -> None:
    """Both reach PX4 in the same moment, as the climb ends."""
    found = flown(scenario(incident(10.34, faults.PilotPause(0))), seed=1)
    judgement = judge(found)
    assert judgement.failures == ()
    assert {each.cause for each in judgement.exceptions} == {"crossed"}


# ---------------------------------------------------------------- what was expected


@pytest.mark.slow
@pytest.mark.parametrize(
    ("expected", "met"),
    [
        (EndsWith(("recalled", "aborted")), True),
        (EndsWith(("completed",)), False),
        (Flies("hover"), True),
        (Flies("hover", never=True), False),
        (Flies("inspect_area", never=True), True),
        (Decides("allow", "takeoff"), True),
        (Decides("allow", "hover"), True),
        (Decides("deny"), False),
        (Decides("allow", "takeoff", "admitted"), True),
        (Decides("allow", "takeoff", "state/violated"), False),
        (ReactsWithin(500_000), True),
        (ReactsWithin(0), False),
        (KeepsAway(None, M), True),
        (KeepsAway(flat.SCHOOL, 50 * M), True),
        (KeepsAway(flat.SCHOOL, 500 * M), False),
        (EndsInside(flat.CITY), True),
        (EndsInside(flat.BRIDGE), False),
    ],
)
def test_expectations_are_checked(expected: Expected, met: bool) -> None:
    found = once("recalled", lambda: flown(scenario(incident(15, faults.Recall(0)))))
    (answer,) = expectations(*_with(found, expected))
    assert answer.met is met, answer
    assert answer.found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("expected", "met"),
    [
        (Decides("fallback", "hover", "state/violated", "wind.speed < 10 m/s"), True),
        (Decides("fallback", "hover"), True),
        (Decides("fallback", "return_home"), False),
        (Decides("fallback", "hover", "safety/degraded"), False),
        (Decides("fallback", "hover", "state/violated", "link.quality >= 40 %"), False),
        (Decides("fallback", "hover", "state/violated", "wind.speed"), False),
    ],
)
def test_reason_of_an_aborted_step_can_be_expected(expected: Decides, met: bool) -> None:
    gale = when(AfterStep(1, S, S), faults.WindStep(0, 14_000))
    found = once("broken off by a gale", lambda: flown(scenario(gale)))
    (answer,) = expectations(*_with(found, expected))
    assert answer.met is met, answer


def _with(found: ScenarioFlown, expected: Expected) -> tuple[ScenarioFlown, Any]:
    from dataclasses import replace

    return replace(found, scenario=scenario(expects=(expected,))), judge(found)


@pytest.mark.soak
def test_silent_vehicle_is_awaited_for_its_endurance() -> None:
    """A lost link is awaited for the vehicle's endurance, an hour, and is no fault."""
    from msgspec.structs import replace

    policy = case.policy()
    hour = replace(policy, vehicle=replace(policy.vehicle, endurance_us=3_600 * S))
    bundle = case.seal(case.mission(case.low_steps()), hour)
    found = flown(scenario(incident(15, faults.LinkSilence(0))), bundle=bundle)
    assert (found.ending, found.fault) == ("link-lost", None)
    assert found.ended_us > 3_600 * S
    assert judge(found).failures == ()


# ---------------------------------------------------------------- whatever happens

SECOND_LONG: dict[type[Fault], Fault] = {
    type(fault): fault
    for fault in (
        faults.RuntimeKilled(0, 4 * S), faults.BoundaryKilled(0), faults.HostStall(0, 5 * S), faults.DiskFull(0, 5 * S),
        faults.ClockStep(0, 9 * S), faults.Approval(0, "supervisor"), faults.Disapproval(0, "supervisor"),
        faults.Recall(0), faults.Replacement(0), faults.Babble(0), faults.DiskStall(0, 5 * S),
    )
}  # fmt: skip


def test_every_host_and_agent_fault_is_tried() -> None:
    assert set(SECOND_LONG) == {kind for kind in faults.KINDS.values() if issubclass(kind, HostFault | AgentFault)}


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "at_s", "flavour"), each_once(SECOND_LONG, (1, 7, 14, 25, 33), FLAVOURS))
def test_host_and_agent_faults_cause_no_failure_at_any_time(kind: type[Fault], at_s: int, flavour: str) -> None:
    found = flown(scenario(incident(at_s, SECOND_LONG[kind])), flavour)
    assert judge(found).failures == ()


@pytest.mark.slow
@pytest.mark.parametrize(("flavour", "at_s"), [("ardupilot", 25.3), ("px4", 21.75), ("px4", 20.15)])
def test_motor_stop_during_descent_is_not_a_landing(flavour: str, at_s: float) -> None:
    """A vehicle disarmed in the air reports at once that it is on the ground, also while it lands."""
    found = flown(scenario(incident(at_s, faults.Kill(0))), flavour, bundle=shipped("short"))
    before = next(each for each in found.samples if each.at_us >= round(at_s * S) - 50_000)
    assert before.up_mm > 3 * M
    assert before.mode is faults.FlightMode.RETURN
    assert found.ending == "crashed"
    assert judge(found).failures == ()


def test_run_killed_in_its_first_record_has_no_log() -> None:
    killed = scenario(incident(0, faults.RuntimeKilled(0, 3 * S)))
    lives = [flown(killed, seed=seed, attested=False) for seed in range(1, 7)]  # otherwise a statement is the last line
    torn = [of for of in lives if not of.lives[0].lines[-1].endswith(b"\n")]
    assert torn
    assert {each.slug for of in torn for each in judge(of).failures} == set()
