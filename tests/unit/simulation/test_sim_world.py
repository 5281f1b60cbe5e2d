"""The whole simulation: equal inputs give equal outputs, and no input stops it."""

import random
from collections.abc import Callable
from time import process_time
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec
from rtshcua.model import faults
from rtshcua.model.faults import FlightMode
from rtshcua.simulation.config import HOME, AutopilotKind, SimulationConfig
from rtshcua.simulation.place import HomePosition
from rtshcua.simulation.surroundings import Wind
from rtshcua.simulation.world import Simulation
from virtual.rows import rows

S = 1_000_000


def flight(kind: AutopilotKind, seed: int, steps_us: list[int]) -> tuple[list[bytes], Any]:
    """Simulate twenty seconds in the given steps, with two commands at fixed times."""
    simulation = Simulation(
        SimulationConfig(flavour=kind, seed=seed, wind=Wind(5_000, 10, 1_000), faults=(faults.LinkLoss(4 * S, 500),))
    )
    codec, sent, frames = Codec(255, 190), 0, []
    commands = [
        (2 * S, 176, (1, 4, 0)),
        (2 * S, 400, (1, 0, 0)),
        (3 * S, 22, (0, 0, 0, 0, 0, 0, 508 - 488 * (kind != "px4"))),
    ]
    at_us, step = 0, 0
    while at_us < 20 * S:
        target = min(20 * S, at_us + steps_us[step % len(steps_us)])
        if sent < len(commands) and target >= commands[sent][0]:
            target, command, params = commands[sent]
            padded = [*params, *[0] * (7 - len(params))]
            frames += simulation.receive(
                codec.pack(mavlink.MAVLink_command_long_message(1, 1, command, 0, *padded)), target
            )
            sent += 1
        else:
            frames += simulation.advance(target)
        at_us, step = target, step + 1
    return frames, simulation.truth()


@pytest.mark.parametrize("kind", list(AutopilotKind))
def test_same_seed_gives_the_same_bytes_for_any_steps_of_time(kind: AutopilotKind) -> None:
    reference = flight(kind, 1, [S])
    assert flight(kind, 1, [S]) == reference
    assert flight(kind, 1, [20_000]) == reference
    assert flight(kind, 1, [7_001, 333, 190_000]) == reference
    assert reference[1].in_air
    if kind is AutopilotKind.PX4:
        assert flight(kind, 2, [S])[0] != reference[0]


def test_time_does_not_go_back() -> None:
    simulation = Simulation(SimulationConfig())
    simulation.advance(S)
    assert simulation.advance(S // 2) == []
    assert simulation.now_us == S


@pytest.mark.parametrize("kind", list(AutopilotKind))
def test_first_heartbeat_comes_at_once_then_each_second(pilot: Callable[..., Any], kind: AutopilotKind) -> None:
    p = pilot(kind.value)
    times = []
    for _ in range(500):
        times += [p.simulation.now_us for frame in p.wait(0.02) if frame.name == "HEARTBEAT"]
    assert times == [20_000, *range(S, 11 * S, S)]


def test_stream_rates_of_px4(pilot: Callable[..., Any]) -> None:
    p = pilot("px4").ready()
    received = p.wait(20)
    rates = {name: sum(f.name == name for f in received) / 20 for name in {f.name for f in received}}
    assert rates == {
        "HEARTBEAT": 1,
        "SYS_STATUS": 1,
        "GLOBAL_POSITION_INT": 10,
        "GPS_RAW_INT": 5,
        "ATTITUDE": 5,
        "VFR_HUD": pytest.approx(4, abs=0.2),
        "EXTENDED_SYS_STATE": 5,
        "BATTERY_STATUS": 2,
        "ESTIMATOR_STATUS": 2,
        "DISTANCE_SENSOR": 10,
        "HOME_POSITION": 0.5,
        "MISSION_CURRENT": 1,
        "SYSTEM_TIME": 1,
        "TIMESYNC": 10,
        "RADIO_STATUS": 1,
    }


def test_stream_intervals_can_be_set(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour).ready()

    def count() -> int:
        return sum(frame.name == "GLOBAL_POSITION_INT" for frame in p.wait(2))

    p.long(511, 33, 50_000)
    assert count() in (40, 41)
    p.long(511, 33, 70_000)
    assert count() in (28, 29)
    p.long(511, 33, -1)
    assert count() == 0
    p.long(511, 33, 0)
    assert count() in ((20, 21) if p.px4 else (0,))


@pytest.mark.parametrize(
    ("system", "component", "heard"), [(1, 1, True), (1, 0, True), (0, 0, True), (2, 1, False), (2, 191, False)]
)
def test_messages_for_other_systems_are_ignored(
    pilot: Callable[..., Any], flavour: str, system: int, component: int, heard: bool
) -> None:
    p = pilot(flavour).ready()
    assert p.long(512, 148, system=system, component=component) == ([0] if heard else [])


def test_arducopter_obeys_commands_for_components_that_are_not_there(pilot: Callable[..., Any], flavour: str) -> None:
    p = pilot(flavour).ready()
    assert p.long(512, 148, component=191) == ([] if p.px4 else [0])
    p.codec = Codec(1, 191)
    p.send(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_ONBOARD_CONTROLLER, 8, 0, 0, 4, 3))
    assert p.long(512, 148, component=191) == [], "it is there now"


