"""The return height from near and far, as in rtl.cpp of PX4 1.16 and mode_rtl.cpp of ArduCopter 4.7: parameters, place
and height, and the expected return height.
"""

from collections.abc import Callable
from typing import Any

import pytest

from rtshcua.model.faults import FlightMode
from virtual.rows import rows


@pytest.mark.slow
@rows(
    ("flavour", "parameters", "away", "up", "height"),
    [
        ("px4", (), 15, 5, 30),  # further away than RTL_MIN_DIST
        ("px4", (), 8, 5, 8),  # inside the cone of 45 degrees
        ("px4", (("RTL_CONE_ANG", 80.0),), 8, 3, 4),  # no lower than 2 * NAV_ACC_RAD
        ("px4", (("RTL_CONE_ANG", 0.0),), 8, 5, 30),
        ("px4", (("RTL_MIN_DIST", 20.0),), 15, 5, 15),
        ("px4", (), 8, 12, 12),  # never below the current height
        ("px4", (), 40, 36, 36),
        ("ardupilot", (), 15, 5, 30),
        ("ardupilot", (), 8, 5, 24),  # RTL_CONE_SLOPE 3
        ("ardupilot", (("RTL_CONE_SLOPE", 1.0),), 25, 5, 25),
        ("ardupilot", (("RTL_CONE_SLOPE", 0.0),), 8, 5, 30),
        ("ardupilot", (("RTL_CONE_SLOPE", 0.3),), 8, 5, 30),  # flatter than RTL_MIN_CONE_SLOPE: ignored
        ("ardupilot", (("RTL_CLIMB_MIN", 500.0),), 8, 22, 27),
        ("ardupilot", (("RTL_CLIMB_MIN", 500.0),), 40, 36, 41),
        ("ardupilot", (), 8, 28, 28),
    ],
)
def test_return_height_follows_the_autopilots_rules(
    pilot: Callable[..., Any],
    flavour: str,
    parameters: tuple[tuple[str, float], ...],
    away: int,
    up: int,
    height: int,
) -> None:
    made = pilot(flavour, noise=False, parameters=parameters)
    made.take_off(up)
    made.go_to(away, 0, up)
    made.wait(25)
    made.mode(FlightMode.RETURN)
    highest = 0
    while made.truth.north_mm > 500 * away:
        made.wait(0.2)
        highest = max(highest, made.truth.up_mm)
    assert abs(made.truth.up_mm - 1_000 * height) < 600
    assert highest < 1_000 * height + 600
