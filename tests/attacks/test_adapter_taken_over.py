"""Threat: a compromised adapter alters commands. The boundary refuses its frames, and the flight falls back."""

from collections.abc import Callable
from typing import Any

import pytest

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle import px4 as px4
from rtshcua.adapters.vehicle.flavour import Stage
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.evidence.report import LogVerdict
from rtshcua.onboard.ports import Command, Ending
from virtual import case
from virtual.flight import Flight

Change = Callable[[Any], None]


def higher(message: Any) -> None:
    message.z += 10


def by_force(message: Any) -> None:
    message.command, message.param1, message.param2 = messages.ARM_DISARM, 0, 21_196


@pytest.mark.slow
@pytest.mark.parametrize(("change", "reason"), [(higher, "not-covered"), (by_force, "forced-arming")])
def test_altered_frames_are_blocked_and_vehicle_returns(change: Change, reason: str) -> None:
    def changed(command: Command, seen: ObservedVehicle, system: int) -> list[Stage]:
        stages = px4.stages(command, seen, system)
        for stage in stages:
            for message in (stage.message, stage.settled):
                if message is not None:
                    change(message)
        return stages

    flight = Flight(case.seal(case.mission(case.short_steps())), case.simulated("px4"))
    flight.vehicle.driver._manoeuvres = {"px4.goto": changed}
    highest = 0

    def watch(of: Flight) -> list[Any]:
        nonlocal highest
        truth = of.vehicle.simulation.truth()
        highest = max(highest, truth.up_mm)
        assert abs(truth.north_mm) < 3_000, "it stays where it went up"
        return []

    flown = flight.fly(watch)
    assert flown.ending is Ending.ABORTED
    assert flown.effects("failed")[0]["detail"].startswith(f"frame/{reason}")
    assert flown.dispatched()[:2] == ["takeoff", "goto"]
    assert "return_home" in flown.dispatched()
    assert flown.vehicle.simulation.truth().armed is False
    assert highest < 20_000, "a return climbs to 16 m, and nothing climbs higher"
    assert flown.audit().report.verdict is LogVerdict.VERIFIED
