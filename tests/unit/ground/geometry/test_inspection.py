"""Paths around structures and along lines: distances, heights, and the direction in which the camera looks."""

import math
from itertools import pairwise

import shapely
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.ground.geometry.inspection import (
    CentreLine,
    face_scan,
    line_count,
    orbit,
    parallel_lines,
    reach_of,
)

AXIS = st.integers(-200_000, 200_000)
PLACES = st.tuples(AXIS, AXIS)


def turned(x: float, y: float) -> float:
    """The heading of a vector in floats, in 1/100 degree."""
    return math.degrees(math.atan2(x, y)) % 360 * 100


def between(one: float, other: float) -> float:
    """The angle between two headings in 1/100 degree."""
    return min((one - other) % 36_000, (other - one) % 36_000)


@given(
    PLACES, st.integers(1_000, 200_000), st.lists(st.integers(0, 200_000), min_size=1, max_size=4), st.integers(3, 60)
)
def test_orbit_keeps_its_distance_and_looks_inwards(
    centre: tuple[int, int], radius: int, heights: list[int], legs: int
) -> None:
    points = orbit(centre, radius, heights, legs)
    middle = shapely.Point(centre)
    assert len(points) == len(heights) * (legs + 1)
    for number, height in enumerate(heights):
        ring = points[number * (legs + 1) : (number + 1) * (legs + 1)]
        assert {point.z for point in ring} == {height}
        assert ring[0] == ring[-1]
        path = shapely.LinearRing([(point.x, point.y) for point in ring])
        assert path.is_ccw
        assert middle.distance(path) >= radius
        assert middle.hausdorff_distance(path) <= (radius + 2) / math.cos(math.pi / legs) + 1
        assert all(between(p.facing, turned(centre[0] - p.x, centre[1] - p.y)) <= 0.51 for p in ring)


@given(PLACES, PLACES, st.integers(0, 50_000), st.lists(st.integers(0, 200_000), min_size=1, max_size=4))
def test_face_scan_passes_to_and_fro_at_its_distance(
    start: tuple[int, int], end: tuple[int, int], distance: int, heights: list[int]
) -> None:
    if math.dist(start, end) < 1_000:
        return
    points = face_scan((start, end), distance, heights)
    face = shapely.LineString([start, end])
    assert [point.z for point in points] == [height for height in heights for _ in range(2)]
    for a, b in zip(points[::2], points[1::2], strict=True):
        middle = ((a.x + b.x) / 2, (a.y + b.y) / 2)
        assert distance - 1 <= face.distance(shapely.Point(middle)) <= distance + 2
        assert abs(math.dist((a.x, a.y), (b.x, b.y)) - face.length) <= 2
        assert between(a.facing, turned(end[1] - start[1], start[0] - end[0])) <= 0.51
        assert a.facing == b.facing
    for one, two in zip(points[1::2], points[2::2], strict=False):
        assert (one.x, one.y) == (two.x, two.y), "it climbs where a pass ends"


@given(
    st.lists(PLACES, min_size=2, max_size=5, unique=True),
    st.integers(2_000, 60_000),
    st.integers(1_000, 40_000),
    st.integers(1_000, 5_000),
)
def test_lines_stay_in_their_corridor_and_are_evenly_spaced(
    places: list[tuple[int, int]], half: int, spacing: int, inset: int
) -> None:
    found = parallel_lines(CentreLine(tuple(places), half), inset, spacing, 256)
    if half <= inset:
        assert found is None
        return
    assert found is not None
    assert len(found) == line_count(half - inset, spacing, 256)
    corridor = shapely.LineString(places).buffer(half - inset + 2, quad_segs=64)
    for line in found:
        assert corridor.covers(shapely.LineString(line))
    first = [line[:2] if number % 2 == 0 else line[:-3:-1] for number, line in enumerate(found)]
    gaps = [math.dist(one[0], two[0]) for one, two in pairwise(first)]
    assert all(gap <= 2 * (half - inset) / len(found) + 2 for gap in gaps)
    assert len(found) == 256 or all(gap <= spacing + 2 for gap in gaps)


def test_reach_of_a_ring_encloses_it() -> None:
    assert reach_of(((3, 4), (-1, 0)), (0, 0)) == 6
    assert reach_of(((3, 3),), (0, 0)) == 5
