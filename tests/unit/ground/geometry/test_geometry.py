"""Plane geometry in integers, compared with naive and floating-point oracles."""

import math
from collections.abc import Callable
from itertools import pairwise

import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from rtshcua.ground.geometry.offset import NoSuchOffset, inner, outer
from rtshcua.ground.geometry.overlay import nested
from rtshcua.ground.geometry.polygons import (
    Point,
    are_apart,
    contains,
    counter_clockwise,
    crossing,
    doubled_area,
    is_beyond,
    is_near,
    meet,
    touching_edges,
)
from rtshcua.ground.geometry.projection import projection_at
from rtshcua.ground.geometry.shapes import (
    MultiPolygon,
    Region,
    RoundArea,
    Shape,
    SimplePolygon,
    are_disjoint,
    edges,
    lies_within,
    parts,
)
from rtshcua.ground.geometry.shapes import contains as contains_area
from rtshcua.ground.geometry.survey import LEAST_INSET, survey
from rtshcua.model.flat.zone import SHIFT

POINTS = st.tuples(st.integers(-30, 30), st.integers(-30, 30))
RAW = st.lists(POINTS, min_size=3, max_size=8, unique=True)


def star(radii: list[int], turn: int) -> SimplePolygon:
    """Return a simple polygon around the origin with one corner for each radius."""
    corners = [
        (
            round(r * math.cos(2 * math.pi * (k + turn / 10) / len(radii))),
            round(r * math.sin(2 * math.pi * (k + turn / 10) / len(radii))),
        )
        for k, r in enumerate(radii)
    ]
    assume(crossing(corners) is None and doubled_area(corners) != 0)
    return SimplePolygon(tuple(counter_clockwise(corners)))


STARS = st.builds(star, st.lists(st.integers(5_000, 60_000), min_size=3, max_size=9), st.integers(0, 9))


def polygon(shape: Shape) -> shapely.Geometry:
    """Return the region for shapely, with a fine polygon for a disc."""
    if isinstance(shape, RoundArea):
        return shapely.Point(shape.center).buffer(shape.radius, quad_segs=64)
    return shapely.unary_union([shapely.Polygon(ring, holes) for ring, holes in parts(shape)])


@pytest.mark.parametrize(
    ("latitude", "longitude"), [(473977400, 85455900), (0, 0), (-338688000, 1512093000), (850000000, 0)]
)
def test_projection_agrees_with_the_ellipsoid_in_floats(latitude: int, longitude: int) -> None:
    made = projection_at(latitude, longitude)
    a, f = 6_378_137_000.0, 1 / 298.257223563
    e2, phi = f * (2 - f), math.radians(latitude / 1e7)
    bend = 1 - e2 * math.sin(phi) ** 2
    step = math.radians(1e-7) * (1 << SHIFT)
    assert made.north == pytest.approx(a * (1 - e2) / bend**1.5 * step, abs=1)
    assert made.east == pytest.approx(a / math.sqrt(bend) * math.cos(phi) * step, abs=1)


@given(RAW)
def test_simple_polygon_test_agrees_with_shapely(corners: list[Point]) -> None:
    count = len(corners)
    lines = [(corners[i], corners[(i + 1) % count]) for i in range(count)]
    naive = all(
        not meet(*lines[i], *lines[j]) for i in range(count) for j in range(i) if (i - j) % count not in (1, count - 1)
    )
    assert (crossing(corners) is None) == (naive and shapely.Polygon(corners).is_valid)


@given(RAW, POINTS)
def test_points_on_the_edge_are_outside(corners: list[Point], point: Point) -> None:
    assume(crossing(corners) is None)
    assert contains(corners, point) == shapely.Polygon(corners).contains_properly(shapely.Point(point))


@given(POINTS, POINTS, POINTS, POINTS, st.integers(1, 40))
def test_distances_compare_exactly(a: Point, b: Point, c: Point, d: Point, limit: int) -> None:
    assume(a != b and c != d)
    distance = shapely.LineString([a, b]).distance(shapely.LineString([c, d]))
    assume(abs(distance - limit) > 1e-9)
    assert are_apart((a, b), (c, d), limit) == (distance > limit)
    reach = shapely.LineString([a, b]).distance(shapely.Point(c))
    assume(abs(reach - limit) > 1e-9)
    assert is_near(c, (a, b), limit) == (reach < limit)
    assert is_beyond(c, (a, b), limit) == (reach > limit)


