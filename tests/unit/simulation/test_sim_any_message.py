"""The simulated vehicle survives any messages, with any values, in any order."""

from math import inf, nan
from random import Random
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec
from rtshcua.simulation.config import AutopilotKind, SimulationConfig
from rtshcua.simulation.face import _HANDLERS
from rtshcua.simulation.world import Simulation
from virtual.rows import rows

HEARD = [kind for kind in mavlink.mavlink_map.values() if kind.msgname in _HANDLERS]
PAYLOADS = [183, 195, 201, 203, 204, 205, 206, 530, 531, 1000, 1001, 2000, 2001]
COMMANDS = [
    *PAYLOADS,
    16,
    17,
    20,
    21,
    22,
    34,
    115,
    176,
    178,
    186,
    192,
    193,
    207,
    224,
    300,
    400,
    511,
    512,
    5001,
    5002,
    5003,
    5100,
]
NAMES = [b"FENCE_ENABLE", b"FENCE_TYPE", b"GF_ACTION", b"GF_MAX_HOR_DIST", b"RTL_ALT", b"MAV_SIGN_CFG", b"NONE"]
FLOATS = [nan, inf, -inf, 0.0, 1.0, -1.0, 3.0, 47.4, 8.5, 1e30, 21196.0, 512.0, 497.0]
BITS = {f"{sign}int{bits}_t": (sign, bits) for sign in ("u", "") for bits in (8, 16, 32, 64)}


def value(chance: Random, name: str, type_: str, length: int) -> Any:
    """Draw a value that is often a meaningful one."""
    likely = {
        "target_system": [1], "target_component": [1, 0, 100, 154], "command": COMMANDS,
        "mission_type": [0, 0, 1, 2, 3, 255],
        "seq": range(5), "count": range(5), "frame": [0, 2, 3, 6, 10, 77], "coordinate_frame": [5, 6, 77],
        "param_id": NAMES,
    }  # fmt: skip
    if name in likely:
        return chance.choice(likely[name])
    if type_ == "char":
        return chance.randbytes(length or 1)
    return [one(chance, type_) for _ in range(length)] if length else one(chance, type_)


def one(chance: Random, type_: str) -> int | float:
    if type_ not in BITS:
        return chance.choice([*FLOATS, chance.uniform(-1000, 1000)])
    sign, bits = BITS[type_]
    low, high = (0, 2**bits - 1) if sign else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    return chance.choice([low, high, 0, 1, 3, chance.randint(low, high), min(high, 473_977_400)])


def bombard(seed: int) -> Simulation:
    chance = Random(seed)
    simulation = Simulation(
        SimulationConfig(flavour=chance.choice(list(AutopilotKind)), seed=seed, camera=True, gimbal=True)
    )
    codec = Codec(255, 190)
    simulation.advance(1_500_000)
    for _ in range(60):
        kind = chance.choice(HEARD)
        lengths = dict(zip(kind.ordered_fieldnames, kind.array_lengths, strict=True))
        names = zip(kind.fieldnames, kind.fieldtypes, strict=True)
        message = kind(*(value(chance, name, type_, lengths[name]) for name, type_ in names))
        simulation.receive(codec.pack(message), simulation.now_us + chance.choice([0, 20_000, 500_000]))
    simulation.advance(simulation.now_us + 1_000_000)
    return simulation


@rows("seed", range(8))
def test_random_messages_do_not_crash_the_vehicle(seed: int) -> None:
    assert len(HEARD) == len(_HANDLERS)
    simulation = bombard(seed)
    assert simulation.damaged == 0
    assert simulation.truth().up_mm >= 0


@pytest.mark.soak
def test_many_random_messages_do_not_crash_the_vehicle() -> None:
    for seed in range(1_000):
        bombard(seed)
