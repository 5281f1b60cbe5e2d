"""Foreign flights: nothing is sent to a flight that somebody else began, and an unordered landing ends the mission."""

from collections.abc import Callable

import pytest
from msgspec.structs import replace

from reference.flat_case import (
    BATTERY,
    CONTRACTS,
    HEIGHT,
    HOME,
    INVOCATIONS,
    LAND,
    LINK,
    MIN,
    MISSION,
    OBSTACLE,
    POLICY,
    POSITION_X,
    WIND,
    M,
    S,
    link,
)
from reference.world import FakeVehicle, Run, assert_audited, loaded
from rtshcua.model.flat.mission import OnInadmissible
from rtshcua.onboard.enforcement.load import Loaded
from rtshcua.onboard.ports import AirState, CommandFailed, Ending, Event, EvidenceFailed, Interrupted
from rtshcua.onboard.runtime.runtime import Runtime

CAUSES = [(Interrupted(0), Ending.INTERRUPTED), (EvidenceFailed(0, "disk full"), Ending.EVIDENCE_LOST)]


def flying() -> FakeVehicle:
    vehicle = FakeVehicle(airborne=True, armed=True)
    vehicle.values[HEIGHT] = 20 * M
    return vehicle


@pytest.mark.parametrize(("event", "ending"), CAUSES)
def test_a_foreign_flight_is_left_alone_before_ready(event: Event, ending: Ending) -> None:
    run = Run(ready=False, vehicle=flying())
    run.step(AirState(0, True, True), event)
    assert run.ending is ending
    assert run.flown == []


@pytest.mark.parametrize(("event", "ending"), CAUSES)
def test_a_flight_of_an_earlier_run_is_brought_down_before_ready(event: Event, ending: Ending) -> None:
    run = Run(ready=False, vehicle=flying(), resumed=True)
    run.tick(AirState(0, True, True), event)
    run.until_over()
    assert run.ending is ending
    assert run.flown == ["hover", "return_home"]


@pytest.mark.parametrize("back", [False, True])
def test_pilot_takeoff_during_deferral_is_a_takeover(back: bool) -> None:
    run = Run(vehicle=FakeVehicle(silent={WIND}))
    run.tick()
    run.vehicle.airborne = run.vehicle.armed = True
    run.vehicle.silent = set() if back else {WIND}
    run.tick(AirState(0, True, True))
    assert run.ending is Ending.STOOD_DOWN
    assert run.flown == []
    assert run.events[:3] == ["ready", "taken-over", "stood-down"]


@pytest.mark.parametrize("words", [(True, False), (False,)], ids=["touches down, disarms", "at once"])
def test_unordered_landing_during_hold_ends_mission(words: tuple[bool, ...]) -> None:
    run = Run().until_flies("goto")
    run.vehicle.values[OBSTACLE] = None
    run.until_flies("hover")
    flown = list(run.flown)
    for armed in words:
        run.tick(AirState(0, armed, False))
    assert run.ending is Ending.ABORTED
    assert run.flown == flown
    assert_audited(run)


def test_a_hold_that_failed_on_the_ground_is_a_landing_too() -> None:
    run = Run().until_flies("goto")
    run.vehicle.values[OBSTACLE] = None
    run.until_flies("hover")
    run.tick(CommandFailed(0, run.vehicle.commands[-1].token, "disarmed"), AirState(0, False, False))
    assert run.ending is Ending.ABORTED


# ------------------------------------------------------------------------------ not in the air yet


def arming(*, armed: bool) -> Run:
    chain = (link(HOME), link(LAND))
    first = replace(CONTRACTS[0], fallback=chain)
    mission = replace(MISSION, invocations=(replace(INVOCATIONS[0], contract=first), *INVOCATIONS[1:]))
    of = loaded(replace(POLICY, contracts=(first, *CONTRACTS[1:])), mission)
    run = Run(of, FakeVehicle(deaf={"takeoff"}))
    run.tick(AirState(0, armed, False))
    return run


