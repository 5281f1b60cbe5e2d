"""Unions, differences and offsets of areas in exact fractions, compared with shapely and with counting."""

import math
from collections.abc import Callable
from itertools import pairwise

import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from rtshcua.decision.checks.zones import rings as problems
from rtshcua.ground.geometry.offset import NoSuchOffset, around_disc, inner, is_convex, outer, within_disc
from rtshcua.ground.geometry.overlay import RoundedBoundary, Windings, faces, nested, rounded_boundary, without_straight
from rtshcua.ground.geometry.polygons import (
    Point,
    Ring,
    contained,
    contains,
    crossing,
    doubled_area,
    is_beyond,
    touching_edges,
)
from rtshcua.ground.geometry.shapes import (
    MultiPolygon,
    Polygonal,
    Region,
    Shape,
    SimplePolygon,
    are_disjoint,
    edges,
    lies_within,
    parts,
    polygonal,
)

SMALL = st.tuples(st.integers(-12, 12), st.integers(-12, 12))
Rule = Callable[[Windings], bool]


def turned(corners: list[Point]) -> Ring:
    return tuple(corners if doubled_area(corners) > 0 else corners[::-1])


def simple(corners: list[Point]) -> bool:
    return crossing(corners) is None and doubled_area(corners) != 0


def star(radii: list[int], turn: int, center: Point) -> Ring:
    """Return a simple polygon around a place with one corner for each radius."""
    steps = [(r, 2 * math.pi * (k + turn / 10) / len(radii)) for k, r in enumerate(radii)]
    corners = [(center[0] + round(r * math.cos(a)), center[1] + round(r * math.sin(a))) for r, a in steps]
    assume(simple(corners))
    return turned(corners)


