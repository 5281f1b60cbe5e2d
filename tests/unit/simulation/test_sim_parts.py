"""The parts by themselves: braking, battery, link, parameters."""

from math import hypot
from random import Random

from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.simulation.battery import Battery, flight_load
from rtshcua.simulation.config import SimulationConfig
from rtshcua.simulation.kinematics import ACCELERATION, Body, approach_speed, stopping_distance
from rtshcua.simulation.link import Link
from rtshcua.simulation.parameters import Parameters
from rtshcua.simulation.px4.parameters import PARAMETERS, handling

DT = 0.02


@given(st.floats(0, 1000))
def test_stopping_distance_is_the_inverse_of_approach_speed(distance: float) -> None:
    assert abs(stopping_distance(approach_speed(distance)) - distance) < 1e-6


@settings(max_examples=50)
@given(st.floats(-300, 300), st.floats(-300, 300), st.floats(1, 12), st.floats(-4, 4), st.floats(-4, 4))
def test_it_arrives_and_stops_without_overshoot(
    north: float, east: float, speed: float, wind_north: float, wind_east: float
) -> None:
    body = Body()
    distance = hypot(north, east)
    closest = distance
    for _ in range(round((distance / speed + 20) / DT)):
        before = (body.v_north, body.v_east)
        body.track(DT, (north, east), speed, 0.0, (wind_north, wind_east))
        assert hypot(body.v_north - before[0], body.v_east - before[1]) <= ACCELERATION * DT + 1e-9
        assert hypot(body.v_north, body.v_east) <= speed + 1e-9
        away = hypot(north - body.north, east - body.east)
        assert away <= closest + 0.05
        closest = min(closest, away)
    assert closest < 0.05
    assert hypot(body.v_north, body.v_east) < 0.05


def test_a_full_battery_hovers_as_long_as_it_says() -> None:
    battery = Battery(1.0, 18 * 60)
    seconds = 0.0
    while battery.level > 0:
        battery.drain(1.0, flight_load(0, 0))
        seconds += 1
    assert abs(seconds - 18 * 60) <= 1


@given(st.floats(0, 1), st.lists(st.tuples(st.floats(0, 60), st.floats(0, 30), st.floats(-15, 15)), max_size=20))
def test_energy_never_rises(level: float, parts: list[tuple[float, float, float]]) -> None:
    battery = Battery(level, 600)
    for dt, airspeed, climb in parts:
        before = battery.level, battery.used_mah
        battery.drain(dt, flight_load(airspeed, climb))
        assert 0 <= battery.level <= before[0]
        assert battery.used_mah >= before[1]
        assert 0 <= battery.percent <= 100


def test_link_keeps_the_order_when_the_delay_shrinks() -> None:
    link = Link(Random(1))
    link.delay_us = 1_000
    link.send(b"first", 0)
    link.delay_us = 0
    link.send(b"second", 10)
    assert link.due(999) == []
    assert link.due(1_000) == [b"first", b"second"]


def test_integer_parameters_travel_as_bytes_or_as_floats() -> None:
    for bytewise in (True, False):
        parameters = Parameters(PARAMETERS, handling(SimulationConfig()), bytewise)
        message = parameters.read("MAV_SYS_ID", -1)
        assert message.param_type == mavlink.MAV_PARAM_TYPE_INT32
        assert (message.param_value == 1.0) is not bytewise
        again = parameters.write("MAV_SYS_ID", message.param_value, message.param_type)
        assert again.param_value == message.param_value


def test_parameters_set_how_it_flies_and_echo() -> None:
    flown = handling(SimulationConfig())
    parameters = Parameters(PARAMETERS, flown, bytewise=True)
    assert parameters.write("RTL_RETURN_ALT", 45.0, mavlink.MAV_PARAM_TYPE_REAL32).param_value == 45.0
    assert flown.return_up == 45.0
    assert parameters.write("MPC_XY_CRUISE", float("nan"), 9).param_value == 5.0
    assert parameters.write("NO_SUCH_PARAM", 1.0, 9) is None
    assert parameters.read("NO_SUCH_PARAM", -1) is None
    assert parameters.read("", len(PARAMETERS)) is None
    listed = list(parameters.all())
    assert [m.param_index for m in listed] == list(range(len(PARAMETERS)))
    assert {m.param_count for m in listed} == {len(PARAMETERS)}
