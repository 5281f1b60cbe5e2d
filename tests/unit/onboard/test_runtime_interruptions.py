"""Interruptions: the pilot, the operator, a lost link, a full disk, a boundary that does not answer."""

import json
from collections.abc import Callable

import pytest
from msgspec.structs import replace

from reference.flat_case import MIN, OBSTACLE, POLICY, WIND, M, S
from reference.world import TICK, FakeVehicle, Run, assert_audited, loaded, renewed
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import (
    AirState,
    Command,
    CommandFailed,
    Ending,
    EvidenceFailed,
    Interrupted,
    LinkBack,
    LinkLost,
    Noted,
    TakenOver,
)
from rtshcua.onboard.runtime.dispatcher import UNCONFIRMED
from rtshcua.onboard.runtime.journal import REPEATED_EVERY_US
from rtshcua.onboard.runtime.limits import Limits
from rtshcua.onboard.runtime.view import RunStage
from rtshcua.wire.response import Status, encode_refusal
from virtual.rows import rows

#: the vehicle's endurance, which limits the wait for it: short, to keep the tests fast
SHORT = replace(POLICY.vehicle, endurance_us=4 * MIN)
OF = loaded(replace(POLICY, vehicle=SHORT))


def waiting() -> Run:
    return Run(renewed(OF), ready=False)


def deferred_on_the_ground() -> Run:
    vehicle = FakeVehicle()
    vehicle.values[WIND] = None
    return Run(renewed(OF), vehicle=vehicle)


def taking_off() -> Run:
    return Run(renewed(OF))


def running() -> Run:
    return Run(renewed(OF)).until_flies("inspect_area")


def holding() -> Run:
    run = Run(renewed(OF)).until_flies("goto")
    run.vehicle.values[OBSTACLE] = None
    return run.until_flies("hover")


def falling() -> Run:
    run = Run(renewed(OF)).until_flies("goto")
    run.vehicle.values[WIND] = 12 * M
    return run.until_flies("hover")


def returning() -> Run:
    return falling().until_flies("return_home")


GROUND = (waiting, deferred_on_the_ground)
AIR = (taking_off, running, holding, falling, returning)
Situation = Callable[[], Run]


@rows("situation", GROUND + AIR)
def test_pilot_takeover_ends_run_at_once(situation: Situation) -> None:
    run = situation()
    flown = list(run.flown)
    run.tick(TakenOver(0, "POSCTL"))
    assert run.ending is Ending.STOOD_DOWN
    assert run.vehicle.released
    assert run.flown == flown
    assert run.events[-2:] == ["taken-over", "stood-down"] or run.events[-3:-1] == ["taken-over", "released"]


@pytest.mark.parametrize("situation", GROUND)
def test_interrupted_on_the_ground_ends_at_once(situation: Situation) -> None:
    run = situation()
    run.tick(Interrupted(0))
    assert run.ending is Ending.INTERRUPTED
    assert run.flown == []


@rows("situation", AIR)
@rows("again", [0, 1, 40])
def test_interrupted_in_the_air_falls_back_first(situation: Situation, again: int) -> None:
    run = situation()
    run.tick(Interrupted(0))
    assert run.ending is None
    for _ in range(again):
        run.tick(Interrupted(0))
    run.until_over()
    assert run.ending is Ending.INTERRUPTED
    assert run.flown[-1] in ("return_home", "emergency_land")
    assert not run.vehicle.airborne
    assert_audited(run)


def test_interrupted_holds_by_the_running_step_and_else_by_the_contingency() -> None:
    run = running()
    run.tick(Interrupted(0))
    assert run.decisions[-1][:3] == (1, 2, 0)
    run = holding()
    run.tick(Interrupted(0))
    assert run.decisions[-1][:3] == (2, -1, 0)


@pytest.mark.parametrize("event", [Interrupted(0), EvidenceFailed(0, "disk full")])
def test_a_mission_that_is_on_its_way_home_is_let_home(event: Interrupted | EvidenceFailed) -> None:
    run = Run().until_flies("return_home")
    run.tick(event)
    run.until_over()
    assert run.flown == ["takeoff", "goto", "inspect_area", "return_home"]
    assert run.ending is (Ending.INTERRUPTED if isinstance(event, Interrupted) else Ending.EVIDENCE_LOST)


