"""Zones against geometry in rationals, and cases by hand on the boundary."""

from itertools import pairwise
from math import cos, pi, sin
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from reference import outlines, worlds
from reference.naive_geometry import circle_far, circle_near, in_shape, touches, widened
from rtshcua.decision.values import ABSENT, AND, FALSE, MAYBE, PRESENT, TRUE, UNKNOWN
from rtshcua.decision.zones import NOWHERE, PlaceSet, PreparedZone, Sweep
from rtshcua.model.flat.zone import CIRCLE, HIGHEST, LOWEST, MAX_COORDINATE, POLYGON, Zone
from virtual.rows import rows

T, F = TRUE, FALSE
SMALL = st.integers(-12, 12)
POINTS = st.tuples(SMALL, SMALL)
BOXES = st.tuples(st.integers(-4, 0), st.integers(-4, 0), st.integers(0, 4), st.integers(0, 4))


def polygon(*data: int, floor: int = LOWEST, ceiling: int = HIGHEST) -> Zone:
    return Zone("p", POLYGON, floor, ceiling, data)


def flat(points: list[tuple[int, int]]) -> tuple[int, ...]:
    return tuple(coordinate for point in points for coordinate in point)


#: with holes and islands, or one ring; corners often fall on one line
OUTLINES = worlds.CHANCES.map(outlines.rings).map(
    lambda rings: outlines.polygon(rings[0]) if len(rings) == 1 else outlines.area(rings)
)
STARS = st.lists(st.integers(3, 30), min_size=17, max_size=40).map(
    lambda radii: polygon(
        *flat(
            [
                (int(r * cos(2 * pi * n / len(radii))), int(r * sin(2 * pi * n / len(radii))))
                for n, r in enumerate(radii)
            ]
        )
    )
)
CIRCLES = st.builds(lambda c, r: Zone("c", CIRCLE, LOWEST, HIGHEST, (*c, r)), POINTS, st.integers(1, 200))
#: so large that a few mm of rounding do not matter
WIDE = st.integers(-9_000, 9_000)
WIDE_POINTS = st.tuples(WIDE, WIDE)
WIDE_CIRCLES = st.builds(
    lambda c, r: Zone("c", CIRCLE, LOWEST, HIGHEST, (*c, r * r)), WIDE_POINTS, st.integers(1_000, 6_000)
)


@given(OUTLINES | STARS | CIRCLES, POINTS)
def test_a_point(zone: Zone, point: tuple[int, int]) -> None:
    assert PreparedZone(0, zone).along(point, (0, 0, 0, 0)) == (T if in_shape(point, zone) else F)


@given(OUTLINES | STARS, POINTS, POINTS, BOXES)
def test_a_widened_leg_and_a_polygon(
    zone: Zone, a: tuple[int, int], b: tuple[int, int], box: tuple[int, int, int, int]
) -> None:
    expected = T | F if touches(widened(a, b, box), zone) else T if in_shape(a, zone) else F
    assert PreparedZone(0, zone).along((*a, *b), box) == expected


@given(CIRCLES, POINTS, POINTS, BOXES)
def test_a_widened_leg_and_a_small_circle(
    zone: Zone, a: tuple[int, int], b: tuple[int, int], box: tuple[int, int, int, int]
) -> None:
    check_circle(zone, a, b, box)


@given(WIDE_CIRCLES, WIDE_POINTS, WIDE_POINTS, BOXES)
def test_a_widened_leg_and_a_circle(
    zone: Zone, a: tuple[int, int], b: tuple[int, int], box: tuple[int, int, int, int]
) -> None:
    check_circle(zone, a, b, box)


METRE = 1_000


def field(chance: Random) -> Zone:
    """A zone as wide as the flown area."""
    floor, ceiling = chance.choice([(LOWEST, HIGHEST), (LOWEST, 20 * METRE), (5 * METRE, 40 * METRE)])
    if chance.random() < 0.4:
        radius = chance.randint(METRE, 70 * METRE)
        return Zone("c", CIRCLE, floor, ceiling, (*place(chance, (0, 0), 60), radius * radius))
    rings = [[(8 * METRE * x, 8 * METRE * y) for x, y in ring] for ring in outlines.rings(chance)]
    return outlines.area([tuple(ring) for ring in rings], floor, ceiling)


