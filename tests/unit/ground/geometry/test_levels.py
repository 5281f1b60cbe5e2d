"""Paths at several heights, and directions without floats."""

from itertools import pairwise
from math import atan2, degrees
from random import Random

from hypothesis import given
from hypothesis import strategies as some

from rtshcua.ground.geometry.levels import bearing, heights_between, inward, levelled, middle
from rtshcua.model.flat.mission import ALONG, TURN
from rtshcua.model.flat.zone import MAX_COORDINATE
from virtual.rows import rows

SIDES = some.integers(-MAX_COORDINATE, MAX_COORDINATE)


@given(SIDES | some.integers(-20, 20), SIDES | some.integers(-20, 20))
def test_a_bearing_is_the_nearest_hundredth_of_a_degree(east: int, north: int) -> None:
    found = bearing(east, north)
    if (east, north) == (0, 0):
        assert found == ALONG
    else:
        assert 0 <= found < TURN
        exact = degrees(atan2(east, north)) * 100
        assert abs((found - exact + TURN // 2) % TURN - TURN // 2) < 0.50001


@rows(
    ("lowest", "highest", "every", "heights"),
    [
        (10, 30, 10, (10, 20, 30)),
        (10, 30, 8, (10, 16, 23, 30)),
        (10, 30, 100, (10, 30)),
        (10, 10, 5, (10,)),
    ],
)
def test_heights_are_evenly_spaced(lowest: int, highest: int, every: int, heights: tuple[int, ...]) -> None:
    assert heights_between(lowest, highest, every) == heights


@given(some.integers(0, 10_000), some.integers(0, 10_000), some.integers(1, 3_000))
def test_no_two_heights_are_further_apart(lowest: int, more: int, every: int) -> None:
    found = heights_between(lowest, lowest + more, every)
    assert (found[0], found[-1]) == (lowest, lowest + more)
    assert all(0 < b - a <= every for a, b in pairwise(found))


SQUARE = ((0, 0), (10, 0), (10, 10), (0, 10), (0, 0))


def test_a_closed_path_goes_around_once_at_each_height() -> None:
    path = levelled(SQUARE, (5, 9), inward(SQUARE))
    assert path.points == SQUARE * 2
    assert path.heights == (5,) * 5 + (9,) * 5
    assert path.headings == (4_500, 31_500, 22_500, 13_500, 4_500) * 2


def test_an_open_path_goes_to_and_fro() -> None:
    there = ((0, 0), (10, 0))
    assert levelled(there, (5, 7, 9)) == (there + there[::-1] + there, (5, 5, 7, 7, 9, 9), ())
    assert levelled(there, (5, 7), (100, 200)).headings == (100, 200, 200, 100)


def test_a_path_at_one_height_has_no_heights() -> None:
    assert levelled(SQUARE, ()) == (SQUARE, (), ())


def test_the_middle_is_that_of_the_area_and_not_of_the_corners() -> None:
    of = Random(3)
    crowded = [(0, 0), *sorted((of.randrange(1, 1_000), 0) for _ in range(20)), (1_000, 0), (1_000, 400), (0, 400)]
    assert middle([*crowded, (0, 0)]) == (500, 200)
    assert middle([(0, 0), (10, 0), (0, 0)]) == (3, 0), "without an area"
