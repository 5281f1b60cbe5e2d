"""A battery that drains much faster than declared: the true charge left at landing."""

from pathlib import Path
from typing import Any

import pytest

from rtshcua.evidence.report import LogVerdict
from rtshcua.simulation.config import OtherBattery, Purpose
from rtshcua.simulation.surroundings import Wind
from virtual import case
from virtual.flight import Flight, Flown
from virtual.shipped import sealed, simulated

SOURCE = """
import "lib:skills/takeoff.rts"
import "lib:skills/goto.rts"
import "lib:skills/hover.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"

vehicle quad {
  identity "quad-07"  home 47.39774 N, 8.54559 E within 5 m
  speed at most 12 m/s  climb at most 3 m/s  position error 3 m
  energy 100 % = 18 min hover, 16 min flight  reserve 15 %
  return at 30 m
  without obstacle.distance, link.quality, wind.speed, battery.voltage WITHOUT
}

skill wait(duration: duration in 1 s .. 2 min) {
  motion   hold for duration
  class    tactical
  deadline 5 s
  valid    for 20 min
  lasts    at most 140 s
  fallback return_home, emergency_land
  energy   at most 14 %
}

zone far = circle(47.39900 N, 8.54559 E, 40 m)  entry 47.39900 N, 8.54559 E

policy patient version 1 {
  permit  takeoff, goto, hover, wait, return_home, emergency_land by any
  contingency return_home, emergency_land
}

mission flight under patient@1 on quad {
  proposed by agent openclaw for role operator
  phase departure { takeoff(altitude = 15 m) }
  phase inspection {
    goto(far.entry, altitude = 15 m)
    wait(duration = 2 min)
    wait(duration = 2 min)
    return_home()
  }
}
"""
RESERVE = 1_500
#: 17.6 % a minute, recorded from ArduCopter's simulation, where the policy says 6.3
FAST_US = 60 * 10_000 * case.S // 1_760


def flown(folder: Path, flavour: str, without: str, hover_us: int, *, battery: int = 10_000, **fields: Any) -> Flown:
    source = folder / f"{flavour}.rts"
    source.write_text(SOURCE.replace("WITHOUT", without), encoding="utf-8")
    found = Flight(sealed(source), simulated(flavour, battery=battery, hover_us=hover_us, **fields)).fly()
    assert found.audit().report.verdict is LogVerdict.VERIFIED, "its audit derives each decision from what is recorded"
    assert not found.vehicle.simulation.truth().in_air
    return found


@pytest.mark.slow
@pytest.mark.parametrize("flavour", ["px4", pytest.param("ardupilot", marks=pytest.mark.soak)])
def test_fast_draining_battery_lands_with_its_reserve(tmp_path: Path, flavour: str) -> None:
    found = flown(tmp_path, flavour, "", FAST_US)
    assert found.vehicle.simulation.truth().battery >= RESERVE
    told = [str(each) for each in found.records if "the way home is computed with the measured value" in str(each)]
    assert told, "the log says so"
    assert any("the charge to come home" in str(each) or "way home" in str(each) for each in found.records)


@pytest.mark.soak
def test_rising_gauge_lands_with_its_reserve(tmp_path: Path) -> None:
    """Regression: its drain was never known, and it landed with half of its reserve."""
    found = flown(tmp_path, "ardupilot", "", FAST_US, gauge_rise=2)
    assert found.vehicle.simulation.truth().battery >= RESERVE


@pytest.mark.soak
def test_fast_draining_battery_without_measurement_loses_its_reserve(tmp_path: Path) -> None:
    """The same flight by what is declared alone: the vehicle without the signal, as a policy may say."""
    assert flown(tmp_path, "ardupilot", ", battery.drain", FAST_US).vehicle.simulation.truth().battery < RESERVE


@pytest.mark.slow
def test_battery_as_declared_completes_the_mission(tmp_path: Path) -> None:
    found = flown(tmp_path, "ardupilot", "", 18 * 60 * case.S)
    assert found.ending.name == "COMPLETED"
    assert not any("computed with the measured value" in str(each) for each in found.records)


def refused(of: Flown) -> Any:
    """The first decision that does not let a step fly."""
    return next(each for each in of.records if each["type"] == "decision" and each["outcome"] not in ("allow", "defer"))


@pytest.mark.slow
def test_strong_wind_is_measured_by_distance_and_returns_home(tmp_path: Path) -> None:
    """In 15 m/s it gets on at a third of its speed: a minute takes half as much again, a metre three times as much."""
    found = flown(tmp_path, "ardupilot", "", 18 * 60 * case.S, battery=6_000, wind=Wind(15_000, 0, 0))
    assert found.ending.name == "ABORTED"
    notes = [each["detail"] for each in found.records if each.get("event") == "noted"]
    assert any("of its charge for a km over ground" in each for each in notes)
    assert (refused(found)["step"], refused(found)["reason"]) == (2, "safety/energy"), "the first wait"
    minute, km = found.vehicle.driver.consumption.summary
    assert ("a minute declared" in minute, "a km declared" in km) == (True, True)


def test_empty_second_battery_prevents_the_start(tmp_path: Path) -> None:
    second = OtherBattery(Purpose.FLIGHT, 500, every_us=7 * case.S)
    found = flown(tmp_path, "px4", "", 18 * 60 * case.S, other_batteries=(second,))
    assert (found.ending.name, found.dispatched()) == ("REFUSED", [])
    assert any("0 with 99 %, 1 with 4 %" in str(each) for each in found.records)


@pytest.mark.slow
def test_low_second_battery_returns_home(tmp_path: Path) -> None:
    """Of two that feed the motors the one with less counts; it is not the one with the lower number."""
    second = OtherBattery(Purpose.FLIGHT, 4_200)
    found = flown(tmp_path, "ardupilot", "", 18 * 60 * case.S, other_batteries=(second,))
    assert found.ending.name == "ABORTED"
    assert found.vehicle.simulation.truth().battery > 9_000, "the first is as good as full"
    assert (refused(found)["step"], refused(found)["reason"]) == (2, "safety/energy")
    told, begun = (
        next(number for number, each in enumerate(found.records) if each.get("event") == event and said in str(each))
        for event, said in (("noted", "0 with 99 %, 1 with 41 %"), ("dispatched", "takeoff"))
    )
    assert told < begun, "nothing begins before it is known which of them counts"