def stars(reach: int, spread: int) -> st.SearchStrategy[Ring]:
    places = st.tuples(st.integers(-spread, spread), st.integers(-spread, spread))
    radii = st.lists(st.integers(reach // 10, reach), min_size=3, max_size=9)
    return st.builds(star, radii, st.integers(0, 9), places)


TINY = st.lists(SMALL, min_size=3, max_size=7, unique=True).filter(simple).map(turned)
LARGE = stars(50_000, 50_000)


def geometry(shape: Polygonal) -> shapely.Geometry:
    return shapely.unary_union([shapely.Polygon(ring, holes) for ring, holes in parts(shape)])


@st.composite
def areas(draw: st.DrawFn) -> Polygonal:
    """Return two polygons minus others, with parts, bays and holes."""
    whole = [draw(LARGE), draw(LARGE)]
    gone = draw(st.lists(stars(15_000, 40_000), max_size=3))
    made = rounded_boundary(
        [whole, *([each] for each in gone)], lambda w: w[0] > 0 and not any(each > 0 for each in w[1:])
    )
    assume(made is not None and made.rings)
    assert made is not None
    return polygonal(made.rings)


RULES: list[tuple[str, Rule]] = [
    ("union", lambda w: w[0] > 0 or w[1] > 0),
    ("difference", lambda w: w[0] > 0 >= w[1]),
    ("intersection", lambda w: w[0] > 0 and w[1] > 0),
    ("symmetric_difference", lambda w: (w[0] > 0) != (w[1] > 0)),
]


@pytest.mark.parametrize(("name", "rule"), RULES)
@given(one=st.one_of(TINY, LARGE), other=st.one_of(TINY, LARGE))
def test_outlines_agree_with_shapely(name: str, rule: Rule, one: Ring, other: Ring) -> None:
    true = getattr(shapely.Polygon(one), name)(shapely.Polygon(other))
    made = rounded_boundary([[one], [other]], rule)
    assume(made is not None)  # within a few millimetres, rounding may leave no simple ring
    assert made is not None
    mine = geometry(polygonal(made.rings)) if made.rings else shapely.Polygon()
    assert mine.symmetric_difference(true).buffer(-made.moved).area < 1e-6
    well_formed(made)


def well_formed(made: RoundedBoundary) -> None:
    """Check rings with the predicates of the ground and of loading."""
    assert touching_edges(made.rings) is None
    assert nested(made.rings)
    assert not list(problems(made.rings))


@given(LARGE, LARGE)
def test_zones_of_usual_size_can_always_be_outlined(one: Ring, other: Ring) -> None:
    for _, rule in RULES:
        assert rounded_boundary([[one], [other]], rule) is not None


@given(st.lists(TINY, min_size=1, max_size=3), st.lists(SMALL, min_size=1, max_size=5))
def test_windings_of_faces_agree_with_points(rings: list[Ring], places: list[Point]) -> None:
    there = set(faces([[ring] for ring in rings]))
    for place in places:
        on_edge = any(not is_beyond(place, edge, 1) for ring in rings for edge in edges(SimplePolygon(ring)))
        if not on_edge:
            assert tuple(int(contains(ring, place)) for ring in rings) in there | {(0,) * len(rings)}


def test_squares_that_touch_at_a_corner_are_moved_apart() -> None:
    squares = [(((0, 0), (100, 0), (100, 100), (0, 100)),), (((100, 100), (200, 100), (200, 200), (100, 200)),)]
    made = rounded_boundary(squares, lambda w: max(w) > 0)
    assert made is not None
    assert made.moved <= 9
    assert len(made.rings) == 2
    well_formed(made)


def test_hole_that_touches_the_edge_is_opened() -> None:
    square, hole = ((0, 0), (100, 0), (100, 100), (0, 100)), ((0, 50), (50, 25), (50, 75))
    made = rounded_boundary([[square], [hole]], lambda w: w[0] > 0 >= w[1])
    assert made is not None
    assert len(made.rings) == 1
    well_formed(made)


def test_union_of_neighbours_has_no_seam() -> None:
    made = rounded_boundary(
        [[((0, 0), (10, 0), (10, 10), (0, 10))], [((10, 0), (20, 0), (20, 10), (10, 10))]], lambda w: max(w) > 0
    )
    assert made == RoundedBoundary((((0, 0), (20, 0), (20, 10), (0, 10)),), 1)


def test_difference_with_a_superset_is_empty() -> None:
    square = ((0, 0), (10, 0), (10, 10), (0, 10))
    made = rounded_boundary([[square], [square]], lambda w: w[0] > 0 >= w[1])
    assert made is not None
    assert not made.rings


def test_spikes_and_straight_corners_are_removed() -> None:
    kept = without_straight([(0, 0), (5, 0), (10, 0), (10, 10), (10, 20), (10, 10), (0, 10), (0, 0)])
    assert kept == [(10, 0), (10, 10), (0, 10), (0, 0)]
    assert without_straight([(0, 0), (5, 0), (9, 0)]) == []


@given(st.integers(3, 2_000_000))
def test_disc_lies_between_its_polygons(radius: int) -> None:
    small, large = within_disc((0, 0), radius), around_disc(radius)
    assert all(x * x + y * y <= radius * radius for x, y in small)
    assert all(is_beyond((0, 0), edge, radius) for edge in edges(SimplePolygon(large)))
    assert all(x * x + y * y <= (radius + radius // 500 + 10) ** 2 for x, y in large)
    if radius > 1_000:
        room = radius - radius * 31 // 100_000 - 3
        assert all(is_beyond((0, 0), edge, room) for edge in edges(SimplePolygon(small)))


@settings(max_examples=settings().max_examples // 2)
@given(areas(), st.sampled_from([20_000, 3_000, 200, -200, -1_500, -4_000]))
def test_areas_grow_and_shrink_on_the_safe_side(shape: Polygonal, margin: int) -> None:
    """When an area grows, its holes shrink and vanish and its parts merge; when it shrinks, it splits."""
    true = geometry(shape).buffer(margin, quad_segs=128)
    small, large = made(inner, shape, margin), made(outer, shape, margin)
    loose = abs(margin) * 0.004 + 20
    if isinstance(shape, SimplePolygon) and is_convex(shape):
        loose = abs(margin)  # its rounded corners have fewer segments or none
    if small is not None:
        assert geometry(small).difference(true.buffer(1 + abs(margin) * 2e-4)).area < 1
        assert geometry(shape).buffer(margin - loose).difference(geometry(small)).area < 1
    else:
        assert geometry(shape).buffer(margin - loose).area < 1
    if large is not None:
        assert true.buffer(-1).difference(geometry(large)).area < 1
        assert geometry(large).difference(geometry(shape).buffer(margin + loose, quad_segs=64)).area < 1
    else:
        assert true.buffer(-1).area < 1


def made(offset: Callable[[Shape, int], Shape], shape: Polygonal, margin: int) -> Polygonal | None:
    try:
        found = offset(shape, margin)
    except NoSuchOffset as unshapely:
        if unshapely.reason == "nothing":
            return None
        raise
    assert isinstance(found, SimplePolygon | MultiPolygon)
    well_formed(RoundedBoundary(found.rings, 0))
    return found


def ring_of(*corners: Point) -> Ring:
    return corners


YARD = MultiPolygon(
    (
        ring_of((0, 0), (60_000, 0), (60_000, 60_000), (0, 60_000)),
        ring_of((20_000, 20_000), (20_000, 40_000), (40_000, 40_000), (40_000, 20_000)),
    )
)


def test_hole_closes_when_its_area_grows() -> None:
    for offset in (inner, outer):
        assert len(rings(offset(YARD, 9_000))) == 2
        assert len(rings(offset(YARD, 11_000))) == 1
        assert len(rings(offset(YARD, -9_000))) == 2
        with pytest.raises(NoSuchOffset, match="nothing"):
            offset(YARD, -15_000)
        assert len(rings(offset(YARD, -11_000))) == 4  # its corners are farther than that from the hole


def test_area_splits_when_it_shrinks() -> None:
    bar = ((0, 0), (40_000, 0), (40_000, 18_000), (60_000, 18_000), (60_000, 0), (100_000, 0), (100_000, 40_000))
    dumbbell = SimplePolygon(
        (*bar, (60_000, 40_000), (60_000, 22_000), (40_000, 22_000), (40_000, 40_000), (0, 40_000))
    )
    assert len(rings(inner(dumbbell, -3_000))) == len(rings(outer(dumbbell, -3_000))) == 2
    assert len(rings(inner(dumbbell, -1_000))) == 1


def rings(shape: Shape) -> tuple[Ring, ...]:
    assert isinstance(shape, SimplePolygon | MultiPolygon)
    return shape.rings


@settings(max_examples=settings().max_examples // 2)
@given(areas(), st.one_of(areas(), LARGE.map(SimplePolygon)))
def test_relations_of_areas_agree_with_shapely(one: Polygonal, other: Polygonal) -> None:
    a, b = Region(one, 0, 10), Region(other, 0, 10)
    first, second = geometry(one), geometry(other)
    within, apart = lies_within(a, b), are_disjoint(a, b)
    assert within == second.covers(first) or abs(first.difference(second).area) < 1e-3
    assert apart == (first.intersection(second).area == 0) or first.intersection(second).area < 1e-3


def test_area_that_fills_a_hole_is_disjoint() -> None:
    hole = Region(SimplePolygon(YARD.rings[1][::-1]), 0, 10)
    yard = Region(YARD, 0, 10)
    assert not lies_within(hole, yard)
    assert are_disjoint(hole, yard)
    assert lies_within(yard, yard)
    assert not are_disjoint(yard, yard)
    assert not lies_within(Region(SimplePolygon(YARD.rings[0]), 0, 10), yard)


def test_bands_above_sea_share_one_elevation_error() -> None:
    square = SimplePolygon(((0, 0), (10, 0), (10, 10), (0, 10)))
    sea, home = Region(square, 0, 100, 5, 5), Region(square, 0, 100)
    assert lies_within(sea, sea)
    assert not lies_within(sea, home)
    assert not lies_within(home, sea)
    assert lies_within(home, sea, surely=False)
    above = Region(square, 103, 200, 5, 5)
    assert are_disjoint(sea, above)
    assert not are_disjoint(home, above)
    assert are_disjoint(home, above, surely=False)


@given(areas(), st.tuples(st.integers(-90_000, 90_000), st.integers(-90_000, 90_000)))
def test_point_in_an_area_is_in_an_odd_number_of_rings(shape: Polygonal, place: Point) -> None:
    assert contained(shape.rings, place) == geometry(shape).contains_properly(shapely.Point(place))
    assert all(a != b for ring in shape.rings for a, b in pairwise((*ring, ring[0])))
