"""The way home climbs to the vehicle's return altitude before it descends."""

from typing import Any

import msgspec
import pytest

from reference import flat_case as flat
from rtshcua.decision.prepare import prepare
from rtshcua.decision.values import MISSING, interval, point
from rtshcua.decision.volume import Planner, flown_at, near_home
from rtshcua.decision.zones import WellKnown
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.contract import Motion, MotionKind
from rtshcua.model.flat.policy import Policy, VehicleLimits
from virtual.rows import rows

M = 1_000

KNOWN = WellKnown(0, 1, 2, 3)
HOME, CLIMB = Motion(MotionKind.HOME, -1, -1), Motion(MotionKind.CLIMB, 0, -1)


def returning(metres: int) -> Policy:
    policy = flat.POLICY
    vehicle = msgspec.structs.replace(policy.vehicle, return_altitude=metres * 1_000)
    return msgspec.structs.replace(policy, vehicle=vehicle)


def vehicle(metres: int) -> VehicleLimits:
    return returning(metres).vehicle


@pytest.mark.parametrize(
    ("declared", "height", "reached"),
    [(0, 15, (0, 15)), (30, 15, (0, 30)), (30, 50, (0, 50)), (30, -2, (-2, 30)), (0, -2, (-2, -2))],
)
def test_return_climbs_to_its_altitude_from_below(declared: int, height: int, reached: tuple[int, int]) -> None:
    planner = Planner(MotionKind.HOME, (), flown_at(HOME, 0, vehicle(declared)), 0)
    slots = [point(100_000), point(0), point(height * 1_000), point(0)]
    assert planner.volume(slots, KNOWN).height[:2] == tuple(metres * 1_000 for metres in reached)


def test_other_motions_fly_where_their_step_says() -> None:
    assert flown_at(CLIMB, 20_000, vehicle(30)) == 20_000
    assert flown_at(Motion(MotionKind.HOLD, -1, -1), 20_000, vehicle(30)) is None


START, LEG, END = (60, 80), (60, 80, 0, 0), (0, 0)


@rows(
    ("declared", "near", "height", "parts"),
    [
        # a climb where it is, across no lower than 2 m below the return altitude, down at home
        (30, 0, 15, [(START, 15, 30), (LEG, 28, 30), (END, 0, 30)]),
        (30, 0, 28, [(LEG, 28, 30), (END, 0, 30)]),
        (30, 0, 29, [(LEG, 29, 30), (END, 0, 30)]),
        (30, 0, 50, [(LEG, 50, 50), (END, 0, 50)]),  # higher, it flies as high as it is
        (30, 99, 15, [(START, 15, 30), (LEG, 28, 30), (END, 0, 30)]),
        (30, 100, 15, [(LEG, 15, 30), (END, 0, 30)]),  # so near to home it may not climb
        (0, 0, 15, [(LEG, 15, 15), (END, 0, 15)]),  # the climb's height is unknown
        (1, 0, -2, [(START, -2, 1), (LEG, -1, 1), (END, -2, 1)]),
    ],
)
def test_the_parts_of_the_way_home(declared: int, near: int, height: int, parts: list[Any]) -> None:
    error = 3
    planner = Planner(MotionKind.HOME, (), flown_at(HOME, 0, vehicle(declared)), error, near * M)
    found = planner.volume([point(60 * M), point(80 * M), point(height * M), point(0)], KNOWN).place.parts
    metres = [(tuple(each // M for each in sweep.path), low // M, high // M) for sweep, low, high in found]
    assert metres == parts
    assert {sweep.box for sweep, _, _ in found} == {(-error, -error, error, error)}


def test_from_a_set_of_places_and_heights_every_way_is_covered() -> None:
    planner = Planner(MotionKind.HOME, (), 30 * M, 0, 50 * M)
    far = planner.volume([interval(60 * M, 70 * M), interval(-5 * M, 5 * M), interval(10 * M, 20 * M), MISSING], KNOWN)
    (start, *climbs), (leg, *crosses), _ = far.place.parts
    assert (start.path, start.box, climbs) == ((60 * M, -5 * M), (0, 0, 10 * M, 10 * M), [10 * M, 30 * M])
    assert (leg.box, crosses) == (start.box, [28 * M, 30 * M])
    some = planner.volume([interval(40 * M, 70 * M), point(0), interval(10 * M, 20 * M), MISSING], KNOWN)
    assert [part[1:] for part in some.place.parts] == [(10 * M, 30 * M), (0, 30 * M)]


@rows(
    ("declared", "near"),
    [(0, 10 + 50 + 3), (15, 10 + 50 + 3), (30, 10 + 50 + 3), (31, 63.334), (60, 20 + 50 + 3), (120, 40 + 50 + 3)],
)
def test_low_return_is_limited_in_distance_from_home(declared: int, near: float) -> None:
    """10 m or a third of the height, plus the position errors of home and the vehicle."""
    there = msgspec.structs.replace(vehicle(declared), home_within=50 * M, position_error=3 * M)
    assert near_home(there) == round(near * M)


def test_loading_refuses_a_return_below_ground() -> None:
    found = prepare(returning(-1))
    assert isinstance(found, Refusal)
    assert "return altitude" in found.text
