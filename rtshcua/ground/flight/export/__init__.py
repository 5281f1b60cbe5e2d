"""A flight as a file for other programs: one module a format, each a pure function of a `FlightExport`."""

from typing import Final

KML, GPX, GEOJSON, CSV, PLAN, MCAP, TLOG, GEOTAG = FORMATS = (
    "kml", "gpx", "geojson", "csv", "plan", "mcap", "tlog", "geotag",
)  # fmt: skip
#: how the file of a format ends where it is not its name
SUFFIXES: Final = {GEOTAG: "txt"}
#: formats that no terminal shows
BINARY: Final = frozenset({MCAP, TLOG})
