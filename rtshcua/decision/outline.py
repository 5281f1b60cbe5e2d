"""The rings that bound a zone which is no circle, read off its flat form."""

from collections.abc import Iterator
from itertools import pairwise
from typing import TypeAlias

from rtshcua.model.flat.zone import AREA, Zone

#: x, y
Corner: TypeAlias = tuple[int, int]
#: x0, y0, x1, y1
Leg: TypeAlias = tuple[int, int, int, int]


def rings(zone: Zone) -> Iterator[tuple[Corner, ...]]:
    """The corners of each ring: outer rings counter-clockwise, holes clockwise."""
    data = zone.data
    counts, at = (data[1 : 1 + data[0]], 1 + data[0]) if zone.shape == AREA else ((len(data) // 2,), 0)
    for count in counts:
        end = at + 2 * count
        yield tuple(zip(data[at:end:2], data[at + 1 : end : 2], strict=True))
        at = end


def edges(zone: Zone) -> Iterator[Leg]:
    """The edges of all rings."""
    for ring in rings(zone):
        for (x0, y0), (x1, y1) in pairwise((*ring, ring[0])):
            yield (x0, y0, x1, y1)
