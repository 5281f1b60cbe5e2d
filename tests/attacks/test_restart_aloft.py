"""A program that died in the air restarts: the vehicle is brought down, whatever happens before its state is known."""

import pytest
from msgspec.structs import replace

from reference.documents import low, recall
from reference.flat_case import S
from reference.world import ROOT, START, FakeVehicle, Run, assert_audited, renewed
from rtshcua.onboard.ports import AirState, Ending, Event, EvidenceFailed, Interrupted, Presented, Ready, VehicleAnswers
from rtshcua.onboard.runtime.limits import Limits

OF = low()


def back() -> Run:
    """A new run of a flying bundle, before the first report."""
    return Run(renewed(OF), FakeVehicle(armed=True, airborne=True), resumed=True, ready=False)


@pytest.mark.parametrize(
    ("event", "ending"),
    [
        (Interrupted(0), Ending.INTERRUPTED),
        (EvidenceFailed(0, "the disk is full"), Ending.EVIDENCE_LOST),
        (Presented(0, recall(OF)), Ending.RECALLED),
    ],
)
def test_run_can_end_before_air_state_is_known(event: Event, ending: Ending) -> None:
    run = back()
    run.tick(event)
    run.tick(AirState(0, True, True))
    run.until_over()
    assert run.flown[-1] in ("return_home", "emergency_land")
    assert run.ending is ending
    assert_audited(run)


@pytest.mark.parametrize("known", [False, True])
def test_vehicle_that_is_never_ready_is_brought_down(known: bool) -> None:
    run = Run(
        renewed(OF), FakeVehicle(armed=True, airborne=True), limits=Limits(ready_us=2 * S), resumed=True, ready=False
    )
    if known:
        run.tick(AirState(0, True, True))
    run.until_over()
    assert run.flown[-1] in ("return_home", "emergency_land")


def test_unresponsive_vehicle_gets_no_command() -> None:
    """The fallback must be chosen when commands arrive; chosen earlier, on the old state, it would land on the spot."""
    run = back()
    run.tick(AirState(0, True, True), VehicleAnswers(0, answers=False))
    run.until(lambda run: run.clock.now().monotonic_us > START.monotonic_us + Limits().ready_us + 10 * S, 140)
    assert (run.flown, run.ending) == ([], None)
    run.tick(VehicleAnswers(0, answers=True))
    run.tick()
    assert run.flown == [], "it is not ready yet"
    run.tick(Ready(0))
    run.until_over()
    assert run.flown[-1] == "return_home"
    assert_audited(run)


def test_unresponsive_vehicle_is_given_up_after_endurance() -> None:
    run = back()
    run.tick(AirState(0, True, True), VehicleAnswers(0, answers=False))
    flies_us = OF.bundle.policy.vehicle.endurance_us
    run.until_over((flies_us + Limits().silent_us) // S + 1)
    assert (run.flown, run.ending) == ([], Ending.LINK_LOST)
    assert_audited(run)


def test_armed_vehicle_is_told_to_land() -> None:
    """The program died between takeoff command and lift-off: otherwise the vehicle would climb without supervision."""
    run = Run(renewed(OF), FakeVehicle(armed=True), resumed=True, ready=False)
    run.tick(AirState(0, True, False))
    assert (run.flown, run.ending) == ([], None)
    run.tick(Ready(0))
    run.until_over()
    assert run.flown == ["emergency_land"]
    assert run.ending is Ending.ABORTED
    assert_audited(run)


def test_vehicle_armed_by_another_is_left_alone() -> None:
    run = Run(renewed(OF), FakeVehicle(armed=True), resumed=True, ready=False)
    run.tick(AirState(0, True, False), Ready(0, "Position"))
    run.tick()
    assert (run.flown, run.ending) == ([], Ending.STOOD_DOWN)


def test_armed_vehicle_that_is_never_ready_is_not_abandoned() -> None:
    run = Run(renewed(OF), FakeVehicle(armed=True), limits=Limits(ready_us=2 * S), resumed=True, ready=False)
    run.tick(AirState(0, True, False))
    run.until_over()
    assert run.flown == ["emergency_land"]


def test_vehicle_on_ground_is_left_alone() -> None:
    run = Run(renewed(OF), resumed=True, ready=False)
    run.tick(AirState(0, False, False))
    run.tick(Interrupted(0))
    assert run.ending is Ending.INTERRUPTED
    assert run.flown == []


def test_vehicle_under_expired_root_is_brought_down() -> None:
    expired = replace(ROOT, expires_at_us=START.utc_us - 1)
    run = Run(renewed(OF, expired), FakeVehicle(armed=True, airborne=True), resumed=True, ready=False)
    run.tick(AirState(0, True, True), Ready(0))
    run.until_over()
    assert run.flown[-1] == "return_home"
    assert run.ending is Ending.ABORTED
