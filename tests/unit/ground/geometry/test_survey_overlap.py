"""Overlap as proved is never above the overlap as sampled, on random grids and corridors flown with random cameras.

The oracle knows only the path: it finds the lines by their common direction, takes a picture every few metres along the
whole way, and counts at random places of the area the pictures that show each of them.
"""

import math
from collections import defaultdict
from itertools import pairwise
from random import Random
from typing import NamedTuple

import numpy as np
import pytest
import shapely

from rtshcua.ground.geometry.cameras import SurveyCamera, apart, overlap
from rtshcua.ground.geometry.inspection import CentreLine
from rtshcua.ground.geometry.polygons import Point, counter_clockwise
from rtshcua.ground.geometry.shapes import Polygonal, SimplePolygon, polygonal
from rtshcua.ground.geometry.survey import PathAim, line_spacing, survey
from virtual.sampling import parts

FULL = 10_000
GRIDS = 1_000
INSET = 3_000
#: places at which the pictures are counted
PLACES = 60


class FlownGrid(NamedTuple):
    """A grid over an area, what was demanded, and what is proved."""

    area: Polygonal
    path: tuple[Point, ...]
    along: float
    across: float
    every: int
    demanded: tuple[int, int]
    forward: int
    side: int | None


def flown(seed: int) -> FlownGrid | None:
    """Fly a random grid; None if there is none, as in an area that is too small."""
    of = Random(seed)
    corners, size = of.randint(3, 8), of.randint(30_000, 250_000)
    radii = [size * of.uniform(0.5, 1) for _ in range(corners)]
    ring = [
        (round(r * math.cos(2 * math.pi * k / corners + 0.2)), round(r * math.sin(2 * math.pi * k / corners + 0.2)))
        for k, r in enumerate(radii)
    ]
    hole = tuple((x // 5, y // 5) for x, y in reversed(counter_clockwise(ring)))
    area = polygonal((tuple(counter_clockwise(ring)), hole)[: 2 if seed % 3 == 0 else 1])
    camera = SurveyCamera(
        of.randint(4_000, 24_000), of.randint(6_000, 36_000), 3_000, 4_000, of.randint(6_000, 40_000), 1, 1
    )
    away = of.randint(15_000, 120_000)
    forward, side = of.randint(4_000, 9_000), of.randint(2_000, 8_500)
    every, spacing = apart(camera.shows_along(away), forward), apart(camera.shows_across(away), side)
    if min(every, spacing) < 1_500:
        return None
    aim = PathAim(spacing=spacing)
    path = survey(area, "grid", away, INSET, None, aim)
    if path is None:
        return None
    between = line_spacing(area, "grid", away, INSET, aim)
    return FlownGrid(
        area, path, float(camera.shows_along(away)), float(camera.shows_across(away)), every, (forward, side),
        overlap(camera.shows_along(away), every),
        None if between is None else overlap(camera.shows_across(away), between),
    )  # fmt: skip


def direction(path: tuple[Point, ...]) -> float:
    """The direction in which most of a path goes, either way."""
    ways: dict[int, float] = defaultdict(float)
    for (ax, ay), (bx, by) in pairwise(path):
        ways[round(math.degrees(math.atan2(by - ay, bx - ax)) * 10) % 1800] += math.dist((ax, ay), (bx, by))
    likely = max(ways, key=lambda way: sum(ways.get((way + near) % 1800, 0) for near in (-1, 0, 1)))
    (ax, ay), (bx, by) = max((leg for leg in pairwise(path) if _near(leg, likely)), key=lambda leg: math.dist(*leg))
    return math.atan2(by - ay, bx - ax)


def _near(leg: tuple[Point, Point], way: int) -> bool:
    (ax, ay), (bx, by) = leg
    return (round(math.degrees(math.atan2(by - ay, bx - ax)) * 10) - way + 1) % 1800 <= 2


def pictures(grid: FlownGrid, turn: float) -> tuple[np.ndarray, np.ndarray]:
    """The pictures along and across the lines, and the lines' places across."""
    x, y = np.array(grid.path, dtype=float).T
    along, across = x * math.cos(turn) + y * math.sin(turn), y * math.cos(turn) - x * math.sin(turn)
    taken, lines = [], []
    passed = 0.0
    for number in range(len(along) - 1):
        length = math.hypot(along[number + 1] - along[number], across[number + 1] - across[number])
        steps = np.arange(-passed % grid.every, length, grid.every) / max(length, 1)
        if abs(across[number + 1] - across[number]) <= 3 and length > 10:  # a line, not a way between two
            lines.append((across[number] + across[number + 1]) / 2)
            taken.append(np.stack([along[number] + steps * (along[number + 1] - along[number]),
                                   np.full(len(steps), lines[-1])]))  # fmt: skip
        passed += length
    return np.concatenate(taken, axis=1), np.unique(np.round(np.array(lines) / 10)) * 10


@pytest.mark.parametrize("seeds", parts(range(GRIDS), 20))
def test_overlap_as_proved_is_never_above_the_sampled_one(seeds: list[int]) -> None:
    counted = beside = 0
    for seed in seeds:
        grid = flown(seed)
        if grid is None:
            continue
        turn = direction(grid.path)
        taken, lines = pictures(grid, turn)
        assert grid.forward >= grid.demanded[0], seed
        if grid.side is not None and len(lines) > 1:
            beside += 1
            gap = max(b - a for a, b in pairwise(sorted(lines)))
            assert grid.side >= grid.demanded[1] or len(lines) == 256, seed
            assert (1 - (gap - 12) / grid.across) * FULL >= grid.side, (seed, gap)
        room = math.hypot(grid.across / 2, grid.along / 2 + grid.every) + INSET + 10
        deep = shapely.Polygon(grid.area.rings[0], grid.area.rings[1:]).buffer(-room)
        if deep.is_empty or grid.side is None:
            continue
        least = int(1 / (1 - grid.forward / FULL) + 1e-9) * int(1 / (1 - grid.side / FULL) + 1e-9)
        for x, y in places(deep, seed):
            along, across = x * math.cos(turn) + y * math.sin(turn), y * math.cos(turn) - x * math.sin(turn)
            shown = (np.abs(taken[0] - along) <= grid.along / 2) & (np.abs(taken[1] - across) <= grid.across / 2 + 6)
            assert shown.sum() >= least, (seed, x, y)
            counted += 1
    assert counted > PLACES * len(seeds) / 20, "the areas are large enough for the claim to be tested"
    assert beside > len(seeds) / 2


def places(deep: shapely.Geometry, seed: int) -> list[tuple[float, float]]:
    """Random places of an area."""
    of, (west, south, east, north) = Random(seed), deep.bounds
    some = [(of.uniform(west, east), of.uniform(south, north)) for _ in range(PLACES)]
    return [place for place in some if deep.contains(shapely.Point(place))]


def test_corridor_keeps_the_overlap_to_the_side() -> None:
    line = ((0, 0), (200_000, 0), (300_000, 90_000))
    outline = shapely.LineString(line).buffer(40_000)
    area = SimplePolygon(tuple((round(x), round(y)) for x, y in reversed(outline.exterior.coords[:-1])))
    camera = SurveyCamera(8_800, 13_200, 3_648, 5_472, 8_800, 1, 1)
    for side in (3_000, 6_000, 7_500):
        aim = PathAim(CentreLine(line, 40_000), spacing=apart(camera.shows_across(30_000), side))
        path = survey(area, "corridor", 30_000, INSET, None, aim)
        between = line_spacing(area, "corridor", 30_000, INSET, aim)
        assert path is not None
        assert between is not None
        assert overlap(camera.shows_across(30_000), between) >= side
        lines = sorted({y for (_, y), (_, then) in pairwise(path) if y == then})
        assert max(b - a for a, b in pairwise(lines)) <= between
        assert outline.buffer(-INSET + 2).covers(shapely.LineString(path))
