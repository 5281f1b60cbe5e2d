"""Single parts: braking, battery, link, parameters."""

from dataclasses import replace
from math import degrees, hypot, tan
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.simulation.battery import Battery, flight_load
from rtshcua.simulation.config import AutopilotKind
from rtshcua.simulation.guidance import towards
from rtshcua.simulation.kinematics import GRAVITY, JERK, MAX_AIRSPEED, MAX_LEAN, Approach, Body
from rtshcua.simulation.link import FaultyLink
from rtshcua.simulation.parameters import Parameters
from rtshcua.simulation.px4.parameters import HANDLING, PARAMETERS
from rtshcua.simulation.world import FLAVOURS

DT = 0.02


@given(st.floats(0, 1000), st.floats(0.1, 5), st.floats(0.2, 3))
def test_stopping_distance_is_the_inverse_of_stopping_speed(distance: float, braking: float, gain: float) -> None:
    approach = Approach(braking, gain)
    assert abs(approach.distance(approach.speed(distance)) - distance) < 1e-6


@settings(max_examples=settings().max_examples * 2 // 5)
@given(
    st.sampled_from(list(AutopilotKind)),
    *[st.floats(-300, 300)] * 2,
    st.floats(1, 12),
    *[st.floats(-4, 4)] * 2,
)
def test_body_stops_at_its_target(
    flavour: AutopilotKind, north: float, east: float, speed: float, wind_north: float, wind_east: float
) -> None:
    agility = FLAVOURS[flavour].handling.agility
    body, wind = Body(), (wind_north, wind_east)
    closest = distance = hypot(north, east)
    for _ in range(round((distance / speed + 30) / DT)):
        before = (body.v_north, body.v_east, body.lean_north, body.lean_east)
        want = towards(body, north, east, speed, agility.approach)
        body.track(DT, want, agility.acceleration, 0.0, 1.0, wind)
        assert hypot(body.lean_north - before[2], body.lean_east - before[3]) <= JERK * DT + 1e-9
        assert hypot(body.lean_north, body.lean_east) <= GRAVITY * tan(MAX_LEAN) + 1e-9
        assert hypot(body.v_north, body.v_east) <= speed + 1.0, "a gust that it has not yet learnt"
        away = hypot(north - body.north, east - body.east)
        assert away <= closest + 0.8
        closest = min(closest, away)
    assert away < 0.1
    assert hypot(body.v_north, body.v_east) < 0.05


def test_body_drifts_in_too_strong_wind() -> None:
    body = Body()
    for _ in range(round(60 / DT)):
        body.track(DT, towards(body, 0.0, 0.0, 10.0, Approach(2.0, 1.0)), 3.0, 0.0, 1.0, (0.0, MAX_AIRSPEED + 3))
    assert abs(degrees(body.roll) + 35) < 1
    assert 2 < body.v_east < 4


def test_body_without_position_drifts_with_the_air() -> None:
    body = Body(v_north=5.0)
    for _ in range(round(60 / DT)):
        body.drift(DT, -0.5, 1.0, (-4.0, 3.0))
    assert hypot(body.v_north + 4, body.v_east - 3) < 0.5
    assert abs(body.v_up + 0.5) < 0.01


@pytest.mark.parametrize(
    ("dear", "cheap"),
    [
        ((0, 2, 1), (0, 0, 1)),
        ((15, 0, 1), (5, 0, 1)),
        ((0, 0, 1.3), (0, 0, 1)),
        ((0, 0, 1), (0, -2, 1)),
        ((0, 0, 1), (6, 0, 1)),
    ],
)
def test_flight_load_depends_on_speed_climb_and_thrust(dear: tuple[float, ...], cheap: tuple[float, ...]) -> None:
    assert flight_load(*dear) > flight_load(*cheap) >= 0.3


def test_voltage_falls_with_the_level_and_sags_under_load() -> None:
    battery = Battery(1.0, 1000)
    resting = []
    while battery.level > 0:
        battery.load = 0.0
        resting.append(battery.millivolts)
        battery.load = 2.0
        assert resting[-1] - battery.millivolts == 600
        battery.drain(100, 1.0)
    assert resting == sorted(resting, reverse=True)
    assert (resting[0], resting[-1]) == (16_800, 12_800)
    battery.forced_mv = 10_200
    assert battery.millivolts == 10_200


def test_full_battery_hovers_for_its_hover_time() -> None:
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
    link = FaultyLink(Random(1))
    link.delay_us = 1_000
    link.send([b"first"], 0)
    link.delay_us = 0
    link.send([b"second"], 10)
    assert link.due(999) == []
    assert link.due(1_000) == [b"first", b"second"]


def test_integer_parameters_are_encoded_by_flavour() -> None:
    for bytewise in (True, False):
        parameters = Parameters(PARAMETERS, replace(HANDLING), bytewise)
        message = parameters.read("MAV_SYS_ID", -1)
        assert message.param_type == mavlink.MAV_PARAM_TYPE_INT32
        assert (message.param_value == 1.0) is not bytewise
        again = parameters.write("MAV_SYS_ID", message.param_value, message.param_type)
        assert again.param_value == message.param_value


def test_parameters_change_handling_and_are_echoed() -> None:
    flown = replace(HANDLING)
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
