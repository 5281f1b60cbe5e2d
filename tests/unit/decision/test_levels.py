"""The volume of a path whose points have heights of their own: by hand, and against samples taken densely along it."""

from itertools import pairwise, product
from random import Random
from typing import Any

from hypothesis import given
from msgspec.structs import replace

from reference import flat_case as flat
from reference import worlds
from reference.asking import POLICY, STEP, ask, loaded, with_contract
from reference.flat_case import BATTERY, HEIGHT, INSPECT, POSITION_X, POSITION_Y, M
from reference.naive_geometry import in_shape
from rtshcua.decision.checks.mission import invocation as problems_of
from rtshcua.decision.values import ABSENT, FALSE, MAYBE, PRESENT, TRUE, point
from rtshcua.decision.volume import Planner, levels
from rtshcua.decision.zones import PlaceSet, PreparedZone, Sweep, WellKnown
from rtshcua.model.flat.contract import Facing, MotionKind
from rtshcua.model.flat.mission import ALONG, Invocation, Plan
from rtshcua.model.flat.zone import LOWEST, Zone
from rtshcua.model.outcome import Reason
from virtual.rows import rows

KNOWN = WellKnown(0, 1, 2, 3)


def levelled(*heights: int, headings: tuple[int, ...] = (), lowest: int = 5) -> tuple[Invocation, Any]:
    """The survey of the shipped mission, up to 20 m, at these heights in m; and its policy."""
    motion = replace(STEP.contract.motion, lowest=4, facing=Facing.INWARD if headings else Facing.ALONG)
    policy, contract = with_contract(
        INSPECT, motion=motion, parameters=(*STEP.contract.parameters, worlds.LOWEST_HEIGHT)
    )
    plan = replace(STEP.plan, heights=tuple(height * M for height in heights), headings=headings)
    return replace(STEP, contract=contract, arguments=(*STEP.arguments, lowest * M), plan=plan), policy


PATH = tuple(zip(flat.PATH[::2], flat.PATH[1::2], strict=True))
EACH = (20,) * len(PATH)


#: heights in m, the lowest height in m, headings, and what is wrong with them
LEVELS: list[tuple[Any, int, Any, str | None]] = [
    (EACH, 5, (), None),
    ((), 20, (), None),
    ((5, *EACH[1:]), 5, (), None),
    (EACH, 5, (ALONG, 0, *(35_999,) * (len(PATH) - 2)), None),
    (EACH[1:], 5, (), f"{len(PATH) - 1} heights; the path has {len(PATH)} points"),
    ((4, *EACH[1:]), 5, (), "height 4000 is not in 5000..20000"),
    ((21, *EACH[1:]), 5, (), "height 21000 is not in 5000..20000"),
    ((), 21, (), "lowest height 21000 is above the altitude"),
    (EACH, 5, (0,), f"1 headings; the path has {len(PATH)} points"),
    (EACH, 5, (36_000,) * len(PATH), "heading 36000 is not in -1..35999"),
    (EACH, 5, (-2,) * len(PATH), "heading -2 is not in -1..35999"),
]


@rows(("heights", "lowest", "headings", "what"), LEVELS)
def test_heights_and_headings_match_the_arguments(heights: Any, lowest: int, headings: Any, what: str | None) -> None:
    step, policy = levelled(*heights, headings=headings, lowest=lowest)
    found = next(problems_of(step, policy.policy, policy.tables.zones), None)
    assert found == (None if what is None else f"plan: {what}")


def test_a_skill_of_one_height_has_no_others() -> None:
    for fields, what in (({"heights": (20 * M,) * len(PATH)}, "one height"), ({"headings": (0,)}, "headings do not")):
        step = replace(STEP, plan=replace(STEP.plan, **fields))
        assert what in str(next(problems_of(step, POLICY.policy, POLICY.tables.zones)))


def test_the_airspace_is_checked_at_the_height_of_each_leg() -> None:
    """Only where the last point is at the altitude, its ceiling is."""
    low = 10
    step, policy = levelled(*(low,) * len(PATH))
    for ceiling, reason in ((11, Reason.ADMITTED), (10, Reason.AIRSPACE)):
        zones = (replace(flat.ZONES[flat.CITY], ceiling=ceiling * M), *flat.ZONES[1:])
        found = ask(step, values={HEIGHT: 5 * M}, policy=loaded(replace(policy.policy, zones=zones)))
        assert found.reason is reason, "the altitude of 20 m does not count"
    high, _ = levelled(*(low,) * (len(PATH) - 1), 20)
    zones = (replace(flat.ZONES[flat.CITY], ceiling=20 * M), *flat.ZONES[1:])
    found = ask(high, values={HEIGHT: 5 * M}, policy=loaded(replace(policy.policy, zones=zones)))
    assert found.reason is Reason.AIRSPACE


def test_the_way_home_is_charged_from_the_highest_point() -> None:
    box = Planner(MotionKind.COVER, (0, 0, 10 * M, 0), 20 * M, 0, heights=(20 * M, 8 * M))
    volume = box.volume([point(0), point(0), point(5 * M), point(9_000)], KNOWN)
    assert volume.height[:2] == (5 * M, 20 * M)
    assert [part[1:] for part in volume.place.parts] == [(5 * M, 20 * M), (8 * M, 20 * M)]


