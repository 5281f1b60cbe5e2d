"""Zones that loading refuses: areas with wrong numbers, rings or times."""

import pytest
from msgspec.structs import replace

from reference import flat_case as flat
from reference.flat_case import H
from reference.outlines import area, polygon, zig_zag
from rtshcua.decision.prepare import PreparedPolicy, prepare
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.model.flat.limits import DAY, MAX_TOTAL_VERTICES, MAX_VALUE
from rtshcua.model.flat.zone import AREA, LOWEST, MAX_COORDINATE, MAX_RINGS, Zone
from virtual.rows import rows

SQUARE = ((-9, -9), (9, -9), (9, 9), (-9, 9))
HOLE = ((-5, -5), (-5, 5), (5, 5), (5, -5))
GOOD = area([SQUARE, HOLE], floor=0, ceiling=9)


def found(*zones: Zone) -> PreparedPolicy | Refusal:
    return prepare(replace(flat.POLICY, zones=(*flat.ZONES, *zones)))


def raw(*data: int) -> Zone:
    return Zone("z", AREA, LOWEST, 0, data)


MANY = [c for n in range(MAX_RINGS + 1) for c in (4 * n, 0, 4 * n + 2, 0, 4 * n, 2)]
REFUSED = [
    (raw(), "number of rings 0 is not in 1..1024"),
    (raw(0), "number of rings 0 is not in 1..1024"),
    (raw(-1), "number of rings -1 is not in 1..1024"),
    (raw(1 << 40), f"number of rings {1 << 40} is not in 1..1024"),
    (raw(MAX_RINGS + 1, *(3,) * (MAX_RINGS + 1), *MANY), "number of rings 1025 is not in 1..1024"),
    (raw(1), "the number of coordinates does not match the corners of the rings"),
    (raw(1, 2, 0, 0, 1, 1), "number of corners 2 is not in 3..65536"),
    (raw(2, -3, 6, 0, 0, 1, 0, 1, 1), "number of corners -3 is not in 3..65536"),
    (raw(1, 3, 0, 0, 1, 0, 1), "the number of coordinates does not match"),
    (raw(1, 3, 0, 0, 1, 0, 1, 1, 1), "the number of coordinates does not match"),
    (raw(1, 3, 0, 0, 1, 0, 1, MAX_COORDINATE + 1), f"coordinate {MAX_COORDINATE + 1} is not in"),
    (area([SQUARE[::-1]]), "ring 0: the ring has the wrong orientation"),
    (area([SQUARE, HOLE[::-1]]), "ring 1: the ring has the wrong orientation"),
    (area([SQUARE, ((-9, 0), (0, 1), (0, -1))]), "ring 1: edges cross or touch"),
    (polygon(SQUARE[::-1]), "ring 0: the ring has the wrong orientation"),
    (polygon((SQUARE[0], SQUARE[1], SQUARE[3], SQUARE[2])), "ring 0: edges cross or touch"),
    (replace(GOOD, daily=(1,)), "a time needs a start and an end"),
    (replace(GOOD, dates=(1, 2, 3)), "a time needs a start and an end"),
    (replace(GOOD, daily=(-1, H)), f"-1..{H} us is not a window of a day"),
    (replace(GOOD, daily=(DAY, H)), f"{DAY}..{H} us is not a window of a day"),
    (replace(GOOD, daily=(0, DAY + 1)), f"0..{DAY + 1} us is not a window of a day"),
    (replace(GOOD, dates=(2, 1)), "2..1 us is not an interval of UTC"),
    (replace(GOOD, dates=(-1, 1)), "-1..1 us is not an interval of UTC"),
    (replace(GOOD, dates=(0, MAX_VALUE + 1)), f"0..{MAX_VALUE + 1} us is not an interval of UTC"),
]


@rows(("zone", "what"), REFUSED, ids=[what for _, what in REFUSED])
def test_refused(zone: Zone, what: str) -> None:
    answer = found(zone)
    assert isinstance(answer, Refusal)
    assert answer.text.startswith(f"zone {len(flat.ZONES)}: {what}")


@pytest.mark.parametrize(
    "zone",
    [
        GOOD,
        pytest.param(area([zig_zag(3_000)]), marks=pytest.mark.unmeasured),  # more corners than a polygon may have
        pytest.param(raw(MAX_RINGS, *(3,) * MAX_RINGS, *MANY[:-6]), marks=pytest.mark.unmeasured),
        replace(GOOD, daily=(0, DAY), dates=(0, MAX_VALUE)),
        replace(GOOD, daily=(DAY - 1, 0)),
    ],
    ids=["a hole", "long", "as many rings as may be", "always", "over midnight"],
)
def test_accepted(zone: Zone) -> None:
    assert isinstance(found(zone), PreparedPolicy)


def test_the_corners_of_all_zones_are_counted_before_they_are_looked_at() -> None:
    huge = raw(1 << 40, *(0,) * (2 * MAX_TOTAL_VERTICES + 2 * MAX_RINGS + 2))
    answer = found(huge)
    assert isinstance(answer, Refusal)
    assert answer.text.startswith("number of vertices")