def place(chance: Random, near: tuple[int, int], metres: int) -> tuple[int, int]:
    x, y = near
    return x + chance.randint(-metres * METRE, metres * METRE), y + chance.randint(-metres * METRE, metres * METRE)


@pytest.mark.parametrize("seed", [pytest.param(seed, marks=() if seed < 3 else pytest.mark.soak) for seed in range(8)])
def test_zone_cache_changes_no_answer(seed: int) -> None:
    chance = Random(seed)
    for _ in range(60):
        asked = PreparedZone(0, field(chance))
        middle, height = place(chance, (0, 0), 100), chance.randint(-5 * METRE, 45 * METRE)
        for _ in range(30):
            at, reach = place(chance, middle, 9), chance.choice((0, 2 * METRE, 6 * METRE, 20 * METRE))
            path = chance.choice((at, (*at, *place(chance, at, 9)), (*at, at[0], at[1] + 2)))
            low, box = height + chance.randint(-12 * METRE, 12 * METRE), (-reach, -reach, reach, reach)
            high = low + chance.randint(0, 9 * METRE)
            exact = AND[asked.between(low, high)][asked.along(path, box)]
            assert PlaceSet(((Sweep(path, box), low, high),)).inside(asked) == exact


@rows(
    ("north", "box"),
    [
        (111 * METRE, (-10 * METRE, -10 * METRE, 10 * METRE, 10 * METRE)),
        (125 * METRE, (0, 0, 0, 40 * METRE)),
    ],
)
def test_a_short_leg_past_a_circle_stays_in_doubt(north: int, box: tuple[int, int, int, int]) -> None:
    """Its length of 2 mm counts as 3 mm, and its box as extended to all sides."""
    zone = PreparedZone(0, Zone("c", CIRCLE, LOWEST, HIGHEST, (0, 0, (60 * METRE) ** 2)))
    for _ in range(3):
        assert PlaceSet(((Sweep((-1, north, 1, north), box), 0, 0),)).inside(zone) == T | F


def test_a_zone_is_compared_once_for_places_close_by(monkeypatch: pytest.MonkeyPatch) -> None:
    zone = PreparedZone(0, polygon(0, 0, 90_000, 0, 90_000, 90_000, 0, 90_000))
    compared: list[tuple[int, ...]] = []
    along = PreparedZone.along
    monkeypatch.setattr(PreparedZone, "along", lambda *asked: compared.append(asked[1]) or along(*asked))
    for x in range(45_000, 50_000, 500):
        assert PlaceSet(((Sweep((x, 45_000), (-1, -1, 1, 1)), 0, 0),)).inside(zone) == T
    assert compared == [(45_000, 45_000)]


@rows(
    ("leg", "answer"),
    [
        ((-2_000, 1_100, 2_000, 1_100), F),  # passes at 1.1 m
        ((-2_000, 900, 2_000, 900), T | F),
        ((-2_000, -900, 2_000, -900), T | F),
        ((-900, -2_000, -900, 2_000), T | F),
        ((-2_000, 500, 200, 2_700), F),
        ((-2_000, 900, -1_100, 900), F),  # ends before
        ((-2_000, 900, -900, 100), T | F),  # ends within
        ((-500, -500, 500, 500), T),
    ],
)
def test_legs_past_a_circle_of_one_metre(leg: tuple[int, int, int, int], answer: int) -> None:
    zone = Zone("c", CIRCLE, LOWEST, HIGHEST, (7_000, -3_000, 1_000 * 1_000))
    there = (leg[0] + 7_000, leg[1] - 3_000, leg[2] + 7_000, leg[3] - 3_000)
    assert PreparedZone(0, zone).along(there, (0, 0, 0, 0)) == answer


@rows(
    ("path", "answer"),
    [
        ((5, 0), F),  # on the circle
        ((3, -4), F),
        ((3, -3), T),
        ((0, 0, 4, 2), T),
        ((0, 0, 4, 3), T | F),  # ends on it
        ((-3, 4, 0, 0), T | F),
    ],
)
def test_the_circle_itself_is_outside(path: tuple[int, ...], answer: int) -> None:
    zone = Zone("c", CIRCLE, LOWEST, HIGHEST, (0, 0, 25))
    assert PreparedZone(0, zone).along(path, (0, 0, 0, 0)) == answer