def test_legs_between_the_same_heights_are_one_part() -> None:
    path = tuple(part for x in range(8) for part in (x * M, 0))
    heights = tuple(height * M for height in (5, 5, 5, 9, 9, 9, 5, 5))
    parts = Planner(MotionKind.COVER, path, 9 * M, 0, heights=heights).volume([point(0)] * 4, KNOWN).place.parts
    assert [(sweep.path[::2], low // M, high // M) for sweep, low, high in parts[1:]] == [
        ((0, 1 * M, 2 * M), 5, 5), ((2 * M, 3 * M), 5, 9), ((3 * M, 4 * M, 5 * M), 9, 9), ((5 * M, 6 * M), 5, 9),
        ((6 * M, 7 * M), 5, 5),
    ]  # fmt: skip


def test_a_path_of_one_point_is_a_part_at_its_height() -> None:
    planner = Planner(MotionKind.COVER, (3 * M, 4 * M), 9 * M, 0, heights=(7 * M,))
    parts = planner.volume([point(0)] * 4, KNOWN).place.parts
    assert [(sweep.path, low // M, high // M) for sweep, low, high in parts] == [
        ((0, 0, 3 * M, 4 * M), 0, 7), ((3 * M, 4 * M), 7, 7),
    ]  # fmt: skip


def test_the_path_is_the_same_wherever_the_vehicle_is() -> None:
    """Only the leg to its first point changes, so its answers about zones are kept."""
    planner = Planner(MotionKind.COVER, (0, 0, 9 * M, 0), 9 * M, 0, heights=(5 * M, 9 * M))
    here, there = (planner.volume([point(x), point(0), point(5 * M), point(0)], KNOWN).place for x in (0, 5 * M))
    assert here.parts[0] != there.parts[0]
    assert here.parts[1:] == there.parts[1:]
    zone = PreparedZone(0, flat.ZONES[flat.CITY])
    assert here.inside(zone) == there.inside(zone) == PlaceSet(there.parts, 0, 0).inside(zone)


def drawn_zone(of: Random) -> Zone:
    zone = worlds.zone(of)
    return replace(zone, floor=of.choice([LOWEST, 0, 5 * M]), ceiling=of.choice([12 * M, 20 * M, 30 * M]))


SAMPLES = 40


@given(worlds.CHANCES)
def test_the_volume_holds_every_sample_of_the_way(of: Random) -> None:
    """Sampled on the straight lines between its points, and where it climbs before or after it crosses."""
    zone = drawn_zone(of)
    count = of.randrange(1, 6)
    path = tuple(of.randrange(-250, 250) * M for _ in range(2 * count))
    heights = tuple(of.choice([4, 6, 10, 15, 25]) * M for _ in range(count))
    start = (of.randrange(-250, 250) * M, of.randrange(-250, 250) * M, of.choice([0, 5, 12, 31]) * M)
    planner = Planner(MotionKind.COVER, path, max(heights), of.choice([0, 3 * M]), heights=heights)
    volume = planner.volume([point(value) for value in start], KNOWN)
    truth = volume.place.inside(PreparedZone(0, zone))
    low, high = volume.height[:2]
    for (x0, y0, z0), (x1, y1, z1) in pairwise((start, *Plan(0, path, 0, 0, heights).points())):
        for at in range(SAMPLES + 1):
            x, y = (x0 * (SAMPLES - at) + x1 * at) // SAMPLES, (y0 * (SAMPLES - at) + y1 * at) // SAMPLES
            for z in (z0, z1, (z0 * (SAMPLES - at) + z1 * at) // SAMPLES):
                assert low <= z <= high
                inside = in_shape((x, y), zone) and zone.floor < z < zone.ceiling
                assert truth & (TRUE if inside else FALSE)


@given(worlds.CHANCES)
def test_a_path_is_compared_once_where_all_of_it_is_on_one_side(of: Random) -> None:
    """The answer is the union of those of its legs, and the answers of thousands of legs are not kept for each zone."""
    zone = PreparedZone(0, drawn_zone(of))
    count, wide = of.randrange(1, 8), of.choice([20, 250])
    path = tuple(of.randrange(-wide, wide) * M for _ in range(2 * count))
    heights = tuple(of.choice([4, 6, 10, 15, 25]) * M for _ in range(count))
    error = of.choice([0, 3 * M])
    box = (-error, -error, error, error)
    parts = levels(path, heights, box)
    for located, gap in product((PRESENT, MAYBE, ABSENT), repeat=2):
        legs = PlaceSet(parts, located, gap, whole=Sweep(path, box))
        answer = legs.inside(zone)
        assert all(not sweep._answers for sweep, _, _ in parts)
        assert answer == PlaceSet(levels(path, heights, box), located, gap).inside(zone)


def test_an_unknown_place_or_height_is_unknown() -> None:
    step, policy = levelled(*EACH)
    for missing in (HEIGHT, POSITION_X, POSITION_Y, BATTERY):
        assert ask(step, values={missing: None}, policy=policy).reason in (Reason.SAFETY_UNKNOWN, Reason.STATE_UNKNOWN)