@given(STARS, st.sampled_from([15_000, 3_000, 200, -200, -3_000]))
def test_offsets_are_on_the_safe_side(shape: SimplePolygon, margin: int) -> None:
    true = polygon(shape).buffer(margin, quad_segs=256)
    small, large = made(inner, shape, margin), made(outer, shape, margin)
    assert margin < 0 or (small is not None and large is not None)
    if small is not None:
        assert polygon(small).difference(true).area < 1e-4 * polygon(small).area
        assert polygon(small).area > 0.8 * true.area - 1e9
    if large is not None:
        assert true.difference(polygon(large)).area < 1e-4 * max(true.area, 1)


def made(offset: Callable[[Shape, int], Shape], shape: Shape, margin: int) -> Shape | None:
    """Return an offset zone, or None if it vanishes or has several parts."""
    try:
        return offset(shape, margin)
    except NoSuchOffset as unshapely:
        if unshapely.reason == "nothing":
            return None
        raise


def test_disc_grows_and_shrinks_exactly() -> None:
    assert inner(RoundArea((5, 6), 100), 20) == outer(RoundArea((5, 6), 100), 20) == RoundArea((5, 6), 120)
    assert inner(RoundArea((5, 6), 100), -20) == RoundArea((5, 6), 80)
    with pytest.raises(NoSuchOffset):
        inner(RoundArea((5, 6), 100), -100)


def test_offsets_of_holes_are_on_the_safe_side() -> None:
    bay = SimplePolygon(
        (
            (0, 0),
            (60_000, 0),
            (60_000, 60_000),
            (32_000, 60_000),
            (32_000, 50_000),
            (50_000, 50_000),
            (50_000, 10_000),
            (10_000, 10_000),
            (10_000, 50_000),
            (28_000, 50_000),
            (28_000, 60_000),
            (0, 60_000),
        )
    )
    for offset in (inner, outer):
        shape = offset(bay, 4_000)
        assert isinstance(shape, MultiPolygon)
        assert not contains_area(shape, (30_000, 30_000))
        assert contains_area(shape, (30_000, 55_000))


SHAPES = st.one_of(
    st.builds(RoundArea, POINTS, st.integers(1, 30)),
    RAW.filter(lambda corners: crossing(corners) is None).map(lambda c: SimplePolygon(tuple(counter_clockwise(c)))),
)


@given(SHAPES, SHAPES)
def test_containment_and_disjointness_agree_with_shapely(one: Shape, other: Shape) -> None:
    a, b = Region(one, 0, 10), Region(other, 0, 10)
    first, second = polygon(one), polygon(other)
    overlap = first.intersection(second).area
    if isinstance(one, SimplePolygon) and isinstance(other, SimplePolygon):
        assert lies_within(a, b) == second.covers(first)
        assert are_disjoint(a, b) == (not first.relate_pattern(second, "T********"))
    else:  # the polygon only approximates the disc
        if lies_within(a, b):
            assert overlap > 0.99 * first.area
        if are_disjoint(a, b):
            assert overlap < 0.01 * first.area
        if overlap < 0.9 * first.area:
            assert not lies_within(a, b)
        if overlap > 0.1 * first.area:
            assert not are_disjoint(a, b)


def test_region_lies_within_itself_and_height_counts() -> None:
    square = SimplePolygon(((0, 0), (10, 0), (10, 10), (0, 10)))
    assert lies_within(Region(square, 0, 10), Region(square, 0, 10))
    assert not lies_within(Region(square, 0, 11), Region(square, 0, 10))
    assert are_disjoint(Region(square, 0, 10), Region(square, 10, 20))
    assert not are_disjoint(Region(square, 0, 10), Region(square, 9, 20))


@given(STARS, st.sampled_from(["grid", "perimeter", "orbit"]), st.integers(5_000, 40_000), st.integers(0, 4_000))
def test_survey_stays_in_its_area(shape: SimplePolygon, pattern: str, spacing: int, inset: int) -> None:
    points = survey(shape, pattern, spacing, inset, None)
    assume(points is not None)
    assert points is not None
    for a, b in pairwise(points):
        assert contains(shape.corners, a)
        if a != b:
            assert all(are_apart((a, b), edge, max(inset, LEAST_INSET) - 3) for edge in edges(shape))


