"""A manoeuvre of a pack: it passes the same gate, and never replaces a shipped one."""

from collections.abc import Callable
from typing import Any

import pytest

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.driver import Driver
from rtshcua.adapters.vehicle.flavour import Stage, Stages
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import Command, CommandFailed, Ready, Succeeded
from virtual.policy import POLICY

Make = Callable[[Stages], Any]


@pytest.fixture
def with_own(flyer: Callable[..., Any], flavour: str) -> Make:
    """A flyer whose `climb` is flown by this manoeuvre."""

    def make(own: Stages) -> Any:
        made = flyer()
        made.vehicle.driver = Driver(POLICY, made.vehicle.frames, fence=False, manoeuvres={f"{flavour}.climb": own})
        made.until(Ready)
        return made

    return make


def test_a_skill_is_flown_in_its_own_way_and_every_other_as_ever(with_own: Make) -> None:
    asked: list[str] = []

    def own(command: Command, seen: ObservedVehicle, system: int) -> list[Stage]:
        asked.append(command.skill)
        return made.vehicle.driver.flavour.stages(command, seen, system)

    made = with_own(own)
    assert isinstance(made.fly(MotionKind.CLIMB, altitude=10_000), Succeeded)
    assert isinstance(made.fly(MotionKind.LAND), Succeeded)
    assert asked == ["climb"]


def test_exception_in_pack_fails_its_skill(with_own: Make) -> None:
    def own(command: Command, seen: ObservedVehicle, system: int) -> list[Stage]:
        raise ZeroDivisionError("no nozzle")

    end = with_own(own).fly(MotionKind.CLIMB, altitude=10_000)
    assert isinstance(end, CommandFailed)
    assert (end.reason, end.text) == ("broken-manoeuvre", "no nozzle")


def test_exception_in_effect_fails_its_skill(with_own: Make) -> None:
    def done(seen: ObservedVehicle) -> bool:
        raise KeyError("tank")

    def own(command: Command, seen: ObservedVehicle, system: int) -> list[Stage]:
        return [Stage(None, None, done, frozenset())]

    end = with_own(own).fly(MotionKind.CLIMB, altitude=10_000)
    assert isinstance(end, CommandFailed)
    assert end.reason == "broken-manoeuvre"


@pytest.mark.parametrize(
    "message",
    [
        lambda system: messages.command(system, messages.ARM_DISARM, 1, 21196),
        lambda system: messages.position_target(system, 473_000_000, 85_000_000, 100.0),
        lambda system: messages.parameter_set(system, "GF_ACTION", 0.0, 6),
    ],
    ids=["forced arming", "another place", "a parameter"],
)
def test_gate_refuses_bad_frames_of_own_manoeuvres(with_own: Make, message: Any) -> None:
    def own(command: Command, seen: ObservedVehicle, system: int) -> list[Stage]:
        return [Stage(message(system), None, lambda seen: seen.airborne, frozenset())]

    made = with_own(own)
    end = made.fly(MotionKind.CLIMB, altitude=10_000)
    assert isinstance(end, CommandFailed)
    assert end.reason.startswith("frame/")
    assert not made.truth.armed
