"""Random areas on a small grid, so that corners, edges and places often coincide."""

from random import Random

from rtshcua.decision.checks.zones import rings as problems
from rtshcua.model.flat.zone import AREA, HIGHEST, LOWEST, POLYGON, Zone

Point = tuple[int, int]
Ring = tuple[Point, ...]


def fits(rings: list[Ring]) -> bool:
    """A fast check; a separate test compares it with `naive_geometry.well_formed`, which is too slow here."""
    return next(problems(rings), None) is None


def ring(of: Random, middle: Point, reach: int, corners: int) -> Ring:
    """A simple counter-clockwise ring around a place: points are inserted where the ring does not cross itself."""
    x, y = middle
    found: Ring = ()
    while not found:
        tried = tuple((x + of.randint(-reach, reach), y + of.randint(-reach, reach)) for _ in range(3))
        found = next((turned for turned in (tried, tried[::-1]) if fits([turned])), ())
    for _ in range(corners):
        new = (x + of.randint(-reach, reach), y + of.randint(-reach, reach))
        at = of.randrange(len(found))
        longer = (*found[:at], new, *found[at:])
        if fits([longer]):
            found = longer
    return found


def rings(of: Random, reach: int = 12) -> list[Ring]:
    """An area, often with holes, islands in them, and islands apart."""
    made = [ring(of, (0, 0), reach, of.randrange(14))]
    if of.random() < 0.3:
        made = [((-reach, -reach), (reach, -reach), (reach, reach), (-reach, reach))]
    for _ in range(of.choice([0, 4, 12])):
        middle = (of.randint(-reach, reach), of.randint(-reach, reach))
        new = ring(of, middle, max(1, reach // of.choice([2, 3, 4, 6])), of.randrange(4))
        made = next((more for more in ([*made, new], [*made, new[::-1]]) if fits(more)), made)
    start = of.randrange(len(made))
    return [*made[start:], *made[:start]]


def area(rings: list[Ring], floor: int = LOWEST, ceiling: int = HIGHEST) -> Zone:
    data = (len(rings), *map(len, rings), *(c for corners in rings for corner in corners for c in corner))
    return Zone("area", AREA, floor, ceiling, data)


def polygon(ring: Ring, floor: int = LOWEST, ceiling: int = HIGHEST) -> Zone:
    return Zone("polygon", POLYGON, floor, ceiling, tuple(c for corner in ring for c in corner))


def zig_zag(teeth: int) -> Ring:
    """A thin band whose edges span nearly all heights, with distinct end heights."""
    low = [(4 * tooth, 10 * teeth + 5 * tooth if tooth % 2 else -5 * tooth) for tooth in range(teeth)]
    return (*low, *((x, y + 2) for x, y in reversed(low)))
