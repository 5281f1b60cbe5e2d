"""Every end of a run after a command warns that the vehicle may be flying, unless a landing was observed."""

from collections.abc import Callable

import pytest

from reference.flat_case import OBSTACLE, WIND, M, S
from reference.world import FakeVehicle, Run, loaded
from rtshcua.onboard.ports import (
    PAUSED,
    AirState,
    CommandFailed,
    Crashed,
    Ending,
    Event,
    EvidenceFailed,
    Interrupted,
    LinkLost,
    Noted,
    Obeyed,
    Succeeded,
    TakenOver,
    VehicleAnswers,
    VehicleUnfit,
)
from rtshcua.onboard.runtime.controller import MAY_FLY

Way = Callable[[Run], object]


def start(**more: object) -> Run:
    return Run(loaded(), **more)  # type: ignore[arg-type]


def flying(**more: object) -> Run:
    return start(**more).until_flies("goto")


def over(run: Run, seconds: int = 2_000) -> Run:
    for _ in range(seconds):
        if run.ending is not None:
            return run
        run.clock.advance(S)
        run.tick()
    raise AssertionError(f"it goes on: {run.events}")


def taken(run: Run) -> None:
    run.tick(TakenOver(0, "Position"))


def failsafe(run: Run) -> None:
    run.tick(TakenOver(0, "RTL", failsafe=True))


def silent(run: Run) -> None:
    run.step(LinkLost(run.clock.now().monotonic_us, "silent"))
    run.step(Interrupted(0))
    for _ in range(60):
        run.clock.advance(S)
        run.step()


def mute(run: Run) -> None:
    run.vehicle.deaf = {"hover", "return_home", "emergency_land"}
    run.tick(VehicleAnswers(0, answers=False))
    run.tick(Interrupted(0))


def stranded(run: Run) -> None:
    run.vehicle.fails = {"hover", "return_home", "emergency_land"}
    run.vehicle.values[WIND] = 30 * M


#: what ends a run in the air without a landing: how it ends, and the words that say why nothing watches it
ENDS: dict[str, tuple[Way, Ending, str]] = {
    "a pilot": (taken, Ending.STOOD_DOWN, "somebody else flies the vehicle"),
    "a failsafe": (failsafe, Ending.STOOD_DOWN, "own failsafe flies the vehicle"),
    "silence": (silent, Ending.LINK_LOST, "not heard"),
    "no answers": (mute, Ending.LINK_LOST, "does not answer"),
    "no link left": (stranded, Ending.ABORTED, "no landing was observed"),
}


#: causes that abort a mission before the last link
GIVEN_UP: dict[str, Callable[[Run], object]] = {
    "interrupted": lambda run: run.tick(Interrupted(0)),
    "no records": lambda run: run.tick(EvidenceFailed(0, "the disk is full")),
    "left": lambda run: run.runtime.leave(),
}


@pytest.mark.parametrize("name", GIVEN_UP)
def test_exhausted_links_are_named_after_any_abort(name: str) -> None:
    """An earlier request to end the run is not the reason."""
    run = flying()
    run.vehicle.fails = {"hover", "return_home", "emergency_land"}
    GIVEN_UP[name](run)
    over(run)
    assert "the vehicle may be flying: the last link of the contingency was sent as often" in run.runtime.may_fly
    assert "so it ends and stops watching" in run.runtime.may_fly


def test_standstill_warning_says_what_to_do() -> None:
    run = flying()
    run.tick(TakenOver(0, PAUSED))
    assert "who may resume the flight at any time" in run.runtime.may_fly
    assert run.runtime.may_fly.endswith("if nobody did, nobody flies it: take it over")


@pytest.mark.parametrize("way", [Interrupted(0), EvidenceFailed(0, "the disk is full"), None])
def test_failed_landing_after_accepted_takeoff_warns_that_vehicle_may_fly(way: Event | None) -> None:
    """It always reports that it rests, but obeyed a takeoff: the landing that was sent failed."""
    run = start(vehicle=FakeVehicle(deaf={"takeoff"}, fails={"emergency_land"})).until_flies("takeoff")
    token = run.vehicle.commands[-1].token
    run.tick(Obeyed(0, token))
    run.tick(AirState(0, armed=False, airborne=False))
    if way is not None:
        run.tick(way)
    else:  # the climb counts as done, and the next step is awaited
        run.vehicle.values[OBSTACLE] = None
        run.tick(Succeeded(0, token), AirState(0, armed=False, airborne=False))
    over(run)
    assert "approach it as if it may start" in run.runtime.may_fly
    assert MAY_FLY in run.events


