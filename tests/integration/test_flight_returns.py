"""Returns from behind a tower, an exclusion zone, lead over it: the runtime's and a pilot's, by the true positions."""

from collections.abc import Callable
from math import hypot
from pathlib import Path

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec
from rtshcua.model import faults
from rtshcua.model.faults import Fault, FlightMode
from rtshcua.model.scenario import AfterStep
from rtshcua.onboard.ports import Ending
from rtshcua.virtual.flight_record import ScenarioFlown, TruthSample
from rtshcua.virtual.judge import judge
from rtshcua.virtual.zone_truth import local_mm
from virtual import case
from virtual.flight import Flight
from virtual.sampling import each_once
from virtual.scenarios import flown, scenario, when
from virtual.shipped import sealed, shipped, simulated

M = 1_000
CEILING, RADIUS = 26, 15
#: of the tower, metres north of home
NORTH = 195.7
SOURCE = f"""
import "lib:skills/takeoff.rts"
import "lib:skills/goto.rts"
import "lib:skills/hover.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"

vehicle quad {{
  identity "quad-07"  home 47.39774 N, 8.54559 E within 5 m
  speed at most 12 m/s  climb at most 3 m/s  position error 3 m
  energy 100 % = 18 min hover  reserve 15 %
  return at 28 m
  without obstacle.distance, link.quality, wind.speed, battery.voltage
}}

zone tower  = circle(47.39950 N, 8.54559 E, {RADIUS} m)  ceiling {CEILING} m above home
zone around = circle(47.39950 N, 8.54559 E, 40 m)  entry 47.39920 N, 8.54559 E

skill look(
  area: zone, altitude: altitude in 5 m .. 30 m, pattern: one of grid, perimeter, orbit, speed: speed in 1 m/s .. 8 m/s
) {{
  motion   cover area at altitude pattern pattern speed speed
  class    tactical
  deadline 5 s
  valid    for 20 min
  lasts    at most 3 min
  fallback return_home, emergency_land
  energy   at most 30 %
}}

policy towers version 1 {{
  permit  takeoff, goto, hover, look, return_home, emergency_land by any
  degrade look when battery < 40 % to return_home
  airspace outside tower
  contingency return_home, emergency_land
}}

mission flight under towers@1 on quad {{
  proposed by agent openclaw for role operator
  phase departure {{ takeoff(altitude = 15 m) }}
  phase inspection {{
    goto(around.entry, altitude = 15 m)
    look(area = around, altitude = 15 m, pattern = orbit, speed = 6 m/s)
    goto(around.entry, altitude = 15 m)
    return_home()
  }}
}}
"""


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The mission, which the checker accepts: from all around the tower the way home leads above it."""
    source = tmp_path_factory.mktemp("tower") / "tower.rts"
    source.write_text(SOURCE, encoding="utf-8")
    return sealed(Path(source))


def away(of: ScenarioFlown) -> Callable[[TruthSample], float]:
    """How far from the middle of the tower it was, on the plane, metres."""

    def metres(sample: TruthSample) -> float:
        x, y = local_mm(of.policy, sample.latitude, sample.longitude)
        return hypot(x / M, y / M - NORTH)

    return metres


WHY: dict[str, Fault] = {
    "degraded": faults.BatteryLevel(0, 3_800),
    "by the pilot": faults.PilotMode(0, FlightMode.RETURN),
}


@pytest.mark.slow
@pytest.mark.parametrize(("why", "flavour"), each_once(WHY, ["px4", "ardupilot"]))
def test_return_from_behind_a_tower_flies_over_it(bundle: bytes, flavour: str, why: str) -> None:
    found = flown(scenario(when(AfterStep(2, 29 * case.S, 29 * case.S), WHY[why])), flavour, bundle=bundle)
    homeward = [each for each in found.samples if each.mode is FlightMode.RETURN and each.in_air]
    far = away(found)
    begun = homeward[0]
    assert begun.up_mm < 17 * M
    assert local_mm(found.policy, begun.latitude, begun.longitude)[1] > (NORTH + 20) * M, "behind the tower"
    over = [each.up_mm for each in homeward if far(each) < RADIUS]
    assert over
    assert min(over) > CEILING * M
    assert [each.slug for each in judge(found).failures] == []
    last = found.samples[-1]
    assert hypot(*local_mm(found.policy, last.latitude, last.longitude)) < 3 * M, "it came home"


def test_px4_with_a_rally_point_is_refused() -> None:
    """Its return leads to the nearest of home and rally points, and no parameter tells that there are some."""
    flight = Flight(shipped("short"), simulated("px4"))
    ground, point = Codec(255, 190), (473_980_000, 85_460_000, 20)
    for message in (
        mavlink.MAVLink_mission_count_message(1, 1, 1, mavlink.MAV_MISSION_TYPE_RALLY),
        mavlink.MAVLink_mission_item_int_message(
            1, 1, 0, 6, mavlink.MAV_CMD_NAV_RALLY_POINT, 0, 1, 0, 0, 0, 0, *point, mavlink.MAV_MISSION_TYPE_RALLY
        ),
    ):
        flight.vehicle.simulation.receive(ground.pack(message), 0)
    ended = flight.fly()
    assert ended.ending is Ending.REFUSED
    assert "(it has 1 rally point)" in (flight.vehicle.driver.unready or "")
    assert not any(record.get("event") == "dispatched" for record in ended.records)
