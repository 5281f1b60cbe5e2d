"""The stages of a return and a landing are prepared once per vehicle, and never used for another one."""

from collections.abc import Callable

import pytest

from rtshcua.adapters.vehicle import ardupilot as ardupilot
from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle import px4 as px4
from rtshcua.adapters.vehicle.ardupilot import ARDUPILOT
from rtshcua.adapters.vehicle.flavour import Stage
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.adapters.vehicle.px4 import PX4
from rtshcua.mavlink.modes import CopterMode, Px4Mode
from rtshcua.model.flat.contract import MotionKind
from rtshcua.onboard.ports import Command, Ready
from virtual.flyer import Flyer
from virtual.rows import rows

MODES = {
    (PX4.name, MotionKind.HOME): Px4Mode.RETURN,
    (PX4.name, MotionKind.LAND): Px4Mode.LAND,
    (ARDUPILOT.name, MotionKind.HOME): CopterMode.RTL,
    (ARDUPILOT.name, MotionKind.LAND): CopterMode.LAND,
}


def stages(flavour: str, kind: MotionKind, system: int) -> list[Stage]:
    made = {each.name: each for each in (PX4, ARDUPILOT)}[flavour]
    return made.stages(Command(7, "any", kind, (), (), 0, 0), ObservedVehicle(), system)


@rows("flavour, kind", MODES)
def test_return_and_landing_stages_are_cached(flavour: str, kind: MotionKind) -> None:
    for system in (1, 2, 1):
        first, last = stages(flavour, kind, system)
        expected = messages.set_mode(system, MODES[flavour, kind])
        assert first.message.to_dict() == expected.to_dict()
        assert first.modes == last.modes == {MODES[flavour, kind]}


@rows("flavour, kind", MODES)
def test_flown_stages_do_not_affect_next_manoeuvre(flavour: str, kind: MotionKind) -> None:
    flown = stages(flavour, kind, 1)
    flown.clear()
    assert len(stages(flavour, kind, 1)) == 2


def test_stages_are_made_when_vehicle_is_known(
    flyer: Callable[..., Flyer], flavour: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = {PX4.name: px4, ARDUPILOT.name: ardupilot}[flavour]
    made._coming_down.cache_clear()
    flown = flyer()
    flown.until(Ready)
    system = flown.vehicle.driver.system
    monkeypatch.setattr(messages, "set_mode", None)
    for kind in (MotionKind.HOME, MotionKind.LAND):
        assert len(stages(flavour, kind, system)) == 2
