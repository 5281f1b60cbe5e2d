"""What a file is, by how it begins: so that whoever hands in another kind than was asked for is told which one it is.

Only for messages: nothing is accepted for what is said here.
"""

import re
from typing import Final, NamedTuple

#: octets at the beginning of a file that are looked at
LOOKED_AT: Final = 1 << 13


class FileKind(NamedTuple):
    """What a file is, in words, and what is done with one; empty where nothing of ours is."""

    name: str
    help: str


BUNDLE: Final = FileKind(
    "a compiled bundle", "`rtshcua show` prints it, `rtshcua run` flies it; its source ends in `.rts`"
)
LOG: Final = FileKind("a log of a flight", "`rtshcua verify-log` proves it, `rtshcua why` explains it")
PROOF: Final = FileKind("a proof of a record", "`rtshcua verify-proof` verifies it")
DOCUMENT: Final = FileKind("a signed document", "`rtshcua show` says which")
KEY: Final = FileKind("a key", "`rtshcua show` says which; keep it to yourself")
SPECIFICATION: Final = FileKind("a mission specification", "`rtshcua compile FILE.json --with POLICY.rts` compiles it")
SOURCE: Final = FileKind("a source", "`rtshcua compile FILE.rts -o FILE.bundle` makes a bundle of it")
PLAN: Final = FileKind(
    "a plan of QGroundControl", "nothing reads plans: write the mission as a source, its fence and zones as `zone`"
)
WAYPOINTS: Final = FileKind("a list of waypoints (QGC WPL)", "nothing reads these: write the mission as a source")
GEOJSON: Final = FileKind("GeoJSON", 'a source reads it: `zone NAME from "FILE.geojson"`')
ED269: Final = FileKind(
    "a list of geographical zones (ED-269)", "nothing reads it: write each zone with its heights and times as `zone`"
)
KML: Final = FileKind("KML", 'convert it to GeoJSON, and read it from a source: `zone NAME from "FILE.geojson"`')
ARCHIVE: Final = FileKind("a ZIP archive", "take out of it what you mean")
PDF: Final = FileKind("a PDF document", "")
HTML: Final = FileKind("a web page", "")
MARKDOWN: Final = FileKind("a page of text (Markdown)", "")
SCRIPT: Final = FileKind("a script", "")
EMPTY: Final = FileKind("an empty file", "it was not written whole: make it again, or copy it again")
ULOG: Final = FileKind("a log of PX4 (ULog)", "a run writes `log.jsonl`: name that, or the run's folder")
DATAFLASH: Final = FileKind(
    "a log of ArduPilot (DataFlash)", "a run writes `log.jsonl`: name that, or the run's folder"
)

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
#: of JSON objects, by what stands in them; the first that fits
_SAYS: Final = (
    (re.compile(rb'"format"\s*:\s*"rtshcua/mission-spec"'), SPECIFICATION),
    (re.compile(rb'"fileType"\s*:\s*"Plan"'), PLAN),
    (re.compile(rb'"type"\s*:\s*"Feature(?:Collection)?"'), GEOJSON),
    (re.compile(rb'"horizontalProjection"|"UASZoneList"'), ED269),
    (re.compile(rb'"type"\s*:\s*"(?:%b)"' % _GEOMETRIES.encode()), GEOJSON),
)


def recognised(data: bytes, name: str = "") -> FileKind | None:
    """What a file is, by its first octets, or else by the end of its name; None where nothing tells."""
    head = data[:LOOKED_AT].removeprefix(b"\xef\xbb\xbf")
    for pattern, kind in _BEGINS:
        if pattern.match(head):
            return kind
    if head.lstrip()[:1] == b"{":
        return next((kind for pattern, kind in _SAYS if pattern.search(head)), None)
    ending = name.rpartition(".")[2].lower()
    return {"rts": SOURCE, "md": MARKDOWN, "markdown": MARKDOWN}.get(ending)


def foreign(data: bytes, name: str = "") -> FileKind | None:
    """What a file is that stands where a source or a specification is asked for; None where it may be one.

    One that is called a source may begin as a comment of other languages does: that is told where it stands.
    """
    found = recognised(data, name)
    called = name.endswith(".rts") and found in (MARKDOWN, SCRIPT)
    return None if called or found in (SOURCE, SPECIFICATION) else found
