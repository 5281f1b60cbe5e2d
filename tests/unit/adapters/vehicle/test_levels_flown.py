"""A path whose points have their own heights and headings, flown by both simulated flavours in virtual time."""

from math import cos, hypot, pi, sin

import pytest

from rtshcua.adapters.vehicle.effects import ARRIVED, FACES, LEVEL
from rtshcua.adapters.vehicle.flavour import TURNS_US
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.mission import ALONG, TURN
from rtshcua.onboard.ports import CommandFailed, Event, Succeeded
from rtshcua.simulation.vehicle import Multirotor
from rtshcua.virtual.vehicle import SECOND
from virtual.copying import copied
from virtual.flyer import Flyer, climbed

M = 1_000
CENTRE, RADIUS, SIDES = (30 * M, 20 * M), 15 * M, 8
HEIGHTS = (12 * M, 16 * M, 20 * M)


def ring() -> list[tuple[int, int, int]]:
    """The corners of a ring, with the heading to its centre."""
    corners = []
    for side in range(SIDES):
        angle = 2 * pi * side / SIDES
        x, y = CENTRE[0] + round(RADIUS * sin(angle)), CENTRE[1] + round(RADIUS * cos(angle))
        corners.append((x, y, (TURN * side // SIDES + TURN // 2) % TURN))
    return corners


def away(one: int, other: int) -> int:
    return abs((one - other + TURN // 2) % TURN - TURN // 2)


@pytest.mark.slow
@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_three_rings_facing_inward(flavour: str) -> None:
    """Where the vehicle really was, and where its nose pointed, while each point was the next one."""
    flyer = copied(climbed(flavour, 12 * M))
    points = [(x, y, height, heading) for height in HEIGHTS for x, y, heading in ring()]
    flyer.begin(
        MotionKind.COVER, *[point[:2] for point in points], altitude=20 * M, speed=4 * M,
        heights=tuple(point[2] for point in points), headings=tuple(point[3] for point in points),
    )  # fmt: skip
    reached, ends = 0, list[Event]()
    while not ends:
        ends = [event for event in flyer.wait(0.1) if isinstance(event, Succeeded | CommandFailed)]
        x, y, height, heading = points[min(reached, len(points) - 1)]
        truth = flyer.truth
        near = hypot(truth.east_mm - x, truth.north_mm - y) <= ARRIVED + M
        if (
            reached < len(points)
            and near
            and abs(truth.up_mm - height) <= LEVEL + M // 2
            and away(nose(flyer), heading) <= FACES + 500
        ):
            reached += 1
    assert isinstance(ends[0], Succeeded), ends
    assert reached == len(points), "each point was reached at its height, with its heading, in order"


def nose(flyer: Flyer) -> int:
    heading: int = flyer.truth.heading
    return heading


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_a_heading_that_is_not_taken_fails_the_step(flavour: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The acknowledgement says nothing: the nose does not turn."""
    flyer = copied(climbed(flavour, 12 * M))
    monkeypatch.setattr(Multirotor, "turn_to", lambda self, nose: None)
    began_us = flyer.now_us
    end = flyer.fly(MotionKind.COVER, (0, 12 * M), altitude=12 * M, speed=4 * M, heights=(12 * M,), headings=(18_000,))
    assert isinstance(end, CommandFailed)
    assert end.reason == "wrong-heading"
    assert TURNS_US < flyer.now_us - began_us < TURNS_US + 20 * SECOND


@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_a_heading_is_forgotten_on_a_leg_without_one(flavour: str) -> None:
    flyer = copied(climbed(flavour, 12 * M))
    end = flyer.fly(MotionKind.COVER, (0, 12 * M), (0, 40 * M), altitude=12 * M, speed=4 * M, headings=(9_000, ALONG))
    assert isinstance(end, Succeeded), end
    assert away(nose(flyer), 0) < FACES, "along the leg, to the north"