def test_simulation_is_a_hundred_times_faster_than_real_time(pilot: Callable[..., Any]) -> None:
    p = pilot("px4")
    p.take_off(20)
    start = process_time()
    for _ in range(60 * 50):
        p.simulation.advance(p.simulation.now_us + 20_000)
    assert 60 / (process_time() - start) > 100


def test_position_is_missing_before_readiness(pilot: Callable[..., Any]) -> None:
    p = pilot("px4")
    p.wait(0.3)
    assert not {"GLOBAL_POSITION_INT", "HOME_POSITION", "WIND_COV"} & {f.name for f in p.seen}
    p.wait(0.6)
    prearm = mavlink.MAV_SYS_STATUS_PREARM_CHECK
    assert p.last("HEARTBEAT").system_status == mavlink.MAV_STATE_UNINIT
    assert all(not f.message.onboard_control_sensors_health & prearm for f in p.seen if f.name == "SYS_STATUS")
    p.wait(1.5)
    assert p.last("GPS_RAW_INT").fix_type == 3
    assert p.last("SYS_STATUS").onboard_control_sensors_health & prearm


def test_garbage_is_survived(pilot: Callable[..., Any], flavour: str) -> None:
    """After random bytes and frames with a valid checksum but random content it still answers the next command."""
    chance = random.Random(5)
    p = pilot(flavour)
    p.take_off(20)
    kinds = [m for m in mavlink.mavlink_map.items() if m[1].msgname not in {"SET_MODE", "COMMAND_LONG", "COMMAND_INT"}]
    for number in range(2_000):
        if number % 2:
            noise = chance.randbytes(chance.randrange(300))
        else:
            noise = frame_of(*chance.choice(kinds), chance.randbytes(chance.randrange(1, 256)))
        p.take(p.simulation.receive(noise, p.simulation.now_us + 2_000))
    assert p.simulation.damaged > 500
    assert p.truth.in_air
    assert p.long(512, 148) == [0]


#: commands for cameras and gimbals, which PX4 does not answer
SILENT = {203, 204, 205, 206, 521, 530, 531, 1000, 1001, 2003, 42600}


def test_commands_with_any_parameters_are_answered(pilot: Callable[..., Any], flavour: str) -> None:
    chance = random.Random(6)
    p = pilot(flavour)
    p.take_off(20)
    odd = [0.0, 1.0, -1.0, 6.0, 21196.0, 1e9, -1e30, 3e38, float("nan"), float("inf")]
    for number in range(2_000):
        command = chance.choice([*p.simulation._autopilot.flavour.commands, 16, 193, 9])
        params = [chance.choice(odd) for _ in range(7)]
        silent = p.px4 and command in SILENT
        if number % 2:
            assert p.long(command, *params) or silent
        else:
            x, y = (chance.choice([0, 2**31 - 1, -(2**31), 473_977_400]) for _ in range(2))
            assert p.int(command, chance.randrange(0, 22), params[:4], x, y, params[6]) or silent
        p.wait(0.02)


