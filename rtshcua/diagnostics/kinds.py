"""Recognise the kind of a file by its first bytes, so that an error can name the kind that was given.

For messages only: no input is accepted because of the result.
"""

import re
from typing import Final, NamedTuple

#: how many bytes of a file are examined
LOOKED_AT: Final = 1 << 13


class FileKind(NamedTuple):
    """A kind of file: its name, and a help on how to use it, which may be empty."""

    name: str
    help: str


BUNDLE: Final = FileKind(
    "a compiled bundle", "`rtshcua show` prints it, `rtshcua run` flies it; its source ends in `.rts`"
)
LOG: Final = FileKind("a flight log", "`rtshcua verify-log` verifies it, `rtshcua why` explains it")
PROOF: Final = FileKind("a proof of a record", "`rtshcua verify-proof` verifies it")
DOCUMENT: Final = FileKind("a signed document", "`rtshcua show` prints it")
KEY: Final = FileKind("a key", "`rtshcua show` names its duty; keep a private key secret")
SPECIFICATION: Final = FileKind("a mission specification", "`rtshcua compile FILE.json --with POLICY.rts` compiles it")
SOURCE: Final = FileKind("a source", "`rtshcua compile FILE.rts -o FILE.bundle` makes a bundle of it")
PLAN: Final = FileKind("a QGroundControl plan", "`rtshcua import FILE.plan -o FILE.rts` makes a source of it")
WAYPOINTS: Final = FileKind(
    "a list of waypoints (QGC WPL)", "waypoint lists are not supported: write the mission as a source"
)
GEOJSON: Final = FileKind("GeoJSON", 'read it from a source: `zone NAME from "FILE.geojson"`')
ED269: Final = FileKind(
    "a list of geographical zones (ED-269)",
    "`rtshcua import FILE -o FILE.rts` makes zones of it",
)
KML: Final = FileKind("KML", "`rtshcua import FILE.kml -o FILE.rts` makes zones of it")
ARCHIVE: Final = FileKind("a ZIP archive", "extract the file that you need")
PDF: Final = FileKind("a PDF document", "")
HTML: Final = FileKind("a web page", "")
MARKDOWN: Final = FileKind("a Markdown document", "")
SCRIPT: Final = FileKind("a script", "")
EMPTY: Final = FileKind("an empty file", "it was not written completely: create or copy it again")
ULOG: Final = FileKind("a PX4 log (ULog)", "`rtshcua bind RUN FILE` binds it to the log of a run")
DATAFLASH: Final = FileKind("an ArduPilot log (DataFlash)", "`rtshcua bind RUN FILE` binds it to the log of a run")

_GEOMETRIES = "Point|MultiPoint|LineString|MultiLineString|Polygon|MultiPolygon|GeometryCollection"
_BEGINS: Final = (
    (re.compile(rb'\{"_prev":"'), LOG),
    (re.compile(rb'\s*\{[^{}]{0,200}"format":"rtshcua/log"'), LOG),
    (re.compile(rb"\x83.?.?rtshcua/bundle", re.DOTALL), BUNDLE),
    (re.compile(rb"rtshcua/[a-z]+-proof@|c2sp\.org/tlog-proof@"), PROOF),
    (re.compile(rb"\xd2\x84"), DOCUMENT),
    (re.compile(rb"duty: "), KEY),
    (re.compile(rb"ULog\x01\x12\x35"), ULOG),
    (re.compile(rb"\xa3\x95"), DATAFLASH),
    (re.compile(rb"PK\x03\x04"), ARCHIVE),
    (re.compile(rb"%PDF-"), PDF),
    (re.compile(rb"QGC WPL [0-9]+"), WAYPOINTS),
    (re.compile(rb"\s*<[^>]{0,200}>?\s*(?:<!--.{0,500}?-->\s*)?<kml\b|\s*<kml\b", re.DOTALL | re.IGNORECASE), KML),
    (re.compile(rb"\s*<(?:!doctype html|html)\b", re.IGNORECASE), HTML),
    (re.compile(rb"#!"), SCRIPT),
    (re.compile(rb"\s*#{1,6} \S"), MARKDOWN),
)
#: kinds of JSON objects by their content; the first match counts
_SAYS: Final = (
    (re.compile(rb'"format"\s*:\s*"rtshcua/mission-spec"'), SPECIFICATION),
    (re.compile(rb'"fileType"\s*:\s*"Plan"'), PLAN),
    (re.compile(rb'"type"\s*:\s*"Feature(?:Collection)?"'), GEOJSON),
    (re.compile(rb'"horizontalProjection"|"UASZoneList"'), ED269),
    (re.compile(rb'"type"\s*:\s*"(?:%b)"' % _GEOMETRIES.encode()), GEOJSON),
)


def recognised(data: bytes, name: str = "") -> FileKind | None:
    """Return the kind of a file by its first bytes, or else by its name's suffix; None if neither is known."""
    head = data[:LOOKED_AT].removeprefix(b"\xef\xbb\xbf")
    for pattern, kind in _BEGINS:
        if pattern.match(head):
            return kind
    if head.lstrip()[:1] == b"{":
        return next((kind for pattern, kind in _SAYS if pattern.search(head)), None)
    ending = name.rpartition(".")[2].lower()
    return {"rts": SOURCE, "md": MARKDOWN, "markdown": MARKDOWN}.get(ending)


def foreign(data: bytes, name: str = "") -> FileKind | None:
    """Return the kind of a file that is neither a source nor a specification; None if it may be one of them.

    A file named `.rts` that begins with `#` counts as a source: the parser reports the character in place.
    """
    found = recognised(data, name)
    called = name.endswith(".rts") and found in (MARKDOWN, SCRIPT)
    return None if called or found in (SOURCE, SPECIFICATION) else found
