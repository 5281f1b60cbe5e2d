"""A flight as a file for other programs: one module a format, each a pure function of a `FlightExport`."""

from typing import Final

KML, GPX, GEOJSON, CSV, PLAN, MCAP, TLOG = FORMATS = ("kml", "gpx", "geojson", "csv", "plan", "mcap", "tlog")
#: formats that no terminal shows
BINARY: Final = frozenset({MCAP, TLOG})
