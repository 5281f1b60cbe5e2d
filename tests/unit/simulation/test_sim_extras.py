"""Messages of optional equipment, which a stock vehicle does not send."""

from collections.abc import Callable
from typing import Any

import pytest

from rtshcua.model.faults import FlightMode
from rtshcua.simulation.config import EQUIPPED, STOCK, Equipment
from rtshcua.simulation.surroundings import Wind

NOT_STOCK = {"RADIO_STATUS", "DISTANCE_SENSOR", "OBSTACLE_DISTANCE", "WIND_COV"}
ASKED = (1, 132, 147, 168, 330)
"""Requests ArduCopter's streams: SYS_STATUS, DISTANCE_SENSOR, BATTERY_STATUS, WIND, OBSTACLE_DISTANCE."""


def ask(p: Any) -> Any:
    for number in ASKED:
        p.long(511, number, 200_000)
    return p


def names(p: Any) -> set[str]:
    return {frame.name for frame in p.seen}


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_stock_vehicle_sends_no_messages_of_extras(pilot: Callable[..., Any], flavour: str) -> None:
    """Apart from the voltage of the whole battery, which every vehicle measures."""
    p = pilot(flavour, extras=STOCK, wind=Wind(5_000, 270))
    p.take_off(5)
    ask(p).wait(2)
    assert not NOT_STOCK & names(p)
    assert 14_000 < p.last("SYS_STATUS").voltage_battery < 16_800  # four cells
    assert 14_000 < p.last("BATTERY_STATUS").voltages[0] < 16_800
    assert p.last("BATTERY_STATUS").battery_remaining > 90
    if flavour == "ardupilot":
        assert {(f.message.speed, f.message.direction) for f in p.seen if f.name == "WIND"} == {(0, -180)}


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_wind_is_estimated_in_the_air_only(pilot: Callable[..., Any], flavour: str) -> None:
    """As observed: PX4 sends no WIND_COV on the ground, ArduCopter repeats the last estimate of the flight."""
    p = pilot(flavour, wind=Wind(5_000, 270))
    ask(p.ready()).wait(1)
    name = "WIND_COV" if p.px4 else "WIND"
    before = {(f.message.speed, f.message.direction) for f in p.seen if f.name == "WIND"}
    assert before == (set() if p.px4 else {(0, -180)})
    assert p.px4 != (name in names(p))
    p.take_off(5)
    p.wait(1)
    told = p.last(name)
    speed = (told.wind_x**2 + told.wind_y**2) ** 0.5 if p.px4 else told.speed
    assert speed == pytest.approx(5, abs=0.1)
    assert len({str(f.message) for f in p.seen if f.name == name}) > 4, "no estimate is twice the same"
    p.mode(FlightMode.LAND)
    p.until(lambda: not p.truth.in_air)
    p.wait(1)
    p.seen.clear()
    p.wait(5)
    after = {str(f.message) for f in p.seen if f.name == name}
    assert len(after) == (0 if p.px4 else 1)


def test_two_range_finders_report_in_turn(pilot: Callable[..., Any]) -> None:
    p = pilot("px4", extras=EQUIPPED | {Equipment.ALTIMETER})
    p.take_off(5)
    p.seen.clear()
    p.wait(2)
    told = {(f.message.orientation, f.message.current_distance // 100) for f in p.seen if f.name == "DISTANCE_SENSOR"}
    assert {orientation for orientation, _ in told} == {0, 25}
    assert {distance for orientation, distance in told if orientation == 0} == {40}
    assert all(3 <= distance <= 6 for orientation, distance in told if orientation == 25)


def test_downward_range_finder_works_alone(pilot: Callable[..., Any]) -> None:
    p = pilot("px4", extras=frozenset({Equipment.ALTIMETER})).ready()
    assert {f.message.orientation for f in p.seen if f.name == "DISTANCE_SENSOR"} == {25}
