"""Every kind of vehicle fault has a visible effect."""

from collections.abc import Callable
from math import nan
from typing import Any

import pytest

from rtshcua.model import faults
from rtshcua.model.faults import Fault, FlightMode
from rtshcua.simulation.autopilot import Autopilot
from rtshcua.simulation.config import AutopilotKind, SimulationConfig
from rtshcua.simulation.fault_effects import Affected, effects
from rtshcua.simulation.fault_syntax import OF_VEHICLE
from rtshcua.simulation.world import FLAVOURS
from virtual.copying import copied

S = 1_000_000
POSITION = "GLOBAL_POSITION_INT"
#: a fault of each kind, by name
EXAMPLES: dict[str, Callable[[int], Fault]] = {
    "battery": lambda at: faults.BatteryLevel(at, 5_000),
    "battery-cell": faults.BatteryCell,
    "battery-voltage": lambda at: faults.BatteryVoltage(at, 10_200),
    "gps-loss": faults.GpsLoss,
    "gps-jump": lambda at: faults.GpsJump(at, 3_000, 0),
    "gps-drift": lambda at: faults.GpsDrift(at, 0, 500),
    "gps-glitch": lambda at: faults.GpsGlitch(at, 0, 9_000),
    "estimator": faults.EstimatorUnhealthy,
    "wind": lambda at: faults.WindStep(at, 6_000, 90),
    "link-delay": lambda at: faults.LinkDelay(at, 300_000),
    "link-jitter": lambda at: faults.LinkJitter(at, 300_000),
    "link-reorder": lambda at: faults.LinkReorder(at, 2_000),
    "link-loss": lambda at: faults.LinkLoss(at, 5_000),
    "link-silence": faults.LinkSilence,
    "link-quality": lambda at: faults.LinkQuality(at, 4_000),
    "second-voice": faults.SecondVoice,
    "obstacle": lambda at: faults.Obstacle(at, 9_000),
    "pillar": lambda at: faults.Pillar(at, 60_000, 30_000, 1_000, 60_000, None, 4_000, 270),
    "pilot": lambda at: faults.PilotMode(at, FlightMode.LOITER),
    "pilot-mode": lambda at: faults.PilotMode(at, FlightMode.LAND),
    "pilot-pause": faults.PilotPause,
    "pilot-goto": lambda at: faults.PilotGoto(at, 0, 90_000, 20_000),
    "pilot-velocity": lambda at: faults.PilotVelocity(at, -3_000, 0, 2 * S),
    "pilot-speed": lambda at: faults.PilotSpeed(at, 1_000),
    "pilot-sticks": faults.PilotSticks,
    "kill": faults.Kill,
    "reboot": faults.Reboot,
    "stall": lambda at: faults.Stall(at, 2 * S),
    "freeze": faults.Freeze,
    "stale": lambda at: faults.StaleSource(at, 500_000),
    "stuck": lambda at: faults.MessageStuck(at, POSITION),
    "mute": lambda at: faults.MessageSilence(at, POSITION),
    "camera-loss": lambda at: faults.CameraLoss(at, 10_000),
    "camera-slow": lambda at: faults.CameraSlow(at, 2 * S),
    "camera-full": faults.CameraFull,
    "camera-reboot": faults.CameraReboot,
    "gimbal-stuck": faults.GimbalStuck,
}
#: faults without effect on ArduCopter on a leg
LANDING = {"pilot-sticks"}
#: faults without effect on PX4 in Hold
STAYS = {"pilot"}
#: nor ever
NEVER = {"px4": {"pilot-velocity"}, "ardupilot": set()}


@pytest.fixture(scope="module")
def on_its_way() -> dict[str, Any]:
    return {}


def flying(pilot: Callable[..., Any], flavour: str) -> Any:
    p = pilot(flavour, camera=True, gimbal=True)
    for number in (1, 24, 30, 33, 132, 147, 193, 230):
        p.long(511, number, 100_000)
    p.take_off(20)
    p.go_to(300, 0, 20)
    p.wait(5)
    p.long(2000, 0, 1, 0, 0, component=100)
    p.long(511, 285, 200_000)
    p.long(1001, 255, 190, component=154)
    p.long(1000, nan, nan, -3, 0, component=154)  # turns down slowly
    return p


def test_every_fault_kind_has_an_example() -> None:
    assert set(EXAMPLES) == set(OF_VEHICLE)
    assert all(type(EXAMPLES[name](0)) is kind for name, kind in OF_VEHICLE.items())


@pytest.mark.slow
@pytest.mark.parametrize("name", list(EXAMPLES))
def test_every_fault_changes_the_output(
    name: str, pilot: Callable[..., Any], flavour: str, on_its_way: dict[str, Any]
) -> None:
    if flavour not in on_its_way:
        on_its_way[flavour] = flying(pilot, flavour)
    p = on_its_way[flavour]
    with_it, without = copied(p.simulation), copied(p.simulation)
    now_us = with_it.now_us
    if not p.px4 and name in LANDING:
        for each in (with_it, without):
            each.inject(faults.PilotMode(now_us, FlightMode.LAND))
    if p.px4 and name in STAYS:
        for each in (with_it, without):
            each.inject(faults.PilotMode(now_us, FlightMode.POSITION))
    with_it.inject(EXAMPLES[name](now_us + 200_000))
    for at_us in range(now_us + 100_000, now_us + 6 * S, 100_000):
        seen, expected = with_it.advance(at_us), without.advance(at_us)
        if seen != expected or with_it.truth() != without.truth():
            assert at_us > now_us + 100_000, "not before its time"
            return
    assert name in NEVER[flavour], "nothing changed"


def test_host_faults_have_no_effect_and_unknown_kinds_are_refused() -> None:
    on = Affected(Autopilot(FLAVOURS[AutopilotKind.PX4], SimulationConfig()), None, None, None, None)  # type: ignore[arg-type]
    assert not list(effects(faults.DiskFull(0), on))
    assert not list(effects(faults.Recall(0), on))
    bases = (
        Fault,
        faults.LinkFault,
        faults.ReceiverFault,
        faults.AutopilotFault,
        faults.PilotFault,
        faults.PayloadFault,
    )
    for base in bases:
        with pytest.raises(TypeError, match=base.__name__):
            list(effects(base(0), on))
