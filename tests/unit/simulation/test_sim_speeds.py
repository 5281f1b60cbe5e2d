"""The simulated vehicle flies at the speeds of its parameters, on which proofs of durations rest."""

from collections.abc import Callable
from typing import Any

from rtshcua.model.faults import FlightMode
from virtual.rows import rows


def ascent(made: Any) -> float:
    """Return the climb rate of a takeoff."""
    made.ready()
    if not made.px4:
        made.mode(FlightMode.GUIDED)
    made.arm()
    made.long(22, -1, 0, 0, 0, 0, 0, 40 + made.px4 * made.config.home.amsl_mm / 1_000)
    made.until(lambda: made.truth.up_mm > 10_000)
    return float(made.truth.climb_mm_s)


def home(made: Any) -> float:
    """Return the speed of a return from 60 m away, after the acceleration."""
    made.take_off(30)
    made.go_to(80, 0, 30)
    made.until(lambda: made.truth.north_mm > 79_000)
    made.wait(5)
    made.mode(FlightMode.RETURN)
    made.until(lambda: made.truth.north_mm < 40_000)
    return float(made.truth.speed_mm_s)


def gained(made: Any) -> float:
    """Return the speed 2 s after a distant target."""
    made.take_off(20)
    made.go_to(300, 0, 20)
    made.wait(2)
    return float(made.truth.speed_mm_s)


def landing(made: Any) -> float:
    """Return the descent rate at 15 m."""
    made.take_off(20)
    made.mode(FlightMode.LAND)
    made.until(lambda: made.truth.up_mm < 15_000)
    return -float(made.truth.climb_mm_s)


@rows(
    ("flavour", "parameter", "flown", "least", "most"),
    [
        ("px4", ("MPC_TKO_SPEED", 1.0), ascent, 950, 1_050),
        ("px4", ("MPC_ACC_HOR", 1.0), gained, 500, 2_000),
        ("px4", ("MPC_ACC_HOR", 3.0), gained, 2_500, 5_000),
        ("ardupilot", ("RTL_SPEED", 200.0), home, 1_900, 2_100),
        ("ardupilot", ("RTL_SPEED", 0.0), home, 4_700, 5_100),
        ("ardupilot", ("WPNAV_ACCEL", 100.0), gained, 500, 2_000),
        ("ardupilot", ("WPNAV_ACCEL", 250.0), gained, 2_500, 5_000),
        ("ardupilot", ("LAND_ALT_LOW", 2_000.0), landing, 450, 600),
        ("ardupilot", ("LAND_ALT_LOW", 500.0), landing, 1_200, 1_600),
    ],
)
def test_speed_parameters_take_effect(
    pilot: Callable[..., Any],
    flavour: str,
    parameter: tuple[str, float],
    flown: Callable[[Any], float],
    least: float,
    most: float,
) -> None:
    made = pilot(flavour, noise=False, parameters=(parameter,))
    assert least <= flown(made) <= most
