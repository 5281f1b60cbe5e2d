"""`cover Z from A to B every D ... facing inward`: lowered, proved, and flown by both simulated flavours."""

from functools import cache
from itertools import pairwise
from math import hypot
from pathlib import Path

import pytest
from msgspec.structs import replace

from rtshcua.diagnostics import codes
from rtshcua.ground.geometry.levels import bearing, middle
from rtshcua.ground.language.load import load
from rtshcua.ground.lower.signed_paths import path_planned_otherwise
from rtshcua.ground.pipeline.program import Compiled, compile_program
from rtshcua.mavlink import dialect
from rtshcua.model.flat.contract import Facing
from rtshcua.model.flat.limits import FULL
from rtshcua.model.flat.mission import Invocation, Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.virtual.judge import judge
from virtual import case
from virtual.rows import rows
from virtual.scenarios import flown, scenario
from virtual.shipped import sealed

CHECKOUT = Path(__file__).resolve().parents[4]
SOURCE = CHECKOUT / "tests" / "accepted" / "e0519_bad_levels.rts"
M = 1_000


def compiled(*changes: tuple[str, str]) -> Compiled:
    """The orbit of the twin, changed."""
    text = SOURCE.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    program = load(
        ["/nowhere/m.rts"],
        lambda name: text.encode() if name == "/nowhere/m.rts" else Path(name).read_bytes(),
        str(CHECKOUT),
    )
    return compile_program(program, dialect.load(), mission=None, issued_at_us=case.flat.ISSUED)


@cache
def orbit() -> tuple[Policy, Mission, Invocation]:
    found = compiled()
    assert found.policy is not None, found.diagnostics
    assert found.mission is not None
    return found.policy, found.mission, found.mission.invocations[1]


def test_an_orbit_goes_around_at_each_height_facing_inward() -> None:
    plan = orbit()[2].plan
    points = [*plan.points()]
    assert dict.fromkeys(plan.heights) == dict.fromkeys((12 * M, 18 * M, 24 * M))
    assert plan.altitude == 24 * M
    assert len(points) == len(plan.headings) == 3 * 17
    ring = [(x, y) for x, y, _ in points[:17]]
    east, north = middle(ring)
    assert plan.headings == tuple(bearing(east - x, north - y) for x, y, _ in points)
    for (x0, y0, z0), (x1, y1, z1) in pairwise(points):
        assert z0 == z1 or (x0, y0) == (x1, y1), "it climbs where a round ends"


def test_an_orbit_at_one_height_faces_inward_too() -> None:
    found = compiled(
        ("from lowest to highest every step ", "at highest "), ("lowest = 12 m, ", ""), (", step = 6 m", ""),
        ("  lowest:  altitude in 5 m .. 30 m,\n", ""), ("  step:    length in 1 m .. 20 m,\n", ""),
    )  # fmt: skip
    assert found.mission is not None, found.diagnostics
    one, levelled_one = found.mission.invocations[1], orbit()[2]
    assert one.plan.heights == ()
    assert one.plan.headings == levelled_one.plan.headings[:17]
    assert one.contract.motion.lowest == -1


def test_its_motion_names_the_arguments_of_both_heights() -> None:
    motion = orbit()[2].contract.motion
    assert (motion.lowest, motion.altitude, motion.facing) == (1, 2, Facing.INWARD)


def test_the_planner_makes_the_signed_path() -> None:
    policy, _, one = orbit()
    assert path_planned_otherwise(policy, one) is None
    plan = one.plan
    for changed, levels in (
        (replace(plan, headings=(plan.headings[0] + 1, *plan.headings[1:])), True),
        (replace(plan, heights=(13 * M, *plan.heights[1:])), False),  # a fourth round
        (replace(plan, heights=(*plan.heights[:20], 24 * M, *plan.heights[21:])), True),
        (replace(plan, path=(plan.path[0] + 1, *plan.path[1:])), False),
    ):
        found = path_planned_otherwise(policy, replace(one, plan=changed))
        assert found is not None
        assert found.levels is levels


@rows(
    ("changes", "code", "words"),
    [
        ([("lowest = 12 m", "lowest = 25 m")], codes.BAD_LEVELS, "25 m, is above the highest"),
        ([("step = 6 m", "step = 1 m")], codes.BAD_LEVELS, "are 1 m apart; the least distance is 2 m"),
        ([("one of perimeter", "one of grid, perimeter")], codes.BAD_MOTION, "a `grid` does not"),
        ([(" pattern pattern", ""), ("  pattern: one of perimeter, orbit = orbit,\n", "")], codes.BAD_MOTION, "`grid`"),
        ([("every step", "every lowest")], codes.BAD_MOTION, "`lowest` is not a length"),
        ([("from lowest", "from around")], codes.BAD_MOTION, "`around` is not an altitude"),
    ],
)
def test_what_does_not_fit_is_refused(changes: list[tuple[str, str]], code: codes.Code, words: str) -> None:
    found = compiled(*changes)
    assert [each.code for each in found.diagnostics] == [code]
    assert words in found.diagnostics[0].message


def test_a_ceiling_is_checked_at_the_height_of_each_round() -> None:
    """The ceiling is a place outside: the highest round touches it."""
    fenced = ("policy rules version 1 {", "zone low = circle(47.39810 N, 8.54559 E, 300 m) ceiling 24 m above home\n\n"
              "policy rules version 1 {\n  airspace inside low")  # fmt: skip
    found = compiled(fenced)
    assert codes.PATH_OUTSIDE in {each.code for each in found.diagnostics}


def test_climbing_within_the_path_costs_time() -> None:
    """The step's bound has the way around three times, and both climbs at 1.5 m/s."""
    whole, lowest = compiled(), compiled(("highest = 24 m", "highest = 12 m"))
    assert whole.bounds is not None
    assert lowest.bounds is not None
    three, one = whole.bounds.steps[1], lowest.bounds.steps[1]
    plan = orbit()[2].plan
    round_mm = sum(hypot(x1 - x0, y1 - y0) for (x0, y0, _), (x1, y1, _) in pairwise([*plan.points()][:17]))
    assert three.time_us - one.time_us > 2 * (round_mm / (5 * M) + 6 / 1.5) * 1_000_000
    assert one.energy < three.energy <= FULL


@pytest.mark.slow
@pytest.mark.parametrize("flavour", ["px4", "ardupilot"])
def test_both_flavours_fly_it(flavour: str) -> None:
    was = flown(scenario(), flavour, bundle=sealed(SOURCE))
    assert judge(was).failures == ()
    heights = [sample.up_mm for sample in was.samples]
    for height in (12 * M, 18 * M, 24 * M):
        assert sum(abs(each - height) < 1_500 for each in heights) > len(heights) // 20
    assert max(heights) < 31 * M, "the return climbs to 30 m"
