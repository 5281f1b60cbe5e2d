"""The way home goes up to the height that the vehicle returns at, before it comes down."""

import msgspec
import pytest

from reference import flat_case as flat
from rtshcua.decision.prepare import prepare
from rtshcua.decision.values import point
from rtshcua.decision.volume import Planner, flown_at
from rtshcua.decision.zones import WellKnown
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.contract import Motion, MotionKind
from rtshcua.model.flat.policy import Policy, Vehicle

KNOWN = WellKnown(0, 1, 2, 3)
HOME, CLIMB = Motion(MotionKind.HOME, -1, -1), Motion(MotionKind.CLIMB, 0, -1)


def returning(metres: int) -> Policy:
    policy = flat.POLICY
    vehicle = msgspec.structs.replace(policy.vehicle, return_altitude=metres * 1_000)
    return msgspec.structs.replace(policy, vehicle=vehicle)


def vehicle(metres: int) -> Vehicle:
    return returning(metres).vehicle


@pytest.mark.parametrize(
    ("declared", "height", "reached"),
    [(0, 15, (0, 15)), (30, 15, (0, 30)), (30, 50, (0, 50)), (30, -2, (-2, 30)), (0, -2, (-2, -2))],
)
def test_a_return_climbs_to_its_altitude_if_it_is_lower(declared: int, height: int, reached: tuple[int, int]) -> None:
    planner = Planner(MotionKind.HOME, (), flown_at(HOME, 0, vehicle(declared)), 0)
    slots = [point(100_000), point(0), point(height * 1_000), point(0)]
    assert planner.volume(slots, KNOWN).height[:2] == tuple(metres * 1_000 for metres in reached)


def test_other_motions_fly_where_their_step_says() -> None:
    assert flown_at(CLIMB, 20_000, vehicle(30)) == 20_000
    assert flown_at(Motion(MotionKind.HOLD, -1, -1), 20_000, vehicle(30)) is None


def test_the_leg_home_is_flown_at_that_altitude() -> None:
    planner = Planner(MotionKind.HOME, (), flown_at(HOME, 0, vehicle(30)), 0)
    (_, low, high), _ = planner.volume([point(100_000), point(0), point(15_000), point(0)], KNOWN).place.parts
    assert (low, high) == (15_000, 30_000)


def test_loading_refuses_a_return_below_ground() -> None:
    found = prepare(returning(-1))
    assert isinstance(found, Refusal)
    assert "return altitude" in found.text
