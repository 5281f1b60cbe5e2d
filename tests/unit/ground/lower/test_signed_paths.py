"""Signed survey paths, compared with the path that the planner computes from the bundle."""

from functools import cache
from pathlib import Path

import pytest
from msgspec.structs import replace

from reference.mapping import SIDEWAYS, checked, program
from rtshcua.decision import prepare
from rtshcua.diagnostics import codes
from rtshcua.ground.language.load import load
from rtshcua.ground.lower.signed_paths import PlannedPath, other_spacing, path_planned_otherwise
from rtshcua.ground.pipeline.program import compile_program
from rtshcua.mavlink import dialect
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[4]
AREAS = {
    "round": "circle(47.3985 N, 8.5470 E, 40 m) ceiling 60 m above home",
    "square": "polygon(47.3990 N, 8.5460 E, 47.3990 N, 8.5472 E, 47.3982 N, 8.5472 E, 47.3982 N, 8.5460 E)\n"
    "  ceiling 60 m above home  entry 47.3989 N, 8.5471 E",
    "holed": "polygon(47.3990 N, 8.5456 E, 47.3990 N, 8.5466 E, 47.3982 N, 8.5466 E, 47.3982 N, 8.5456 E)\n"
    "  hole (47.3986 N, 8.5460 E, 47.3986 N, 8.5462 E, 47.3985 N, 8.5462 E, 47.3985 N, 8.5460 E)\n"
    "  ceiling 60 m above home  entry 47.3983 N, 8.5457 E",
}


def shipped(name: str) -> str:
    """Return a shipped source with enough time and energy for every survey of these tests."""
    text = Path(name).read_text(encoding="utf-8")
    return text.replace("30 min = 2 min", "30 min = 8 min").replace("= 13 %", "= 40 %")


SHIPPED = {name: shipped(str(CHECKOUT / name)) for name in
           ("skills/inspect_area.rts", "policies/bridge_inspection.rts")}  # fmt: skip
#: the shipped skill with more time and energy, since these areas are large; and one without a choice of pattern
LOOK = SHIPPED["skills/inspect_area.rts"].replace("skill inspect_area", "skill look")
SWEEP = (
    LOOK.replace("skill look", "skill sweep")
    .replace("  pattern:  one of grid, perimeter, orbit = grid,\n", "")
    .replace(" pattern pattern", "")
    .replace('import "', '// "')
)
PERMITS = "".join(
    f"permit {skill} by role operator through agent when area inside {zone}\n"
    for skill in ("look", "sweep")
    for zone in AREAS
)
CALLS = [
    *(f"look(round, altitude = 20 m, pattern = {each}, speed = 8 m/s)" for each in ("grid", "perimeter", "orbit")),
    *(f"look(square, altitude = 20 m, pattern = {each}, speed = 8 m/s)" for each in ("grid", "perimeter", "orbit")),
    "look(holed, altitude = 20 m, speed = 6 m/s)",
    "sweep(square, altitude = 20 m, speed = 8 m/s)",
    "sweep(round, altitude = 20 m)",
]


@cache
def compiled(call: str) -> tuple[Policy, Invocation]:
    rules = SHIPPED["policies/bridge_inspection.rts"].replace("permit  hover", PERMITS + "permit  hover", 1)
    zones = "".join(f"zone {name} = {area}\n" for name, area in AREAS.items())
    skill, _, rest = call.partition("(")
    mission = f"""
mission m under bridge_inspection@7 on quad {{
  proposed by agent x for role operator
  phase departure {{ takeoff(altitude = 20 m) }}
  phase inspection {{
    goto({"47.3985 N, 8.5470 E" if rest.startswith("round") else rest.split(",")[0] + ".entry"}, altitude = 20 m)
    {call}
  }}
  phase recovery {{ return_home() }}
}}
"""
    files = {"/nowhere/m.rts": "\n".join([LOOK, SWEEP, rules, zones, mission])}
    program = load(
        ["/nowhere/m.rts"],
        lambda name: (files[name] if name in files else shipped(name)).encode(),
        str(CHECKOUT),
    )
    found = compile_program(program, dialect.load(), mission=None, issued_at_us=1_700_000_000_000_000)
    assert found.policy is not None, [each.message for each in found.diagnostics]
    assert found.mission is not None, [each.message for each in found.diagnostics]
    return found.policy, next(each for each in found.mission.invocations if each.contract.name == skill)


def along(one: Invocation, *path: int) -> Invocation:
    return replace(one, plan=replace(one.plan, path=path))