@rows("turn", [0, 1, 2, 3])
@rows(
    ("east", "reach", "answer"),
    [
        (-1_040, (0, 50), T | F),  # reaches in
        (-1_060, (0, 50), F),
        (980, (0, 50), T | F),  # reaches out
        (980, (50, 0), T),
        (-980, (50, 0), T | F),
        (949, (50, 50), T),
        (950, (50, 50), T | F),
    ],
)
def test_a_box_that_reaches_to_one_side(turn: int, east: int, reach: tuple[int, int], answer: int) -> None:
    """A circle of one metre, from west and east, and rotated to the other directions."""
    x, y, west, south, east_side, north = east, 0, -reach[0], 0, reach[1], 0
    for _ in range(turn):
        x, y, west, south, east_side, north = -y, x, -north, west, -south, east_side
    zone = Zone("c", CIRCLE, LOWEST, HIGHEST, (0, 0, 1_000 * 1_000))
    assert PreparedZone(0, zone).along((x, y), (west, south, east_side, north)) == answer


def check_circle(zone: Zone, a: tuple[int, int], b: tuple[int, int], box: tuple[int, int, int, int]) -> None:
    """Exact inside; outside, both truths are allowed nearer than 3 mm and the difference of box and disc."""
    answer = PreparedZone(0, zone).along((*a, *b), box)
    outline = widened(a, b, box)
    if circle_far(outline, zone) < zone.data[2]:
        assert answer == T
    elif circle_near(outline, zone) < zone.data[2]:
        assert answer == T | F
    else:
        reach = max(-box[0], box[2]) ** 2 + max(-box[1], box[3]) ** 2
        clear = circle_near(widened(a, b, (0, 0, 0, 0)), zone) > (zone.data[2] ** 0.5 + reach**0.5 + 4) ** 2
        assert answer in ((F,) if clear else (F, T | F))


@given(OUTLINES, st.lists(POINTS, min_size=2, max_size=6), BOXES)
def test_a_path_is_its_legs(zone: Zone, path: list[tuple[int, int]], box: tuple[int, int, int, int]) -> None:
    prepared = PreparedZone(0, zone)
    legs = [prepared.along((*a, *b), box) for a, b in pairwise(path)]
    assert prepared.along(flat(path), box) == (T | F if T | F in legs else legs[0])


SQUARE = polygon(0, 0, 10, 0, 10, 10, 0, 10, floor=5, ceiling=20)


@rows(
    ("path", "answer"),
    [
        ((5, 5), T),
        ((0, 5), F),  # on an edge
        ((10, 10), F),  # on a corner
        ((5, 0), F),
        ((11, 5), F),
        ((1, 1, 9, 9), T),
        ((5, 5, 10, 5), T | F),  # ends on the edge
        ((5, 5, 15, 5), T | F),
        ((-5, 5, 15, 5), T | F),  # through, both ends outside
        ((-5, 0, 15, 0), T | F),  # along an edge
        ((10, 10, 12, 12), T | F),  # touches a corner from outside
        ((11, 0, 11, 10), F),
        ((5, 5, 5, 5), T),  # a leg of no length
    ],
)
def test_by_hand(path: tuple[int, ...], answer: int) -> None:
    assert PreparedZone(0, SQUARE).along(path, (0, 0, 0, 0)) == answer


@rows(
    ("point", "answer"),
    [((2, 2), T), ((5, 5), F), ((4, 5), T), ((6, 5), F), ((0, 5), F), ((8, 1), T), ((9, 1), F)],
)
def test_a_slanted_edge_is_outside(point: tuple[int, int], answer: int) -> None:
    assert PreparedZone(0, polygon(0, 0, 10, 0, 0, 10)).along(point, (0, 0, 0, 0)) == answer
    mirrored = (10 - point[0], point[1])  # now it is the western edge
    assert PreparedZone(0, polygon(0, 0, 10, 0, 10, 10)).along(mirrored, (0, 0, 0, 0)) == answer


