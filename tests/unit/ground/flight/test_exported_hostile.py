"""Texts and values from outside that attack the readers of exported flights."""

import csv
import io
import json
import re
from collections.abc import Callable
from html import unescape
from itertools import pairwise
from pathlib import Path
from typing import Any

import gpxpy
import msgspec
import pytest
from fastkml import KML
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree
from mcap.reader import make_reader

from reference.exported_flight import export_of, run_in, telemetry_of, told, with_telemetry
from rtshcua.diagnostics.excerpt import visible
from rtshcua.ground.flight.export.csv_table import csv_table
from rtshcua.ground.flight.export.exported import (
    NO_TIME,
    FlightExport,
    decimal,
    number,
    utc_text,
    with_usable_track,
)
from rtshcua.ground.flight.export.geo_shapes import cut_line
from rtshcua.ground.flight.export.geojson_file import geojson
from rtshcua.ground.flight.export.gpx import gpx
from rtshcua.ground.flight.export.kml import kml
from rtshcua.ground.flight.export.mcap_file import mcap_file
from rtshcua.ground.flight.export.qgc_plan import qgc_plan
from rtshcua.ground.flight.flown import TrackPoint, VehicleText
from rtshcua.ground.flight.track import place_at
from rtshcua.model.flat.zone import HALF_TURN, TURN

#: what readers of XML, HTML, CSV, JSON and terminals could take for more than text
ATTACKS = (
    "<script>alert(1)</script>", "]]>", "<![CDATA[", "&xxe;", "<!DOCTYPE x>", "\x00\x01\x1b[31m", "\u202egnp.exe",
    "\ufffe\uffff", "\ud800", "'\"", "=1+1", "@SUM(A1)", "a\r\nb", "\u2028", "%s{}", "\\u0000", "$[name]", "-" * 3_000,
)  # fmt: skip
TEXTS = st.sampled_from(ATTACKS) | st.text(st.characters(), max_size=40)


@pytest.fixture(scope="module")
def export(tmp_path_factory: pytest.TempPathFactory) -> FlightExport:
    whole = export_of(run_in(tmp_path_factory.mktemp("hostile") / "run"))
    return with_telemetry(whole, track=telemetry_of(whole).track[:12])


def hostile(export: FlightExport, text: str) -> FlightExport:
    """The flight with this text wherever a text can come from outside."""
    flight, telemetry = export.flight, telemetry_of(export)
    mission = msgspec.structs.replace(flight.mission, name=text, intent=text)
    zones = tuple(msgspec.structs.replace(each, name=text) for each in flight.policy.zones)
    policy = msgspec.structs.replace(flight.policy, name=text, zones=zones)
    genesis = msgspec.structs.replace(flight.genesis, vehicle=text)
    signals = tuple(
        each._replace(name=f"{text}{number}", labels={1: text}, points=((0, 1),), stale_us=10**9)
        for number, each in enumerate(telemetry.signals)
    )
    telemetry = telemetry._replace(texts=(VehicleText(0, 300, text),), signals=signals)
    records = (told(text, name=text, reason=text), told(text, is_decision=False, name=text, step=-1))
    return export._replace(
        flight=flight._replace(genesis=genesis, policy=policy, mission=mission, telemetry=telemetry),
        told=records,
        log_status=text,
    )


def plan(export: FlightExport) -> bytes:
    return qgc_plan(export, ())[0]


@given(TEXTS)
def test_every_text_format_stays_well_formed_and_shows_the_text(export: FlightExport, text: str) -> None:
    evil, plain = hostile(export, text), visible(text)
    for make in (kml, gpx, geojson, csv_table, plan):
        document = make(evil).decode()
        assert all(visible(line) == line for line in re.split("\r?\n", document)), make
    parser = etree.XMLParser(resolve_entities=False, no_network=True)
    root = etree.fromstring(kml(evil), parser)
    assert root.getroottree().docinfo.doctype == ""
    document_name = KML.parse(io.BytesIO(kml(evil))).features[0].name
    assert document_name == f"{plain} of {plain}".strip() or plain.strip() != plain
    for description in root.iter("{http://www.opengis.net/kml/2.2}description"):
        assert not re.search(r"<(?!br/>)", description.text or ""), "Google Earth shows it as HTML"
    assert plain in unescape(next(root.iter("{http://www.opengis.net/kml/2.2}description")).text or "")
    found = gpxpy.parse(gpx(evil).decode())
    assert (found.waypoints[0].description or "").strip() == plain.strip()
    [decision] = [each for each in json.loads(geojson(evil))["features"] if each["properties"]["kind"] == "decision"]
    assert decision["properties"]["words"] == plain
    assert plain in "\n".join(json.loads(plan(evil))["rtshcua"]["description"])