@pytest.mark.parametrize("name", ENDS)
def test_run_ending_in_the_air_warns_of_a_flying_vehicle(name: str) -> None:
    way, ending, words = ENDS[name]
    run = flying()
    way(run)
    over(run)
    assert run.ending is ending
    told = [each["detail"] for each in run.records if each.get("event") in ("stood-down", MAY_FLY)]
    assert [("the vehicle may be flying" in each, words in each) for each in told] == [(True, True)]
    assert told == [run.runtime.may_fly]


@pytest.mark.parametrize("ending", [Interrupted(0), None])
def test_observed_landing_gives_no_warning(ending: Interrupted | None) -> None:
    run = flying()
    if ending is not None:
        run.tick(ending)
    over(run)
    assert run.runtime.may_fly == ""
    assert MAY_FLY not in run.events


def test_obeyed_command_that_failed_on_ground_is_reported() -> None:
    """The vehicle reports that it rests, but may still have the command to climb."""
    run = start(vehicle=FakeVehicle(deaf={"takeoff"})).until_flies("takeoff")
    token = next(each["token"] for each in run.records if each.get("event") == "dispatched")
    run.tick(Obeyed(0, token))
    run.tick(AirState(0, armed=False, airborne=False))
    run.tick(CommandFailed(0, token, "disarmed"))
    over(run)
    assert run.ending is Ending.REFUSED
    assert "approach it as if it may start" in run.runtime.may_fly
    assert MAY_FLY in run.events


def test_refusal_with_nothing_sent_has_no_flight_warning() -> None:
    run = start(ready=False)
    run.tick(Interrupted(0))
    assert over(run).runtime.may_fly == ""


def test_crash_has_its_own_text() -> None:
    run = flying()
    run.tick(Crashed(0, "it leans 80 degrees"))
    assert (over(run).ending, run.runtime.may_fly) == (Ending.CRASHED, "")


def test_a_pilot_and_a_failsafe_take_over_with_different_words() -> None:
    details = []
    for way in (taken, failsafe):
        run = flying()
        way(run)
        details += [each["detail"] for each in run.records if each.get("event") == "taken-over"]
    assert details == ["Position", "by its own failsafe: RTL"]


def test_unfit_vehicle_ends_the_wait_at_once() -> None:
    run = start(ready=False)
    began_us = run.clock.now().monotonic_us
    run.tick(VehicleUnfit(0, "the vehicle returns at 15 m (`RTL_ALT`), and the policy says 30 m"))
    over(run, 3)
    assert run.ending is Ending.REFUSED
    assert run.clock.now().monotonic_us - began_us < 5 * S
    (record,) = [each for each in run.records if each.get("event") == "never-ready"]
    assert "RTL_ALT" in record["detail"]


def test_late_command_reports_a_busy_computer() -> None:
    run = start(vehicle=FakeVehicle(deaf={"takeoff"})).until_flies("takeoff")
    token = next(each["token"] for each in run.records if each.get("event") == "dispatched")
    run.tick(CommandFailed(0, token, "late"))
    (record,) = [each for each in run.records if each.get("event") == "failed"]
    assert "too busy" in record["detail"]


def test_note_count_keeps_order_with_opposite_note() -> None:
    run = flying(vehicle=FakeVehicle(deaf={"goto"}))
    bad, good = "the vehicle reports a critical state", "the vehicle's state is no longer critical"
    for text in (bad, good, bad, good):
        run.tick(Noted(0, text))
    for _ in range(35):
        run.clock.advance(S)
        run.tick()
    noted = [each["detail"] for each in run.records if each.get("event") == "noted"]
    assert noted[:2] == [bad, good]
    assert all("1 more time, the last 3" in each or each == f"{good} (1 more time)" for each in noted[2:]), noted
