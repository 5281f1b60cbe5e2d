"""Read the outline of an area from a GeoJSON, KML or KMZ file.

A KML file is written as GeoJSON and read by the same strict reader, so both have the same checks.
"""

from pathlib import Path
from typing import Final

from rtshcua.adapters.store.reading import read_regular
from rtshcua.app.exit_codes import words_of
from rtshcua.diagnostics.codes import GEOJSON_UNREAD
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.kinds import ARCHIVE, GEOJSON, KML, recognised
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.checker.geojson import GeoPolygon, NoArea, read_area
from rtshcua.ground.exchange.kml_document import kml_of, polygons_as_geojson
from rtshcua.ground.exchange.losses import NotReadable
from rtshcua.ground.language.size_limits import MAX_SIZE

_HEIGHTS: Final = "remove heights and times from the file: `--below` limits the height"


def read_outline(path: Path, feature: str | None = None) -> tuple[GeoPolygon, ...] | Refusal:
    """Return the polygons of the only area in a file, or of the one with a name, in 1e-7 degree."""
    try:
        data = read_regular(path, MAX_SIZE)
    except OSError as error:
        return Refusal("input", f"cannot read `{path}`: {words_of(error)}", "", ExitCode.INPUT)
    if len(data) > MAX_SIZE:
        return _refused(path, f"it has more than {MAX_SIZE >> 20} MiB", "simplify the outline")
    try:
        if path.suffix.lower() == ".kmz" or recognised(data) is ARCHIVE:
            data = kml_of(data)
        kind = recognised(data)
        is_kml = kind is KML or (kind is not GEOJSON and path.suffix.lower() in (".kml", ".kmz"))
        return read_area(polygons_as_geojson(data) if is_kml else data, feature)
    except NotReadable as error:
        return _refused(path, str(error), error.help)
    except NoArea as error:
        help = _HEIGHTS if error.code is GEOJSON_UNREAD else (error.help or "").replace("`feature`", "`FILE#NAME`")
        return _refused(path, error.message, help)


def _refused(path: Path, text: str, help: str) -> Refusal:
    return Refusal("no-area", f"`{path}`: {text}", help, ExitCode.INPUT)
