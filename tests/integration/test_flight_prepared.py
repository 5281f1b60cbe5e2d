"""Parameters configured by an operator are set before a flight and restored after it."""

from collections.abc import Sequence
from typing import Any

import pytest

from rtshcua.mavlink.parameters import bits_of, value_of
from rtshcua.model.faults import Kill, LinkLoss, MessageSilence, PilotMode
from rtshcua.onboard.enforcement.frames import FrameSession
from rtshcua.onboard.enforcement.preparation import Owed
from rtshcua.onboard.ports import Ending, Event, Interrupted
from rtshcua.virtual.vehicle import VirtualVehicle
from virtual.flight import Flight
from virtual.shipped import shipped, simulated

S = 1_000_000
#: what its owner has, which the mission does not fit into, and what is configured; `short` returns at 30 m
NARROW = {
    "ardupilot": ({"FENCE_RADIUS": 30.0, "FENCE_ALT_MAX": 15.0}, {"FENCE_RADIUS": 250.0, "FENCE_ALT_MAX": 80.0}),
    "px4": ({"GF_MAX_VER_DIST": 15.0, "GF_ACTION": 1.0}, {"GF_MAX_VER_DIST": 80.0, "GF_ACTION": 3.0}),
}
FLAVOURS = pytest.mark.parametrize("flavour", NARROW)


def bits(values: dict[str, float]) -> dict[str, int]:
    return {name: found for name, value in values.items() if (found := bits_of(value)) is not None}


def prepared(flavour: str, owed: dict[str, Owed] | None = None, **fields: Any) -> Flight:
    had, settings = NARROW[flavour]
    config = simulated(flavour, parameters=tuple(had.items()), **fields)
    return Flight(shipped("short"), config, settings=bits(settings), owed=owed)


def has(flight: Flight, names: Sequence[str]) -> dict[str, float]:
    parameters = flight.vehicle.simulation._autopilot.parameters
    return {name: parameters.value(name) for name in names}


@FLAVOURS
def test_configured_parameters_are_set_and_restored(flavour: str) -> None:
    had, settings = NARROW[flavour]
    owed: dict[str, Owed] = {}
    flight = prepared(flavour, owed)
    during: list[dict[str, float]] = []

    def each(of: Flight) -> Sequence[Event]:
        if of.vehicle.simulation.truth().up_mm > 5_000:
            during.append(has(of, tuple(settings)))
        return ()

    flown = flight.fly(each)
    assert flown.ending is Ending.COMPLETED
    assert during
    assert all(each == settings for each in during)
    assert has(flight, tuple(had)) == had
    assert owed == {}
    told = [each["detail"] for each in flown.effects("preparation")]
    assert [each.split()[0] for each in told] == ["set", "restore"]
    for name, value in had.items():
        assert f"{name} from {value:g} to {settings[name]:g}" in told[0]
        assert f"{name} from {settings[name]:g} to {value:g}" in told[1]
    assert len(flown.effects("prepared")) == 2
    order = [each["event"] for each in flown.records if each["type"] == "effect"]
    assert order.index("prepared") < order.index("ready") < order.index("dispatched")
    assert flown.audit().report.failure is None


@FLAVOURS
def test_mission_without_prepared_parameters_is_refused(flavour: str) -> None:
    had, _ = NARROW[flavour]
    flight = Flight(shipped("short"), simulated(flavour, parameters=tuple(had.items())))
    assert flight.fly().ending is Ending.REFUSED
    assert has(flight, tuple(had)) == had


@pytest.mark.slow
@FLAVOURS
@pytest.mark.parametrize("fault", [
    MessageSilence(at_us=S, message="PARAM_VALUE", for_us=6 * S), LinkLoss(at_us=0, loss=2_000, for_us=20 * S),
], ids=["no PARAM_VALUE for a while", "a fifth of all is lost"])  # fmt: skip
def test_lost_parameter_answers_only_delay_the_flight(flavour: str, fault: Any) -> None:
    had, _ = NARROW[flavour]
    flight = prepared(flavour, faults=(fault,))
    assert flight.fly().ending is Ending.COMPLETED
    assert has(flight, tuple(had)) == had