@pytest.mark.parametrize("armed", [False, True])
@pytest.mark.parametrize(("event", "ending"), CAUSES)
def test_aborted_takeoff_on_ground_gets_land_command(event: Event, ending: Ending, armed: bool) -> None:
    """Also if it is not reported as armed: the arming command may be on its way, in an automatic takeoff mode."""
    run = arming(armed=armed)
    run.tick(event)
    assert run.flown == ["takeoff", "emergency_land"]
    assert run.until_over().ending is ending
    assert_audited(run)


def test_failed_takeoff_of_armed_vehicle_gets_land_command() -> None:
    run = arming(armed=True)
    run.tick(CommandFailed(0, run.vehicle.commands[-1].token, "no-effect"))
    assert run.flown == ["takeoff", "emergency_land"]
    assert run.until_over().ending is Ending.ABORTED


# --------------------------------------------------------------------------------------- holding in the air


def patient() -> Loaded:
    """Its steps hold for 15 minutes."""
    contracts = tuple(replace(each, deadline_us=15 * MIN) for each in CONTRACTS)
    steps = tuple(
        replace(each, contract=contracts[each.skill], on_inadmissible=OnInadmissible.HOLD) for each in INVOCATIONS
    )
    return loaded(replace(POLICY, contracts=contracts), replace(MISSION, invocations=steps))


def waiting_aloft() -> Run:
    run = Run(patient()).until_flies("goto")
    run.vehicle.values[OBSTACLE] = M
    run.until_flies("hover")
    for _ in range(40):
        run.tick()
    assert run.flown == ["takeoff", "goto", "hover"]
    return run


@pytest.mark.parametrize(
    ("slot", "value", "text"),
    [
        (BATTERY, 2_400, POLICY.rules[-1].text),
        (BATTERY, None, f"{POLICY.rules[-1].text}: unknown for longer than its grace of 500 ms"),
        (POSITION_X, 900 * M, "airspace inside city outside school"),
    ],
)
def test_a_hold_is_watched(slot: int, value: int | None, text: str) -> None:
    run = waiting_aloft()
    run.vehicle.values[slot] = value
    run.until_over()
    assert run.flown[-1] == "return_home"
    assert run.ending is Ending.ABORTED
    assert [record["detail"] for record in run.records if record.get("event") == "violated"] == [text]
    assert_audited(run)


def test_hold_tolerates_unknown_within_grace() -> None:
    run = waiting_aloft()
    run.vehicle.values[BATTERY] = None
    for _ in range(9):
        run.tick()
    run.vehicle.values[BATTERY] = 9_000
    run.vehicle.values[OBSTACLE] = 20 * M
    assert run.until_over().ending is Ending.COMPLETED


# ------------------------------------------------------------------------------------------------ leaving


def left(run: Run) -> Runtime:
    run.runtime.leave()
    run.tick()
    return run.runtime


@pytest.mark.parametrize("skill", ["goto", "inspect_area"])
def test_leaving_a_flight_lands_it_first(skill: str) -> None:
    run = Run().until_flies(skill)
    assert left(run).homeward
    assert run.flown[-1] == "emergency_land"


def test_leaving_a_return_lets_it_continue() -> None:
    run = Run().until_flies("return_home")
    assert left(run).homeward
    assert run.flown[-1] == "return_home"


@pytest.mark.parametrize("begin", [lambda: Run(ready=False), lambda: Run(ready=False, vehicle=flying())])
def test_leaving_a_foreign_flight_sends_nothing(begin: Callable[[], Run]) -> None:
    run = begin()
    run.step(AirState(0, run.vehicle.armed, run.vehicle.airborne))
    assert not left(run).homeward
    assert run.flown == []


def test_a_low_link_alone_is_waited_out() -> None:
    run = waiting_aloft()
    run.vehicle.values[LINK] = 1_000
    for _ in range(5 * S // 50_000):
        run.tick()
    assert run.flown[-1] == "hover"