@given(TEXTS)
def test_no_cell_of_a_table_is_a_formula(export: FlightExport, text: str) -> None:
    rows = list(csv.reader(io.StringIO(csv_table(hostile(export, text)).decode(), newline="")))
    assert len({len(row) for row in rows}) == 1
    for row in rows:
        for cell in row:
            is_number = re.fullmatch(r"-?[0-9]+(\.[0-9]+)?", cell)
            assert is_number or not cell.lstrip().startswith(tuple("=+-@＝＋－＠")), cell


@given(TEXTS)
def test_mcap_holds_any_text(export: FlightExport, text: str) -> None:
    data = mcap_file(hostile(export, text))
    found = make_reader(io.BytesIO(data)).iter_messages(topics=["/texts"])
    texts = [json.loads(message.data) for _, _, message in found]
    assert [(each["message"], each["level"]) for each in texts] == [(visible(text), 0)]


POINTS = st.builds(
    TrackPoint,
    st.integers(-(2**63), 2**64),
    *[st.integers(-(2**31), 2**31 - 1)] * 4,
    st.none() | st.integers(-(2**40), 2**40),
    *[st.integers(-327_680, 327_670)] * 3,
    st.none() | st.integers(0, 65_534),
)


@given(st.lists(POINTS, max_size=8))
def test_any_telemetry_is_exported_or_left_out(export: FlightExport, track: list[TrackPoint]) -> None:
    raw = with_telemetry(export, track=tuple(track), home=None)
    flight, dropped = with_usable_track(raw.flight)
    usable = raw._replace(flight=flight)
    assert len(usable.track) + dropped == len(track)
    makers: list[Callable[[FlightExport], Any]] = [kml, gpx, geojson, csv_table, mcap_file, plan]
    for make in makers:
        make(usable)
    gpxpy.parse(gpx(usable).decode())


@given(st.integers(-(10**15), 10**15), st.integers(0, 9))
def test_decimals_are_exact(value: int, digits: int) -> None:
    text = decimal(value, digits)
    assert int(text.replace(".", "")) == value
    assert len(text.partition(".")[2]) == digits
    assert number(value, digits) == float(text)


@given(st.integers(0, NO_TIME - 1))
def test_times_are_exact(us: int) -> None:
    text = utc_text(us)
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}Z", text)
    assert int(text[20:26]) == us % 1_000_000
    assert utc_text(us, 3) == f"{text[:23]}Z"


@given(st.lists(st.tuples(st.integers(-HALF_TURN, HALF_TURN), st.integers(-900, 900)), min_size=1, max_size=12))
def test_a_cut_line_never_passes_longitude_180_and_keeps_its_places(points: list[tuple[int, int]]) -> None:
    parts = cut_line(points)
    for part in parts:
        assert all(abs(one[0] - other[0]) <= HALF_TURN for one, other in pairwise(part))
        assert all(abs(each[0]) <= HALF_TURN for each in part)

    def same(one: tuple[int, ...], other: tuple[int, ...]) -> bool:
        return one[1:] == other[1:] and (one[0] - other[0]) % TURN == 0

    kept = [each for part in parts for each in part]
    assert all(any(same(point, each) for each in kept) for point in points)
    inserted = [each for each in kept if each not in points]
    assert all(abs(each[0]) == HALF_TURN for each in inserted)


@given(st.lists(st.integers(0, 1_000), min_size=1, max_size=20), st.integers(-100, 1_100))
def test_the_place_of_a_time_is_the_nearest(times: list[int], at: int) -> None:
    track = [TrackPoint(each, 1, 1, 0, 0, None, 0, 0, 0, None) for each in sorted(times)]
    found = place_at(track, at)
    assert found is not None
    assert abs(found.off_us) == min(abs(each - at) for each in times)
    assert place_at([], at) is None


def test_export_is_reproducible(export: FlightExport, tmp_path: Path) -> None:
    for make in (kml, gpx, geojson, csv_table, plan, mcap_file):
        assert make(export) == make(export)
