"""An autopilot's own circle and ceiling are compared with the mission before it flies."""

import pytest

from rtshcua.onboard.ports import Ending
from rtshcua.virtual.vehicle import SECOND
from virtual.flight import Flight
from virtual.shipped import shipped, simulated

#: parameters of its owner's, and what is said of them; `one_bridge` goes some 200 m away at 20 m
NARROW = {
    "a circle": ("ardupilot", {"FENCE_RADIUS": 50.0}, "`FENCE_RADIUS`", "take 2 out of `FENCE_TYPE`, which is 7"),
    "a ceiling": ("ardupilot", {"FENCE_ALT_MAX": 15.0}, "`FENCE_ALT_MAX`", "take 1 out of `FENCE_TYPE`"),
    "a margin": ("ardupilot", {"FENCE_ALT_MAX": 31.0, "FENCE_MARGIN": 20.0}, "`FENCE_ALT_MAX`", "at least 50"),
    "a floor": ("ardupilot", {"FENCE_TYPE": 15.0, "FENCE_ALT_MIN": 40.0}, "`FENCE_ALT_MIN`", "at most"),
    "a circle of PX4's": ("px4", {"GF_MAX_HOR_DIST": 50.0}, "`GF_MAX_HOR_DIST`", "at least"),
    "a ceiling of PX4's": ("px4", {"GF_MAX_VER_DIST": 15.0}, "`GF_MAX_VER_DIST`", "at least"),
}


#: by then all parameters were read, and a vehicle that fits has taken off
SETTLED_US = 20 * SECOND


def narrow(case: str) -> Flight:
    flavour, parameters, _, _ = NARROW[case]
    return Flight(shipped("one_bridge"), simulated(flavour, parameters=tuple(parameters.items())))


def says_why(flight: Flight, case: str) -> None:
    _, _, names, helps = NARROW[case]
    unready = flight.vehicle.driver.unready
    assert unready is not None
    assert names in unready
    assert helps in unready


@pytest.mark.parametrize("case", NARROW)
def test_mission_beyond_the_own_fence_is_refused_with_a_reason(case: str) -> None:
    """Waiting changes no parameter, so the run does not wait until the mission expires."""
    flight = narrow(case)
    while (ended := flight.turn()) is None:
        assert flight.clock.elapsed_us < SETTLED_US
    assert ended is Ending.REFUSED
    says_why(flight, case)
    assert not flight.vehicle.simulation.truth().armed


def test_mission_inside_the_own_fence_takes_off() -> None:
    flight = Flight(shipped("one_bridge"), simulated("ardupilot"))
    while flight.clock.elapsed_us < SETTLED_US:
        assert flight.turn() is None
    assert flight.vehicle.simulation.truth().armed


#: for one autopilot each, which all bounds lead to alike
WHOLE = ("a circle", "a ceiling of PX4's")


@pytest.mark.parametrize(
    "case", [pytest.param(case, marks=() if case in WHOLE else pytest.mark.soak) for case in NARROW]
)
def test_refused_mission_uploads_no_fence(case: str) -> None:
    flight = narrow(case)
    flown = flight.fly()
    assert flown.ending is Ending.REFUSED
    assert flown.dispatched() == []
    says_why(flight, case)
    assert not [each for each in flown.effects("noted") if "fence was set" in each["detail"]], "nothing was uploaded"


@pytest.mark.parametrize(
    ("flavour", "parameters", "fence"),
    [
        ("ardupilot", {"FENCE_RADIUS": 20.0, "FENCE_TYPE": 4.0}, True),  # no circle is armed
        ("ardupilot", {"FENCE_RADIUS": 20.0}, False),  # no fence is
    ],
)
def test_disabled_own_fence_is_ignored(flavour: str, parameters: dict[str, float], fence: bool) -> None:
    config = simulated(flavour, parameters=tuple(parameters.items()))
    assert Flight(shipped("short"), config, fence=fence).fly().ending is Ending.COMPLETED


def test_own_fence_narrower_than_the_airspace_is_noted() -> None:
    config = simulated("ardupilot", parameters=(("FENCE_RADIUS", 60.0),))
    flown = Flight(shipped("short"), config).fly()
    assert flown.ending is Ending.COMPLETED
    noted = [each["detail"] for each in flown.effects("noted")]
    assert any("narrower than the airspace: `FENCE_RADIUS` is 60" in each for each in noted)