def test_a_return_that_fails_after_an_interrupt_still_falls_back() -> None:
    run = Run().until_flies("return_home")
    run.tick(Interrupted(0), CommandFailed(0, run.vehicle.commands[-1].token, "no-effect"))
    run.until_over()
    assert run.flown[-1] == "emergency_land"
    assert run.ending is Ending.INTERRUPTED


def test_a_link_that_comes_back_lets_the_skill_go_on() -> None:
    run = running()
    run.tick(LinkLost(0))
    run.vehicle.mute = True
    for _ in range(100):
        run.tick(LinkLost(0))
    run.vehicle.mute = False
    run.tick(LinkBack(0), LinkBack(0))
    assert run.until_over().ending is Ending.COMPLETED
    assert run.events.count("link-lost") == run.events.count("link-back") == 1


@rows("situation", GROUND + AIR)
def test_a_link_that_stays_away_ends_the_run(situation: Situation) -> None:
    run = situation()
    run.vehicle.mute = True
    began = run.clock.now().monotonic_us
    run.tick(LinkLost(0))
    flown = list(run.flown)
    waited_us = 30 * S + (SHORT.endurance_us if situation in AIR else 0)
    run.until_over(waited_us // S + 1)
    assert run.ending is Ending.LINK_LOST
    assert run.flown == flown, "nothing is sent that would not arrive"
    assert run.clock.now().monotonic_us - began >= waited_us, "in the air it may come back as long as it can fly"
    (detail,) = [record["detail"] for record in run.records if record.get("event") == "stood-down"]
    seen = {waiting: "the vehicle never reported whether it was in the air"}
    seen |= dict.fromkeys((deferred_on_the_ground, taking_off), "last seen on the ground")
    last_seen = seen.get(situation, "last seen in the air")
    flies = situation in AIR
    assert detail.startswith(f"{last_seen}; the vehicle may be flying" if flies else last_seen)
    assert ("may be flying" in detail) == flies == bool(run.runtime.may_fly)


def test_a_failsafe_while_the_link_was_lost_is_the_autopilots() -> None:
    run = running()
    run.tick(LinkLost(0))
    run.tick(LinkBack(0), TakenOver(0, "RTL"))
    assert run.ending is Ending.STOOD_DOWN


def test_failure_during_silence_falls_back_when_link_returns() -> None:
    run = running()
    token = run.vehicle.commands[-1].token
    run.tick(LinkLost(0), CommandFailed(0, token, "no-effect"))
    assert run.flown[-1] == "inspect_area"
    (detail,) = [record["detail"] for record in run.records if record.get("event") == "failed"]
    assert detail == "no-effect; the link is silent: the state of the vehicle is unknown"
    run.tick(LinkBack(0))
    assert run.flown[-1] == "hover"
    assert run.until_over().ending is Ending.ABORTED


def test_interrupt_during_link_loss_falls_back_on_reconnection() -> None:
    run = running()
    run.tick(LinkLost(0), Interrupted(0))
    run.tick()
    run.tick(LinkBack(0))
    assert run.flown[-1] == "hover"
    assert run.until_over().ending is Ending.INTERRUPTED


@pytest.mark.parametrize("situation", GROUND)
def test_flight_needs_working_evidence(situation: Situation) -> None:
    run = situation()
    run.tick(EvidenceFailed(0, "disk full"))
    assert run.ending is Ending.EVIDENCE_LOST
    assert run.flown == []


@pytest.mark.parametrize("situation", AIR)
def test_a_lost_disk_brings_the_vehicle_down_and_the_gap_is_recorded_once(situation: Situation) -> None:
    run = situation()
    sent = len(run.flown)
    run.tick(EvidenceFailed(0, "disk full"))
    run.tick(EvidenceFailed(0, "disk full"), Interrupted(0))
    run.until_over()
    assert run.ending is Ending.EVIDENCE_LOST
    assert run.events.count("gap") == 1
    assert not run.vehicle.airborne
    after = [action for action in run.actions if isinstance(action, Command)][sent:]
    assert not any(command.needs_record for command in after), "nothing new is allowed any more"
    assert all(
        command.needs_record for command in run.actions if isinstance(command, Command) and command.skill == "takeoff"
    )


def test_the_gravest_cause_names_the_ending() -> None:
    run = falling()
    run.tick(Interrupted(0))
    run.tick(EvidenceFailed(0, "disk full"))
    run.tick(Interrupted(0))
    assert run.until_over().ending is Ending.EVIDENCE_LOST


def test_landing_by_the_air_state_alone_ends_a_fallback() -> None:
    run = returning()
    run.tick(AirState(0, False, False))
    assert run.ending is Ending.ABORTED
    assert run.events[-1] == "landed"


class Deaf:
    """A boundary that stops answering on command, without any other sign."""

    lost: str | None = None

    def __init__(self, run_boundary: object) -> None:
        self.boundary = run_boundary
        self.answer: bytes | None = None

    def enforce(self, request: bytes) -> bytes:
        return self.boundary.enforce(request) if self.answer is None else self.answer  # type: ignore[attr-defined, no-any-return]


@pytest.mark.parametrize("answer", [b"", b"\x00" * 40, encode_refusal(Status.MALFORMED)])
def test_a_boundary_that_does_not_answer_leaves_the_standing_permits(answer: bytes) -> None:
    of = loaded()
    deaf = Deaf(of.boundary)
    run = Run(replace(of, boundary=deaf)).until_flies("goto")
    deaf.answer = answer
    run.until_over()
    assert run.flown == ["takeoff", "goto", "hover", "return_home"], "undecided in the air is the contingency"
    assert run.ending is Ending.ABORTED
    assert run.events.count("undecided") == 3
    assert_audited(run)


def test_boundary_loss_is_recorded_first_and_ends_requests() -> None:
    """The running step falls back by its standing permit; nothing is recorded as the boundary's."""
    of = loaded()
    deaf = Deaf(of.boundary)
    run = Run(replace(of, boundary=deaf)).until_flies("goto")
    deaf.answer, deaf.lost = b"", "it is gone"
    run.until_over()
    assert run.flown == ["takeoff", "goto", "hover", "return_home"]
    assert run.ending is Ending.ABORTED
    assert "undecided" not in run.events
    assert run.events.count("boundary-lost") == 1
    said = next(n for n, record in enumerate(run.records) if record.get("event") == "boundary-lost")
    after = [(r["kind"], r["step"], r["link"]) for r in run.records[said:] if r.get("event") == "dispatched"]
    assert after == [(1, 1, 0), (1, 1, 1)]
    assert not [record for record in run.records[said:] if record["type"] == "decision"]


def test_a_boundary_that_is_lost_on_the_ground_ends_the_run() -> None:
    of = loaded()
    deaf = Deaf(of.boundary)
    deaf.answer, deaf.lost = b"", "it is gone"
    run = Run(replace(of, boundary=deaf))
    assert run.ending is Ending.REFUSED
    assert run.flown == []


def test_return_continues_when_boundary_is_lost() -> None:
    of = loaded()
    deaf = Deaf(of.boundary)
    run = Run(replace(of, boundary=deaf)).until_flies("return_home")
    deaf.answer, deaf.lost = b"", "it is gone"
    run.until_over()
    assert run.flown.count("return_home") == 1
    assert run.flown[-1] == "return_home"
    assert run.ending is Ending.ABORTED, "nobody was there to say that all was done"


def test_unanswering_boundary_prevents_flight() -> None:
    of = loaded()
    deaf = Deaf(of.boundary)
    deaf.answer = b""
    run = Run(replace(of, boundary=deaf))
    assert run.ending is Ending.REFUSED
    assert run.flown == []


def test_an_undecided_link_of_a_running_step_flies_by_its_standing_permit() -> None:
    of = loaded()
    deaf = Deaf(of.boundary)
    run = Run(replace(of, boundary=deaf)).until_flies("goto")
    deaf.answer = b""
    run.vehicle.values[WIND] = 12 * M
    run.until_over()
    assert run.flown == ["takeoff", "goto", "hover", "return_home"]
    dispatched = [(r["kind"], r["step"], r["link"]) for r in run.records if r.get("event") == "dispatched"]
    assert dispatched[-2:] == [(1, 1, 0), (1, 1, 1)]


def test_a_vehicle_that_never_moves_again_is_stood_down_from() -> None:
    skills = {"hover", "return_home", "emergency_land"}
    run = Run(renewed(OF), FakeVehicle(deaf=skills), limits=Limits(tries=2, retry_us=S)).until_flies("goto")
    run.vehicle.values[WIND] = 12 * M
    while run.ending is None:  # a second at a time: this takes half an hour
        run.clock.advance(S - TICK)
        run.tick()
    assert run.ending is Ending.ABORTED
    assert run.events[-1] == "stood-down"
    assert run.runtime.view(run.clock.now()).stage is RunStage.ENDED


class Echo:
    """A boundary whose answers are kept, and replayed on command."""

    lost = None

    def __init__(self, of: Loaded) -> None:
        self._boundary = of.boundary
        self.kept: list[bytes] = []
        self.playing = False

    def enforce(self, request: bytes) -> bytes:
        if self.playing:
            return self.kept[-1]
        self.kept.append(self._boundary.enforce(request))
        return self.kept[-1]


def test_an_old_answer_played_again_sends_nothing() -> None:
    of = loaded()
    echo = Echo(of)
    run = Run(replace(of, boundary=echo)).until_flies("takeoff")
    echo.playing = True
    run.until_over()
    detail = [record["detail"] for record in run.records if record.get("event") == "refused"]
    assert detail[0] == "permit/used"
    assert run.flown == ["takeoff", "emergency_land"], "only what stands behind the step that was sent"


def test_the_boundary_fails_while_a_chain_is_flown() -> None:
    of = loaded()
    deaf = Deaf(of.boundary)
    run = Run(replace(of, boundary=deaf), FakeVehicle(fails={"hover", "return_home", "emergency_land"}))
    run.until_flies("goto")
    run.vehicle.values[WIND] = 12 * M
    run.until_flies("hover")
    deaf.answer = b""
    run.until_over()
    again = ["emergency_land"] * Limits().tries
    assert run.flown[2:] == ["hover", "return_home", "emergency_land"] * 2 + again, (
        "each standing permit is good for one dispatch, but for the last link's"
    )
    assert run.vehicle.released
    assert run.events[-2:] == ["stranded", "stood-down"]
    assert_audited(run)


@rows("situation", GROUND + AIR)
def test_runtime_reports_whether_vehicle_must_land(situation: Situation) -> None:
    assert situation().runtime.aloft is (situation in AIR)


@rows("situation", GROUND + AIR)
def test_a_bundle_is_used_up_by_what_is_dispatched_and_its_log_says_so(situation: Situation) -> None:
    run = situation()
    run.tick(Interrupted(0))
    run.until_over()
    assert run.runtime.used_up == (situation in AIR)
    assert run.runtime.used_up == ("dispatched" in run.events)


def test_repeated_notes_are_counted_and_reported() -> None:
    run = waiting()

    def noted() -> list[str]:
        told = [json.loads(line) for line in run.lines]
        return [each["detail"] for each in told if each.get("event") == "noted"]

    for _ in range(3):
        run.tick(Noted(0, "the cable is loose"))
    run.tick(Noted(0, "another"))
    assert noted() == ["the cable is loose", "another"], "the first at once"
    for _ in range(REPEATED_EVERY_US // TICK):
        run.tick()
    assert noted()[2:] == ["the cable is loose (2 more times, the last 29 s ago)"], "counted, and not told as new"
    run.tick(Noted(0, "another"))
    run.tick(Noted(0, "the cable is loose"))
    assert noted()[3:] == ["another"], "its time is over"
    run.tick(Interrupted(0))
    run.until_over()
    assert noted()[4:] == ["the cable is loose (1 more time)"]
    assert_audited(run)


def test_notes_beyond_counting_limit_are_all_recorded() -> None:
    run = waiting()
    for number in (*range(70), 69, 0):
        run.tick(Noted(0, f"{number}"))
    assert run.events.count("noted") == 71


def ended_links(run: Run) -> list[tuple[str, str]]:
    told = [json.loads(line) for line in run.lines]
    return [(each["event"], each["detail"]) for each in told if each.get("event") in ("time-over", "released")]


def test_fallback_without_observed_landing_is_recorded() -> None:
    run = returning()
    assert ended_links(run) == [("time-over", "")], "a hold is over when its time is"
    run.tick(TakenOver(0, "POSCTL"))
    assert ended_links(run)[1:] == [("released", UNCONFIRMED)]
    step = running()
    step.tick(TakenOver(0, "POSCTL"))
    assert ended_links(step) == [("released", "")], "a step is no fallback"
