"""Kinds of files are recognised by their first bytes, and shipped files are not mistaken."""

from pathlib import Path

from rtshcua.diagnostics import kinds
from rtshcua.diagnostics.kinds import FileKind, foreign, recognised
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[3]

BEGINNINGS: tuple[tuple[bytes, str, FileKind | None], ...] = (
    (b'{"fileType":"Plan","geoFence":{},"groundStation":"QGroundControl"}', "a.plan", kinds.PLAN),
    (b'{\n    "fileType": "Plan",\n', "a.json", kinds.PLAN),
    (b'{"type":"FeatureCollection","features":[]}', "a.geojson", kinds.GEOJSON),
    (b'\xef\xbb\xbf{"type": "Polygon", "coordinates": []}', "a.json", kinds.GEOJSON),
    (b'{"type":"Feature","properties":{"horizontalProjection":1}}', "a.json", kinds.GEOJSON),
    (b'{"features":[{"geometry":[{"horizontalProjection":{"type":"Polygon"}}]}]}', "a.json", kinds.ED269),
    (b'{"format": "rtshcua/mission-spec", "intent": "\\"fileType\\": \\"Plan\\""}', "a.json", kinds.SPECIFICATION),
    (b'{"a": 1}', "a.json", None),
    (b"QGC WPL 110\n0\t1\t0", "a.waypoints", kinds.WAYPOINTS),
    (b'<?xml version="1.0"?>\n<kml xmlns="x">', "a.kml", kinds.KML),
    (b"<!DOCTYPE html><html>", "a", kinds.HTML),
    (b"# Read me\n", "README.md", kinds.MARKDOWN),
    (b"Read me\n", "README.md", kinds.MARKDOWN),
    (b"#!/bin/sh\n", "a", kinds.SCRIPT),
    (b"PK\x03\x04", "a.kmz", kinds.ARCHIVE),
    (b"%PDF-1.4", "a", kinds.PDF),
    (b"ULog\x01\x12\x35\x01", "a.ulg", kinds.ULOG),
    (b"\xa3\x95\x80\x80", "a.bin", kinds.DATAFLASH),
    (b'{"_prev":"00"', "log.jsonl", kinds.LOG),
    (b"\x83nrtshcua/bundle\x01\x82", "a", kinds.BUNDLE),
    (b"rtshcua/record-proof@v1\n", "a", kinds.PROOF),
    (b"c2sp.org/tlog-proof@v1\n", "a", kinds.PROOF),
    (b"duty: policy\n", "a", kinds.KEY),
    (b"\xd2\x84X", "a", kinds.DOCUMENT),
    (b"skill a() { }", "a.rts", kinds.SOURCE),
    (b"skill a() { }", "a", None),
    (b"", "a", None),
)


@rows("data, name, kind", BEGINNINGS)
def test_kinds_are_recognised_by_their_first_bytes(data: bytes, name: str, kind: FileKind | None) -> None:
    assert recognised(data, name) is kind
    sources = (None, kinds.SOURCE, kinds.SPECIFICATION)
    assert (foreign(data, name) is None) is (kind in sources)


def test_source_that_begins_with_a_hash_is_not_markdown() -> None:
    assert foreign(b"# a comment\nskill a() { }", "a.rts") is None
    assert foreign(b"#!/usr/bin/env rtshcua\n", "a.rts") is None
    assert foreign(b'{"type": "Feature"}', "a.rts") is kinds.GEOJSON


def test_shipped_sources_are_recognised_as_sources() -> None:
    files = [
        path
        for folder in ("skills", "policies", "missions", "evaluation", "examples")
        for path in (CHECKOUT / folder).rglob("*")
    ]
    ours = [path for path in files if path.suffix == ".rts" or path.name == "proposal.json"]
    assert len(ours) > 20
    assert {
        path.name: foreign(path.read_bytes(), path.name) for path in ours if foreign(path.read_bytes(), path.name)
    } == {}