@pytest.mark.parametrize("degrees", [214.8, 21196.0, 1e9, -1e30])
def test_reposition_to_no_place_on_earth_is_survived(pilot: Callable[..., Any], flavour: str, degrees: float) -> None:
    p = pilot(flavour)
    p.take_off(20)
    p.long(511, mavlink.MAVLINK_MSG_ID_POSITION_TARGET_GLOBAL_INT, 100_000)
    p.long(192, -1.0, 1.0, 0.0, float("nan"), degrees, degrees, 20.0 + 488 * (flavour == "px4"))
    assert "POSITION_TARGET_GLOBAL_INT" in {frame.name for frame in p.wait(2)}


def frame_of(number: int, kind: Any, payload: bytes) -> bytes:
    frame = bytes([0xFD, len(payload), 0, 0, 0, 1, 1]) + number.to_bytes(3, "little") + payload
    checksum = mavlink.x25crc(frame[1:])
    checksum.accumulate(bytes([kind.crc_extra]))
    sealed: bytes = frame + checksum.crc.to_bytes(2, "little")
    return sealed


@settings(max_examples=settings().max_examples // 5)
@given(
    st.sampled_from(list(AutopilotKind)),
    st.lists(
        st.tuples(
            st.sampled_from([20, 21, 22, 400, 192, 17]),
            st.integers(-400, 400),
            st.integers(-400, 400),
            st.integers(0, 100),
        ),
        max_size=6,
    ),
    st.integers(0, 15_000),
)
def test_random_commands_keep_the_state_within_bounds(
    kind: AutopilotKind, orders: list[tuple[int, int, int, int]], wind: int
) -> None:
    simulation = Simulation(SimulationConfig(flavour=kind, wind=Wind(wind, 77, wind // 10)))
    codec = Codec(255, 190)
    simulation.advance(2 * S)
    last = simulation.truth()
    px4 = kind is AutopilotKind.PX4
    start = [(176, 0, 0, 0), (400, 0, 0, 0), (22, 0, 0, 20)]
    for command, north, east, up in [*start, *orders]:
        latitude, longitude = HOME.globe(north, east)
        altitude = up + (488 if px4 else 0)
        p1, p2 = (1, 4) if command == 176 else (-1, 1) if command == 192 else (1, 0)
        message = mavlink.MAVLink_command_int_message(
            1, 1, 6, command, 0, 0, p1, p2, 3, 0, latitude, longitude, altitude
        )
        simulation.receive(codec.pack(message), simulation.now_us)
        for _ in range(40):
            simulation.advance(simulation.now_us + S // 4)
            now = simulation.truth()
            assert now.battery <= last.battery
            assert now.up_mm >= 0
            assert now.up_mm <= 101_000
            assert now.speed_mm_s <= 16_000
            assert abs(now.climb_mm_s) <= 3_100
            assert abs(now.north_mm) < 450_000
            assert abs(now.east_mm) < 450_000
            moved = ((now.north_mm - last.north_mm) ** 2 + (now.east_mm - last.east_mm) ** 2) ** 0.5
            assert moved <= 16_000 / 4 + 10
            assert now.in_air or now.up_mm == 0
            last = now


@rows(
    "bad",
    [
        {"system": 0},
        {"battery": 10_001},
        {"hover_us": 0},
        {"cruise_mm_s": 13_000},
        {"max_speed_mm_s": 20_000},
        {"home": HomePosition(900_000_000, 0, 0)},
    ],
)
def test_impossible_configurations_are_refused(bad: dict[str, Any]) -> None:
    with pytest.raises(ValueError):
        SimulationConfig(**bad)


@given(
    st.integers(-600_000_000, 600_000_000),
    st.integers(-1_799_000_000, 1_799_000_000),
    st.floats(-3000, 3000),
    st.floats(-3000, 3000),
)
def test_places_convert_back_and_forth(latitude: int, longitude: int, north: float, east: float) -> None:
    home = HomePosition(latitude, longitude, 0)
    back = home.local(*home.globe(north, east))
    assert abs(back[0] - north) < 0.02
    assert abs(back[1] - east) < 0.02


def test_every_mode_has_a_name_and_a_base_in_both_flavours(pilot: Callable[..., Any], flavour: str) -> None:
    table = pilot(flavour).simulation._autopilot.flavour.modes
    assert all(table.name(mode) for mode in table.numbers)
    assert set(table.numbers) <= set(table.base)
    assert len(set(table.numbers.values())) == len(table.numbers)
    assert all(table.mode(number) is mode for mode, number in table.numbers.items())
    assert FlightMode.RETURN in table.numbers
