"""Point-in-polygon tests, compared with shapely's `contains_xy` on prepared geometry, in turns in one run.

The project's test is exact, in integers, and a point on the boundary is outside; shapely uses floating point. The first
outlines have edges of many lengths and directions; a zig-zag has edges that span nearly all heights. Exits with 1 when
a test in the polygon of 200 vertices takes longer than the limit.
"""

import random
import sys
from collections.abc import Callable
from functools import partial
from math import cos, pi, sin
from pathlib import Path
from time import process_time_ns

import shapely

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from reference.outlines import Ring, area, zig_zag
from rtshcua.decision.checks.zones import rings
from rtshcua.decision.outline import Bands, Slabs, edges

LIMIT_US, LIMIT_VERTICES = 5.0, 200
ROUNDS, PLACES = 15, 1_000
PEER_S = 0.5
"""The approximate time limit of shapely in all rounds; it is slow if edges span nearly all heights."""
LARGEST = 65_536
"""The greatest number of vertices of the measured outlines."""
KILOMETRE = 1_000_000  # mm


def coast(count: int) -> Ring:
    """Return a ring with corners at random distances between 0.6 and 1 km from its centre."""
    chance = random.Random(count)
    found = []
    for number in range(count):
        radius, angle = chance.uniform(0.6, 1.0) * KILOMETRE, 2 * pi * number / count
        found.append((round(radius * cos(angle)), round(radius * sin(angle))))
    return tuple(found)


def round_outline(count: int) -> Ring:
    """Return a polygon in place of a circle."""
    return tuple(
        (round(KILOMETRE * cos(2 * pi * n / count)), round(KILOMETRE * sin(2 * pi * n / count))) for n in range(count)
    )


OUTLINES = [
    *((f"coast, {count:,} vertices", coast(count)) for count in (16, 200, 2_000, 20_000)),
    *((f"round, {count:,} vertices", round_outline(count)) for count in (200, 20_000)),
    *((f"zig-zag, {2 * teeth:,} vertices", zig_zag(teeth)) for teeth in (100, 1_000, 32_768)),
]


def places(ring: Ring) -> list[tuple[int, int]]:
    """Return random places in the ring's bounding box."""
    chance, xs, ys = random.Random(7), [x for x, _ in ring], [y for _, y in ring]
    west, east, south, north = min(xs), max(xs), min(ys), max(ys)
    return [(chance.randint(west, east), chance.randint(south, north)) for _ in range(PLACES)]


def each(ask: Callable[[int, int], object], of: list[tuple[int, int]]) -> float:
    """Return the processor time of a test in us, which depends little on other load."""
    start = process_time_ns()
    for x, y in of:
        ask(x, y)
    return (process_time_ns() - start) / len(of) / 1e3


def measured(ours: Slabs, ring: Ring) -> tuple[float, float]:
    """Return the time per place and shapely's, of the fastest round. The answers must agree, apart from rounding."""
    peer = shapely.Polygon(ring)
    shapely.prepare(peer)
    theirs, asked = partial(shapely.contains_xy, peer), places(ring)
    few = asked[:20]
    most = round(PEER_S * 1e6 / each(theirs, few) / ROUNDS)
    few = asked[: max(most, len(few))]
    differ = sum(ours.contains(x, y) != theirs(x, y) for x, y in few)
    assert differ <= len(few) // 100, differ
    rounds = [(each(ours.contains, asked), each(theirs, few)) for _ in range(ROUNDS)]
    return min(mine for mine, _ in rounds), min(other for _, other in rounds)


def main() -> int:
    """Measure and print a table; return 1 if the limit is missed."""
    print(f"{'us a place':28}{'ours':>8}{'shapely':>9}{'ratio':>7}{'check s':>9}{'tables s':>10}{'entries/vertex':>16}")
    limited = 0.0
    for name, ring in OUTLINES:
        if len(ring) > LARGEST:
            continue
        start = process_time_ns()
        problem = next(rings([ring]), None)
        assert problem is None, problem
        checked = process_time_ns()
        legs = list(edges(area([ring])))
        slabs, bands = Slabs(legs), Bands(legs)
        made = process_time_ns()
        ours, theirs = measured(slabs, ring)
        if len(ring) == LIMIT_VERTICES:
            limited = max(limited, ours)
        kept = (slabs.entries() + bands.entries()) / len(ring)
        print(
            f"{name:28}{ours:8.2f}{theirs:9.2f}{ours / theirs:7.2f}{(checked - start) / 1e9:9.2f}"
            f"{(made - checked) / 1e9:10.2f}{kept:16.1f}",
            flush=True,
        )
    held = limited <= LIMIT_US
    text = f"containment, {LIMIT_VERTICES} vertices: {limited:.2f} us a place, limit {LIMIT_US}"
    print(f"{'held  ' if held else 'MISSED'}  {text}: {limited / LIMIT_US:.2f} of it")
    return int(not held)


if __name__ == "__main__":
    sys.exit(main())
