"""The `brakes` clause of a vehicle: what is accepted, and its lowered form."""

import pytest

from reference import sources
from reference.sources import found
from rtshcua import library
from rtshcua.app.programs import compile_sources
from virtual.rows import rows

SIGNALS = "".join(
    f"signal {name} : {type} = GLOBAL_POSITION_INT.{field}  stale after 2 s\n"
    for name, type, field in (
        ("position", "position", "lat, GLOBAL_POSITION_INT.lon"),
        ("height", "altitude", "relative_alt"),
        ("velocity.north", "speed", "vx"),
        ("velocity.east", "speed", "vy"),
        ("velocity.down", "speed", "vz"),
    )
)
BATTERY = "signal battery : ratio = BATTERY_STATUS.battery_remaining  unknown at -1  stale after 5 s\n"
BRAKES = "brakes from 12 m/s in 6 s after 500 ms"


def program(brakes: str = BRAKES, signals: str = SIGNALS + BATTERY) -> str:
    return f"""
{signals}
vehicle quad {{
  identity "quad-07"  home 47.39774 N, 8.54559 E within 50 m  speed at most 12 m/s  climb at most 3 m/s
  position error 3 m  energy 100 % = 18 min hover  reserve 15 %  {brakes}
}}
{sources.skill("down()", motion="land", fallback="")}
policy rules version 1 {{
  permit any by any
  contingency down
}}
mission flight under rules@1 on quad {{
  proposed by agent openclaw for role operator
  phase departure {{ down() }}
}}
"""


def test_braking_is_accepted() -> None:
    assert found(program()) == []
    assert found(program("")) == []


def test_braking_is_lowered_to_a_deceleration_and_slots() -> None:
    compiled, _ = compile_sources([library.root() / "missions" / "short.rts"], mission=None, issued_at_us=0)
    assert compiled.policy is not None
    vehicle = compiled.policy.vehicle
    names = {signal.slot: signal.name for signal in compiled.policy.signals}
    assert (vehicle.braking, vehicle.reaction_us) == (2_000, 500_000)
    assert [names[slot] for slot in (vehicle.north, vehicle.east, vehicle.down)] == [
        "velocity.north", "velocity.east", "velocity.down",
    ]  # fmt: skip


@rows(
    ("brakes", "code"),
    [
        ("brakes from 12 m in 6 s after 500 ms", "E0310"),
        ("brakes from 12 m/s in 6 m after 500 ms", "E0310"),
        ("brakes from 12 m/s in 6 s after 5 m", "E0310"),
        ("brakes from 0 m/s in 6 s after 500 ms", "E0319"),
        ("brakes from 12 m/s in 0 s after 500 ms", "E0319"),
        ("brakes from 12 m/s in 6 s after -1 ms", "E0319"),
        ("brakes from 12 m/s in 6 s after 61 s", "E1003"),
        ("brakes from 1 mm/s in 2 s after 0 s", "E1003"),
        ("brakes from 1000 m/s in 1 ms after 0 s", "E1003"),
        ("brakes from 12 m/s in 6 s", "E0101"),
        (f"{BRAKES} {BRAKES}", "E0106"),
    ],
)
def test_inconsistent_braking_is_refused(brakes: str, code: str) -> None:
    assert [each for each, _ in found(program(brakes))] == [code]


@pytest.mark.parametrize("name", ["velocity.north", "velocity.east", "velocity.down"])
def test_braking_vehicle_needs_velocity_signals(name: str) -> None:
    without = "".join(line for line in SIGNALS.splitlines(keepends=True) if name not in line) + BATTERY
    assert found(program(signals=without)) == [
        ("E0410", f"the policy `rules` neither declares nor imports a signal `{name}`")
    ]
    assert found(program("", without)) == []


def test_velocity_signal_of_another_type_is_refused() -> None:
    wrong = (SIGNALS + BATTERY).replace(
        "velocity.down : speed = GLOBAL_POSITION_INT.vz", "velocity.down : length = GLOBAL_POSITION_INT.alt"
    )
    assert [code for code, _ in found(program(signals=wrong))] == ["E0410"]
    assert found(program("", wrong)) == []
