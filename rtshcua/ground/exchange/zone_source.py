"""Write zones as source: shapes, heights, times, and the names that a file's names become."""

import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Final, NamedTuple
from unicodedata import combining, normalize

from rtshcua.ground.checker.geojson import GeoPolygon, GeoRing
from rtshcua.ground.exchange.losses import comment
from rtshcua.ground.gateway.translation import degrees
from rtshcua.ground.language.table import table
from rtshcua.model.quantity import Dimension, display

#: words that are no names, besides those of the grammar
_TAKEN: Final = ("phase", "local")
#: the most characters of a name that is made
_LONGEST: Final = 40


class SourceZone(NamedTuple):
    """A zone as it is written: its name, comments from the file (one line each), shape, heights and times."""

    name: str
    comments: tuple[str, ...]
    shape: str
    items: tuple[str, ...] = ()

    def text(self) -> str:
        """The declaration, with its comments before it."""
        told = "".join(f"// {comment(each)}\n" for each in self.comments)
        return f"{told}zone {self.name} = {self.shape}{''.join(f'  {each}' for each in self.items)}\n"


class SourceNames:
    """Makes names of the language from names in files; no two are the same."""

    def __init__(self, taken: Iterable[str] = ()) -> None:
        self._used = set(taken)

    def of(self, text: str, otherwise: str) -> str:
        """The name for a text; `otherwise` if it has no letter or digit that a name can have."""
        plain = "".join(each for each in normalize("NFKD", text) if not combining(each)).lower()
        name = "_".join(re.findall(r"[a-z0-9]+", plain))[:_LONGEST].strip("_") or otherwise
        if name[0].isdigit():
            name = f"{otherwise}_{name}"
        if table().words.get(name) is False or name in _TAKEN:
            name = f"{name}_area"
        made, number = name, 1
        while made in self._used:
            number += 1
            made = f"{name}_{number}"
        self._used.add(made)
        return made


def place_text(latitude: int, longitude: int) -> str:
    """A place in 1e-7 degree as coordinates."""
    return f"{degrees(latitude, 'NS')}, {degrees(longitude, 'EW')}"


def metres(length: int) -> str:
    """A length in mm with its unit."""
    return display(length, Dimension.LENGTH)


def circle_text(latitude: int, longitude: int, radius_mm: int) -> str:
    """A circle."""
    return f"circle({place_text(latitude, longitude)}, {metres(radius_mm)})"


def corridor_text(line: Sequence[tuple[int, int]], width_mm: int) -> str:
    """A corridor along a line of places, longitude first."""
    places = ", ".join(place_text(latitude, longitude) for longitude, latitude in line)
    return f"corridor({places}, width {metres(width_mm)})"


def polygons_text(polygons: Sequence[GeoPolygon]) -> str:
    """A polygon with its holes, or the union of several."""
    written = [_polygon_text(each) for each in polygons]
    return written[0] if len(written) == 1 else "union(\n" + ",\n".join(written) + "\n)"


def _polygon_text(polygon: GeoPolygon) -> str:
    return f"polygon(\n{_ring_text(polygon.outer)})" + "".join(
        f" hole (\n{_ring_text(each)})" for each in polygon.holes
    )


def _ring_text(ring: GeoRing) -> str:
    return "".join(f"  {each},\n" for each in _places(ring))


def _places(ring: GeoRing) -> Iterator[str]:
    for longitude, latitude in ring:
        yield place_text(latitude, longitude)