@pytest.mark.slow
@rows("call", CALLS)
def test_compiled_path_matches_the_planner_in_both_directions(call: str) -> None:
    policy, one = compiled(call)
    assert path_planned_otherwise(policy, one) is None
    points = list(zip(one.plan.path[::2], one.plan.path[1::2], strict=True))
    turned = [coordinate for point in reversed(points) for coordinate in point]
    assert path_planned_otherwise(policy, along(one, *turned)) is None
    lingering = path_planned_otherwise(policy, along(one, *one.plan.path, *one.plan.path[-2:]))
    assert lingering is not None, "a point more"
    assert (lingering.points, lingering.apart) == (len(points), 0)
    moved = path_planned_otherwise(policy, along(one, one.plan.path[0] + 1, *one.plan.path[1:]))
    assert moved is not None
    assert moved.apart <= 1


def test_path_of_another_pattern_is_reported() -> None:
    policy, grid = compiled(CALLS[3])
    _, perimeter = compiled(CALLS[4])
    found = path_planned_otherwise(policy, along(grid, *perimeter.plan.path))
    assert found is not None
    assert found.points == len(grid.plan.path) // 2
    assert found.apart > 1_000
    assert found.length > 100_000


def test_signed_path_of_one_point_is_compared() -> None:
    policy, grid = compiled(CALLS[3])
    found = path_planned_otherwise(policy, along(grid, *grid.plan.path[:2]))
    assert found is not None
    assert found.apart > 10_000


@pytest.mark.parametrize("pattern", [-1, 3])
def test_any_path_differs_if_the_planner_finds_none(pattern: int) -> None:
    """The vehicle refuses values out of range. If the planner finds no path, the signer chose it."""
    policy, one = compiled(CALLS[3])
    area, altitude, _, speed = one.arguments
    none = PlannedPath(0, 0, 0)
    assert path_planned_otherwise(policy, replace(one, arguments=(area, altitude, pattern, speed))) == none
    assert path_planned_otherwise(policy, replace(one, arguments=(99, altitude, 0, speed))) == none
    small = replace(policy, vehicle=replace(policy.vehicle, position_error=1_000_000))
    assert path_planned_otherwise(small, one) == none
    zones = tuple(replace(zone, shape=0, data=(0, 0, 10**10 + 1)) for zone in policy.zones)
    assert path_planned_otherwise(replace(policy, zones=zones), one) == none, "no compiler makes such a circle"


def test_step_without_a_survey_is_not_compared() -> None:
    policy, one = compiled(CALLS[3])
    assert path_planned_otherwise(policy, replace(one, plan=replace(one.plan, kind=4, path=(0, 0)))) is None


def test_survey_with_too_many_edge_comparisons_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    """The compiler reports a mission that would be refused on board."""
    monkeypatch.setattr(prepare, "MAX_COMPARED", 3)
    program = load([str(CHECKOUT / "missions" / "standard.rts")], lambda name: Path(name).read_bytes(), str(CHECKOUT))
    found = compile_program(program, dialect.load(), mission=None, issued_at_us=0)
    (told,) = [each.message for each in found.diagnostics if each.code is codes.TOO_MANY]
    assert told.endswith("the legs of its paths would be compared with more than 3 edges of zones")


def surveyed(*changes: tuple[str, str]) -> tuple[Policy, Invocation]:
    """The policy and the survey of the program with a camera."""
    found = checked(program(*changes))
    assert found.diagnostics == (), found.diagnostics[0].message
    (planned,) = found.planned
    return planned.under.policy, planned.mission.invocations[1]


def test_grid_of_a_camera_is_the_planners_with_its_spacing() -> None:
    policy, one = surveyed()
    assert path_planned_otherwise(policy, one) is None
    told = checked(program()).pictures["flight"][0].lines_apart
    assert told is not None
    found = other_spacing(policy, one)
    assert found is not None
    assert abs(found - told) <= 2
    turned = [coordinate for at in range(len(one.plan.path) - 2, -1, -2) for coordinate in one.plan.path[at : at + 2]]
    assert other_spacing(policy, along(one, *turned)) == found
    moved = along(one, one.plan.path[0] + 30, *one.plan.path[1:])
    assert path_planned_otherwise(policy, moved) is not None
    assert other_spacing(policy, moved) is None


def test_spacing_that_the_height_gives_is_not_told() -> None:
    assert other_spacing(*compiled(CALLS[3])) is None
    assert other_spacing(*compiled(CALLS[4])) is None, "a perimeter has no lines"


def test_path_around_a_structure_is_computed_again_and_one_along_a_line_is_not() -> None:
    policy, one = surveyed(*SIDEWAYS, ("15 m", "14 m"), ("field, 50 m", "tower, 50 m, pattern = around"))
    assert path_planned_otherwise(policy, one) is None
    found = path_planned_otherwise(policy, along(one, *one.plan.path[:-2]))
    assert found is not None
    assert (found.points, found.computable) == (17, True)
    for changes in ([("field, 50 m", "road, 50 m, pattern = corridor")],
                    [*SIDEWAYS, ("15 m", "14 m"), ("field, 50", "wall, 50")]):  # fmt: skip
        policy, one = surveyed(*changes)
        assert path_planned_otherwise(policy, one) == PlannedPath(0, 0, 0, computable=False)