@FLAVOURS
def test_unanswered_parameter_refuses_the_mission(flavour: str) -> None:
    flight = prepared(flavour, faults=(MessageSilence(at_us=0, message="PARAM_VALUE"),))
    flown = flight.fly()
    assert flown.ending is Ending.REFUSED
    assert flown.dispatched() == flown.effects("preparation") == []
    assert has(flight, tuple(NARROW[flavour][0])) == NARROW[flavour][0]


@FLAVOURS
def test_interrupt_on_the_ground_restores_parameters(flavour: str) -> None:
    had, _ = NARROW[flavour]
    flight = prepared(flavour)
    asked = [False]

    def each(of: Flight) -> Sequence[Event]:
        if asked[0] or has(of, tuple(had)) == had:
            return ()
        asked[0] = True
        return [Interrupted(of.clock.now().monotonic_us)]

    flown = flight.fly(each)
    assert flown.ending is Ending.INTERRUPTED
    assert flown.dispatched() == []
    assert len(flown.effects("preparation")) == 2
    assert has(flight, tuple(had)) == had


@FLAVOURS
def test_next_run_restores_parameters_of_a_dead_run(flavour: str) -> None:
    had, settings = NARROW[flavour]
    owed: dict[str, Owed] = {}
    first = prepared(flavour, owed)
    assert first.prepare() is None
    while first.vehicle.simulation.truth().up_mm < 8_000:  # like `fly`, but the process dies here
        assert first.turn() is None
    assert set(owed) == set(had)
    assert has(first, tuple(had)) == settings

    bundle = first.loaded.bundle
    again = VirtualVehicle(
        bundle.policy, simulated(flavour), first.clock, FrameSession(), steps=bundle.mission.invocations
    )
    again.simulation = first.vehicle.simulation
    second = Flight(shipped("short"), simulated(flavour), vehicle=again, resumed=True, owed=owed)
    flown = second.fly()
    assert flown.ending is Ending.ABORTED
    (kept,) = flown.effects("not-restored")
    assert "not known to be on the ground" in kept["detail"]
    (put_back,) = flown.effects("preparation")
    assert put_back["detail"].startswith("restore ")
    assert put_back["seq"] > flown.effects("resumed")[0]["seq"]
    assert has(second, tuple(had)) == had
    assert owed == {}
    assert flown.audit().report.failure is None


@pytest.mark.parametrize("settings", [{}, {"FENCE_ALT_MAX": 90.0}], ids=["nothing is set", "something is to be set"])
def test_run_that_cannot_record_still_lands_a_broken_off_flight(settings: dict[str, float]) -> None:
    owed: dict[str, Owed] = {}
    first = prepared("ardupilot", owed)
    assert first.prepare() is None
    while first.vehicle.simulation.truth().up_mm < 8_000:
        assert first.turn() is None
    bundle, left = first.loaded.bundle, dict(owed)
    again = VirtualVehicle(
        bundle.policy, simulated("ardupilot"), first.clock, FrameSession(), steps=bundle.mission.invocations
    )
    again.simulation = first.vehicle.simulation
    second = Flight(
        shipped("short"), simulated("ardupilot"), vehicle=again, resumed=True, owed=owed, settings=bits(settings)
    )

    def fails(*_: object) -> None:
        raise OSError(28, "no space left on device")

    second.preparations._record = second.preparations._note = fails
    began_us = second.clock.elapsed_us
    assert second.prepare() is None
    assert second.clock.elapsed_us == began_us, "nothing steers it until the loop begins"
    flown = second.fly()
    assert flown.ending is Ending.ABORTED
    assert again.simulation.truth().up_mm < 100
    assert owed == left


@pytest.mark.parametrize(("flavour", "fault", "ending", "says"), [
    ("px4", PilotMode(at_us=20 * S), Ending.STOOD_DOWN, 1),
    ("ardupilot", Kill(at_us=20 * S), Ending.CRASHED, 0),
], ids=["taken over", "crashed"])  # fmt: skip
def test_unconfirmed_parameters_stay_owed(flavour: str, fault: Any, ending: Ending, says: int) -> None:
    had, settings = NARROW[flavour]
    owed: dict[str, Owed] = {}
    flight = prepared(flavour, owed, faults=(fault,))
    flown = flight.fly()
    assert flown.ending is ending
    assert len(flown.effects("preparation")) == 1
    assert len(flown.effects("not-restored")) == says
    assert has(flight, tuple(had)) == settings
    assert {name: value_of(each.before) for name, each in owed.items()} == had
    assert flown.audit().report.failure is None
