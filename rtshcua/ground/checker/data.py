"""The files that zones are read from, and what is read from them, each once."""

from collections.abc import Mapping

from rtshcua.ground.checker.geojson import GeoPolygon, read_area
from rtshcua.ground.checker.refused import Refused
from rtshcua.model.ir.places import GeoJson


class DataFiles:
    """`content` has the bytes of each file; `names` which of them is meant, by the source and the path as written."""

    def __init__(
        self, content: Mapping[str, bytes] | None = None, names: Mapping[tuple[str, str], str] | None = None
    ) -> None:
        self.content = content or {}
        self._names = names or {}
        self._areas: dict[tuple[str, str | None], tuple[GeoPolygon, ...] | Refused] = {}

    def name(self, shape: GeoJson) -> str | None:
        """The file that a zone is read from; None where it could not be read."""
        return self._names.get((shape.span.file, shape.path))

    def area(self, shape: GeoJson) -> tuple[GeoPolygon, ...] | Refused | None:
        """The polygons of a zone, or why there are none; None where the file could not be read."""
        name = self.name(shape)
        if name is None:
            return None
        key = (name, shape.feature)
        found = self._areas.get(key)
        if found is None:
            try:
                found = read_area(self.content[name], shape.feature)
            except Refused as refused:
                found = refused
            self._areas[key] = found
        return found
