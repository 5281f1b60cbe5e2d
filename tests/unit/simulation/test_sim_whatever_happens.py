"""Under any commands and faults the state stays valid: finite, above the ground, not too fast."""

from math import isfinite
from random import Random
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec
from rtshcua.model import faults
from rtshcua.model.faults import FlightMode
from rtshcua.simulation.config import AutopilotKind, Boot, SimulationConfig
from rtshcua.simulation.kinematics import MAX_FALL
from rtshcua.simulation.surroundings import Wind
from rtshcua.simulation.world import Simulation

S = 1_000_000
COMMANDS = (20, 21, 22, 22, 34, 115, 176, 176, 178, 186, 192, 193, 300, 400, 400, 400)
MODES = {
    AutopilotKind.PX4: [(4, sub) for sub in range(2, 7)] + [(3, 0), (6, 0)],
    AutopilotKind.ARDUPILOT: [(n, 0) for n in range(18)],
}


def some_fault(chance: Random, at_us: int) -> Any:
    for_us = chance.choice([None, chance.randrange(1, 30) * S])
    metres = [chance.randrange(-100_000, 100_000) for _ in range(2)]
    return chance.choice(
        [
            faults.BatteryLevel(at_us, chance.randrange(0, 10_000)),
            faults.BatteryVoltage(at_us, chance.randrange(9_000, 17_000)),
            faults.GpsLoss(at_us, for_us),
            faults.GpsJump(at_us, *metres),
            faults.GpsGlitch(at_us, *metres, for_us),
            faults.WindStep(at_us, chance.randrange(0, 25_000), chance.randrange(360), chance.randrange(0, 4_000)),
            faults.LinkDelay(at_us, chance.randrange(0, 2 * S)),
            faults.LinkLoss(at_us, chance.randrange(0, 9_000)),
            faults.Obstacle(at_us, chance.randrange(0, 50_000), for_us),
            faults.Pillar(at_us, *metres, chance.randrange(100, 5_000), chance.randrange(1_000, 60_000), for_us),
            faults.PilotMode(at_us, chance.choice(list(FlightMode))),
            faults.PilotPause(at_us),
            faults.PilotGoto(at_us, *metres, chance.randrange(0, 60_000)),
            faults.PilotSticks(at_us),
            faults.Kill(at_us),
            faults.LinkJitter(at_us, chance.randrange(1, S), for_us, chance.choice(list(faults.Direction))),
            faults.LinkReorder(at_us, chance.randrange(1, 5_000), for_us),
            faults.LinkSilence(at_us, for_us, chance.choice(list(faults.Direction)), chance.choice([True, False])),
            faults.Stall(at_us, chance.randrange(1, 8) * S, chance.randrange(3)),
            faults.Freeze(at_us, for_us),
            faults.MessageSilence(at_us, "GLOBAL_POSITION_INT", for_us),
        ]
    )


def some_command(chance: Random, config: SimulationConfig) -> Any:
    number = chance.choice(COMMANDS)
    params: list[float] = [chance.choice([0, 0, 1, 1, -1, float("nan"), chance.uniform(-500, 700)]) for _ in range(7)]
    place = config.home.globe(chance.uniform(-200, 200), chance.uniform(-200, 200))
    if number == 176:
        params[:3] = [1, *chance.choice(MODES[config.flavour])]
    elif number in (22, 186):
        params[0 if number == 186 else 6] = (
            config.home.amsl_mm / 1000 + 20 if config.flavour is AutopilotKind.PX4 else 20
        )
    elif number == 192:
        altitude = config.home.amsl_mm / 1000 + chance.uniform(-10, 80)
        return mavlink.MAVLink_command_int_message(1, 1, 5, 192, 0, 0, -1, 1, 0, 0, *place, altitude)
    elif chance.random() < 0.2:
        return mavlink.MAVLink_set_position_target_global_int_message(
            0, 1, 1, 6, 0xFF8, *place, chance.uniform(-10, 60), *[0.0] * 8
        )
    return mavlink.MAVLink_command_long_message(1, 1, number, 0, *params)


def fly(seed: int) -> None:
    chance = Random(seed)
    config = SimulationConfig(
        flavour=chance.choice(list(AutopilotKind)),
        seed=seed,
        wind=Wind(chance.randrange(0, 12_000), chance.randrange(360), chance.randrange(0, 2_000)),
        boot=chance.choice([Boot.FAST, Boot.FAST, Boot.FAST, Boot.RECORDED]),
        faults=tuple(some_fault(chance, chance.randrange(0, 90) * S) for _ in range(chance.randrange(0, 6))),
    )
    simulation, codec = Simulation(config), Codec(255, 190)
    simulation.receive(codec.pack(mavlink.MAVLink_command_long_message(1, 1, 511, 0, 33, 1e5, 0, 0, 0, 0, 0)), 0)
    body, battery = simulation._autopilot.vehicle.body, simulation.truth().battery
    for _ in range(chance.randrange(20, 90)):
        simulation.receive(codec.pack(some_command(chance, config)), simulation.now_us)
        simulation.advance(simulation.now_us + chance.randrange(S // 10, 3 * S))
        truth = simulation.truth()
        assert all(isfinite(value) for value in (body.north, body.up, body.v_north, body.a_up, body.roll, body.yaw))
        assert truth.up_mm >= 0
        assert truth.in_air or (truth.up_mm, truth.speed_mm_s, truth.climb_mm_s) == (0, 0, 0)
        assert -MAX_FALL * 1000 - 1 <= truth.climb_mm_s <= 4_000
        assert truth.speed_mm_s <= 45_000, "the strongest wind and all that it can fly"
        assert 0 <= truth.battery <= battery
        assert not (truth.crashed and truth.climb_mm_s > 100), "what crashed does not fly again"
        battery = truth.battery


@pytest.mark.parametrize("seed", range(4))
def test_invariants_hold_under_random_events(seed: int) -> None:
    fly(seed)


@pytest.mark.soak
def test_invariants_hold_under_many_random_events() -> None:
    for seed in range(4, 600):
        fly(seed)