@pytest.mark.parametrize(
    ("box", "answer"),
    [((-4, -4, 4, 4), T), ((-5, -4, 4, 4), T | F), ((0, 0, 0, 5), T | F), ((0, 0, 4, 4), T)],
)
def test_a_place_in_a_box(box: tuple[int, int, int, int], answer: int) -> None:
    assert PreparedZone(0, SQUARE).along((5, 5), box) == answer


@rows(
    ("low", "high", "answer"),
    [(6, 19, T), (5, 19, T | F), (6, 20, T | F), (0, 5, F), (20, 30, F), (0, 30, T | F), (6, 6, T)],
)
def test_floor_and_ceiling_are_outside(low: int, high: int, answer: int) -> None:
    zone = PreparedZone(0, SQUARE)
    assert zone.between(low, high) == answer
    assert PlaceSet(((Sweep((5, 5), (0, 0, 0, 0)), low, high),)).inside(zone) == answer


def test_a_place_is_the_union_of_its_parts_and_of_what_is_unknown() -> None:
    zone = PreparedZone(0, SQUARE)
    inside = (Sweep((5, 5), (0, 0, 0, 0)), 6, 7)
    outside = (Sweep((15, 5), (0, 0, 0, 0)), 6, 7)
    assert PlaceSet((inside, outside)).inside(zone) == T | F
    assert PlaceSet((inside,), MAYBE).inside(zone) == T | UNKNOWN
    assert PlaceSet((inside,), PRESENT, MAYBE).inside(zone) == T | UNKNOWN
    assert NOWHERE.inside(zone) == UNKNOWN


@rows(
    ("banded", "place", "high", "answer"),
    [  # inside of the outline and of the band, out of the one, out of the other
        (True, (5, 5, 6), ABSENT, UNKNOWN),
        (True, (15, 5, 6), ABSENT, F),
        (True, (15, 5, 6), MAYBE, F),
        (False, (5, 5, 6), ABSENT, T),
        (False, (5, 5, 6), MAYBE, T),
        (False, (15, 5, 6), ABSENT, F),
    ],
)
def test_unknown_height_counts_only_if_outline_is_undecided(
    banded: bool, place: tuple[int, int, int], high: int, answer: int
) -> None:
    zone = SQUARE if banded else replace(SQUARE, floor=LOWEST, ceiling=HIGHEST)
    x, y, z = place
    part = (Sweep((x, y), (0, 0, 0, 0)), z, z)
    assert PlaceSet((part,), PRESENT, high).inside(PreparedZone(0, zone)) == answer


@rows(("height", "located", "answer"), [(6, ABSENT, UNKNOWN), (20, ABSENT, F), (20, MAYBE, F), (6, MAYBE, T | UNKNOWN)])
def test_unknown_place_counts_only_if_height_is_undecided(height: int, located: int, answer: int) -> None:
    part = (Sweep((5, 5), (0, 0, 0, 0)), height, height)
    assert PlaceSet((part,), located).inside(PreparedZone(0, SQUARE)) == answer


def test_the_largest_coordinates_stay_within_64_bits() -> None:
    """An example for the bound in the module's docstring: the extreme cross product."""
    far = MAX_COORDINATE
    zone = PreparedZone(0, polygon(-far, -far, far, -far, far, far, -far, far))
    assert zone.along((-far + 1, -far + 1, far - 1, far - 1), (0, 0, 0, 0)) == T
    assert 2 * (2 * far) * (2 * far) <= 1 << 61


@pytest.mark.unmeasured
def test_many_vertices_are_read_a_band_at_a_time() -> None:
    count, radius = 4_096, 1_000_000
    ring = [(round(radius * cos(2 * pi * n / count)), round(radius * sin(2 * pi * n / count))) for n in range(count)]
    zone = PreparedZone(0, polygon(*flat(ring)))
    assert zone.along((0, 0), (0, 0, 0, 0)) == T
    assert zone.along((0, radius - 2_000), (0, 0, 0, 0)) == T
    assert zone.along((0, radius + 1), (0, 0, 0, 0)) == F
    assert zone.along((-radius // 2, 0, radius // 2, 10), (0, 0, 0, 0)) == T
    assert zone.along((0, -2 * radius, 0, 2 * radius), (0, 0, 0, 0)) == T | F
