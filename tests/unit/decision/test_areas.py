"""Areas with holes, by hand; and the tables for containment and sweeps, with their sizes."""

from random import Random

from hypothesis import given

from reference import worlds
from reference.naive_geometry import in_shape
from reference.outlines import Ring, area, polygon, rings, zig_zag
from rtshcua.decision.outline import MOST, REPEATS, Bands, Slabs, edges
from rtshcua.decision.values import FALSE, TRUE
from rtshcua.decision.zones import PreparedZone
from rtshcua.model.flat.zone import MAX_COORDINATE
from virtual.rows import rows

T, F = TRUE, FALSE
SQUARE: Ring = ((0, 0), (100, 0), (100, 100), (0, 100))
HOLE: Ring = ((40, 40), (40, 60), (60, 60), (60, 40))
ISLAND: Ring = ((48, 48), (52, 48), (52, 52), (48, 52))
AREA = PreparedZone(0, area([SQUARE, HOLE, ISLAND]))


@rows(
    ("place", "answer"),
    [
        ((20, 50), T),
        ((45, 50), F),  # in the hole
        ((50, 50), T),  # on the island
        ((40, 50), F),  # the hole's edge is outside
        ((40, 40), F),
        ((50, 60), F),
        ((48, 50), F),  # the island's edge too
        ((52, 52), F),
        ((20, 40), T),  # level with the hole's lower edge
        ((20, 0), F),
        ((100, 50), F),
        ((101, 50), F),
        ((50, 101), F),
        ((50, -1), F),
    ],
)
def test_places(place: tuple[int, int], answer: int) -> None:
    assert AREA.along(place, (0, 0, 0, 0)) == answer


@rows(
    ("path", "box", "answer"),
    [
        ((20, 50), (-5, -5, 5, 5), T),
        ((20, 50), (-5, -5, 50, 20), T | F),  # swallows the hole whole
        ((20, 50, 80, 50), (-1, -1, 1, 1), T | F),  # through the hole
        ((20, 20, 80, 20), (-5, -5, 5, 5), T),  # beside it
        ((20, 20, 80, 20), (-5, -5, 5, 45), T | F),  # beside it, and wide enough to hold it
        ((20, 20, 80, 20, 80, 80, 20, 80, 20, 20), (-5, -5, 5, 5), T),  # around it
        ((50, 50), (-1, -1, 1, 1), T),  # on the island
        ((50, 50), (-3, -3, 3, 3), T | F),  # in the hole, holding the island
        ((44, 50), (-1, -1, 1, 1), F),
        ((44, 44, 44, 56, 56, 56, 56, 44), (-1, -1, 1, 1), F),  # around the island
        ((44, 44, 56, 44), (-1, -1, 1, 10), T | F),
        ((-20, 50), (-1, -80, 200, 80), T | F),  # swallows all of it
        ((20, 30, 80, 30), (0, 0, 0, 10), T | F),  # touches the hole's edge
    ],
)
def test_sweeps(path: tuple[int, ...], box: tuple[int, int, int, int], answer: int) -> None:
    assert AREA.along(path, box) == answer


def test_level_edges_side_by_side() -> None:
    """Two parts of an outline at one height: on one, between, on the other."""
    comb = PreparedZone(0, polygon(((0, 0), (30, 0), (30, 10), (20, 10), (20, 5), (10, 5), (10, 10), (0, 10))))
    places = [(5, 10), (15, 10), (25, 10), (15, 5), (5, 5), (10, 7), (5, 7), (15, 7), (10, 5), (20, 10)]
    assert [comb.along(place, (0, 0, 0, 0)) for place in places] == [F, F, F, F, T, F, T, F, F, F]


ZIG_ZAG = zig_zag(100)
LEGS = list(edges(polygon(ZIG_ZAG)))


def test_tables_of_a_zig_zag() -> None:
    """Many edges through many slabs: fewer entries than edges times slabs."""
    slabs, bands = Slabs(LEGS), Bands(LEGS)
    assert slabs.entries() <= MOST * len(LEGS)
    assert bands.entries() <= REPEATS * len(LEGS)
    assert bands.clear(3, 500, 5, 500, (0, 0, 0, 0)), "between two edges, within the bounds of both"
    assert not bands.clear(1, 500, 3, 500, (0, 0, 0, 0))


@given(worlds.CHANCES)
def test_tables_of_a_zig_zag_give_the_same_answers(of: Random) -> None:
    slabs, zone = Slabs(LEGS), polygon(ZIG_ZAG)
    for _ in range(20):
        x, y = of.choice(ZIG_ZAG) if of.random() < 0.5 else (of.randint(-2, 400), of.randint(-500, 1_500))
        x += of.randint(-1, 1)
        assert slabs.contains(x, y) == in_shape((x, y), zone)


@given(worlds.CHANCES)
def test_every_corner_and_its_neighbours(of: Random) -> None:
    made = rings(of)
    zone = area(made)
    prepared = PreparedZone(0, zone)
    for x, y in of.choice(made):
        for place in [(x, y), (x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]:
            assert prepared.along(place, (0, 0, 0, 0)) == (T if in_shape(place, zone) else F)


def test_distant_edges_are_distinguished() -> None:
    """Two long edges that lie less than 1 mm apart where they are sorted."""
    far = MAX_COORDINATE
    thin: Ring = ((-far, -far), (far, far - 1), (far, far), (-far + 1, -far + 1))
    prepared = PreparedZone(0, polygon(thin))
    assert [prepared.along(place, (0, 0, 0, 0)) for place in [(0, 0), (far - 1, far - 1), (far - 2, far)]] == [
        T if in_shape(place, polygon(thin)) else F for place in [(0, 0), (far - 1, far - 1), (far - 2, far)]
    ]