@given(
    st.one_of(
        st.builds(RoundArea, st.just((0, 0)), st.integers(10_000, 90_000)),
        st.builds(
            lambda a, b, c: SimplePolygon(((0, 0), (a, c), (a - c * b // a, c + b), (-c * b // a, b))),
            st.integers(30_000, 90_000),
            st.integers(20_000, 80_000),
            st.integers(-20_000, 20_000),
        ),
    ),
    st.integers(5_000, 20_000),
)
def test_grid_passes_every_place_within_its_spacing(shape: Shape, spacing: int) -> None:
    points = survey(shape, "grid", spacing, 1_000, None)
    assert points is not None
    covered = shapely.LineString(points).buffer(spacing)
    assert polygon(inner(shape, -1_000)).difference(covered).area < 0.02 * polygon(shape).area


AREAS = st.builds(
    lambda shape, x, y, size: (shape, ((x, y), (x, y + size), (x + size, y + size), (x + size, y))),
    STARS,
    st.integers(-20_000, 20_000),
    st.integers(-20_000, 20_000),
    st.integers(500, 12_000),
)


@given(AREAS, st.sampled_from(["grid", "perimeter", "orbit"]), st.integers(5_000, 40_000), st.integers(0, 3_000))
def test_survey_goes_around_holes(
    area: tuple[SimplePolygon, tuple[Point, ...]], pattern: str, spacing: int, inset: int
) -> None:
    outline, hole = area
    shape = MultiPolygon((outline.corners, hole))
    assume(touching_edges(shape.rings) is None and nested(shape.rings))
    points = survey(shape, pattern, spacing, inset, None)
    assume(points is not None)
    assert points is not None
    for a, b in pairwise(points):
        assert contains_area(shape, a)
        if a != b:
            assert all(are_apart((a, b), edge, max(inset, LEAST_INSET) - 3) for edge in edges(shape))


def test_grid_covers_both_sides_of_a_hole() -> None:
    yard = MultiPolygon(
        (
            ((0, 0), (100_000, 0), (100_000, 100_000), (0, 100_000)),
            ((40_000, 40_000), (40_000, 60_000), (60_000, 60_000), (60_000, 40_000)),
        )
    )
    grid = survey(yard, "grid", 10_000, 0, None)
    assert grid is not None
    covered = shapely.LineString(grid).buffer(10_000)
    assert polygon(inner(yard, -1_000)).difference(covered).area == 0
    orbit = survey(yard, "orbit", 10_000, 0, None)
    assert orbit is not None
    assert shapely.Polygon(orbit).contains(shapely.Polygon(yard.rings[1]))


def test_area_in_parts_has_no_path() -> None:
    square = ((0, 0), (90_000, 0), (90_000, 90_000), (0, 90_000))
    assert survey(MultiPolygon((square, tuple((x + 100_000, y) for x, y in square))), "grid", 10_000, 0, None) is None


def test_orbit_avoids_holes() -> None:
    ring = ((0, 0), (100_000, 0), (100_000, 100_000), (0, 100_000))
    hole = ((95_000, 40_000), (95_000, 60_000), (97_000, 60_000), (97_000, 40_000))
    assert survey(MultiPolygon((ring, hole)), "orbit", 10_000, 0, None) is None


def test_survey_begins_at_the_nearer_end() -> None:
    area = SimplePolygon(((0, 0), (100_000, 0), (100_000, 20_000), (0, 20_000)))
    assert survey(area, "grid", 20_000, 0, (99_000, 10_000)) == ((98_998, 10_000), (1_002, 10_000))
    assert survey(area, "grid", 20_000, 0, (1_000, 10_000)) == ((1_002, 10_000), (98_998, 10_000))


def test_disc_is_surveyed() -> None:
    for pattern in ("grid", "perimeter", "orbit"):
        points = survey(RoundArea((0, 0), 50_000), pattern, 10_000, 3_000, None)
        assert points is not None
        assert all(x * x + y * y <= 47_000**2 for x, y in points)
    assert survey(RoundArea((0, 0), 900), "grid", 10_000, 0, None) is None
