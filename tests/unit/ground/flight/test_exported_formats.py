"""Exported flights, each read by a library that is not ours, and compared with telemetry that pymavlink decoded."""

import csv
import io
import json
from html import unescape
from itertools import pairwise
from pathlib import Path
from typing import Any

import geojson as geojson_library
import gpxpy
import msgspec
import pytest
from fastkml import KML
from fastkml import kml as fast
from fastkml.gx import MultiTrack, Track
from fastkml.validator import validate
from jsonschema import Draft202012Validator
from lxml import etree
from mcap.reader import make_reader
from shapely.geometry import shape

from reference.exported_flight import (
    by_pymavlink,
    export_of,
    moved,
    run_in,
    telemetry_of,
    told,
    with_telemetry,
)
from rtshcua.ground.flight.export.csv_table import csv_table
from rtshcua.ground.flight.export.exported import FlightExport
from rtshcua.ground.flight.export.geo_shapes import planned_path
from rtshcua.ground.flight.export.geojson_file import geojson
from rtshcua.ground.flight.export.gpx import gpx
from rtshcua.ground.flight.export.kml import kml
from rtshcua.ground.flight.export.mcap_file import mcap_file
from rtshcua.ground.flight.export.whole_tlog import whole_tlog
from rtshcua.ground.flight.flown import VehicleText

_KML = "{http://www.opengis.net/kml/2.2}"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run_in(tmp_path_factory.mktemp("export") / "20260101T000000Z-short")


@pytest.fixture(scope="module")
def export(run: Path) -> FlightExport:
    return export_of(run)


@pytest.fixture(scope="module")
def positions(run: Path) -> list[Any]:
    found = by_pymavlink(run / "telemetry.tlog", "GLOBAL_POSITION_INT")
    assert len(found) > 500
    return found


@pytest.fixture(autouse=True)
def exact(monkeypatch: pytest.MonkeyPatch) -> None:
    """The library `geojson` rounds what it reads to 6 decimals otherwise, which is 11 cm."""
    monkeypatch.setattr(geojson_library.geometry, "DEFAULT_PRECISION", 9)


#: beyond longitude 180 (home at 179.9998 E); south of the equator, west of Greenwich; and by the north pole
PLACES = {
    "here": (0, 0), "antimeridian": (0, 1_714_542_000), "south": (-800_000_000, -1_500_000_000),
    "pole": (425_990_000, 1_714_542_000),
}  # fmt: skip


@pytest.fixture(params=list(PLACES))
def anywhere(request: pytest.FixtureRequest, export: FlightExport) -> FlightExport:
    return moved(export, *PLACES[request.param])


# ---------------------------------------------------------------- KML


def placemarks(data: bytes) -> list[Any]:
    found: list[Any] = []

    def walk(features: Any) -> None:
        for each in features:
            if isinstance(each, fast.Folder | fast.Document):
                walk(each.features)
            else:
                found.append(each)

    walk(document(data).features)
    return found


def document(data: bytes) -> Any:
    """Read KML by fastkml; its `from_string` takes no XML declaration."""
    return KML.parse(io.BytesIO(data))


def test_kml_has_the_track_in_time_above_the_sea(export: FlightExport, positions: list[Any]) -> None:
    root = etree.fromstring(kml(export))
    gx = "{http://www.google.com/kml/ext/2.2}Track"
    [found] = root.iter(gx)
    assert found.findtext(f"{_KML}altitudeMode") == "absolute"
    whens = [each.text for each in found.iter(f"{_KML}when")]
    coords = [each.text for each in found.iter("{http://www.google.com/kml/ext/2.2}coord")]
    assert len(whens) == len(coords) == len(positions)
    for coord, message in zip(coords, positions, strict=True):
        longitude, latitude, height = map(float, coord.split())
        assert (round(latitude * 1e7), round(longitude * 1e7), round(height * 1e3)) == (
            message.lat,
            message.lon,
            message.alt,
        )
    assert whens == sorted(whens)
    assert all(each.endswith("Z") for each in whens)


def test_kml_is_read_by_fastkml(anywhere: FlightExport) -> None:
    found = {each.name: each for each in placemarks(kml(anywhere))}
    assert {"home", "track", "planned path", "city", "bridge_a", "school"} <= set(found)
    tracks = found["track"].kml_geometry
    assert isinstance(tracks, Track | MultiTrack)
    home = found["home"].geometry
    assert abs(home.x) <= 180
    assert home.z == 488
    steps = [each for name, each in found.items() if name.startswith("step ")]
    assert len(steps) == 3
    assert all(each.time_stamp is not None for each in steps)


def test_kml_follows_its_schema(anywhere: FlightExport, tmp_path: Path) -> None:
    path = tmp_path / "flight.kml"
    path.write_bytes(kml(anywhere))
    assert validate(file_to_validate=path)
    path.write_bytes(kml(anywhere).replace(b"clampToGround", b"somewhere"))
    with pytest.raises(AssertionError):
        validate(file_to_validate=path)


def test_kml_zone_heights_name_their_datum(export: FlightExport) -> None:
    known = {each.name: each for each in placemarks(kml(export))}["bridge_a"]
    ceiling = export.flight.policy.zones[1].ceiling
    assert (
        f"{ceiling / 1_000:.3f} m above home ({ceiling / 1_000 + 488:.3f} m above mean sea level)" in known.description
    )
    blind = with_telemetry(export, home=None, track=())
    modes = {each.text for each in etree.fromstring(kml(blind)).iter(f"{_KML}altitudeMode")}
    assert modes == {"relativeToGround", "clampToGround"}
    assert b"home's height is not known" in kml(blind)


def test_a_gap_is_not_joined(export: FlightExport) -> None:
    track = telemetry_of(export).track
    gap = with_telemetry(export, track=track[:100] + track[300:])
    root = etree.fromstring(kml(gap))
    assert len([*root.iter("{http://www.google.com/kml/ext/2.2}Track")]) == 2
    assert len(gpxpy.parse(gpx(gap).decode()).tracks[0].segments) == 2
    assert sum(each["properties"]["kind"] == "track" for each in json.loads(geojson(gap))["features"]) == 2


# ---------------------------------------------------------------- GPX


def test_gpx_is_read_by_gpxpy(export: FlightExport, positions: list[Any]) -> None:
    found = gpxpy.parse(gpx(export).decode())
    assert found.version == "1.1"
    points = [each for each, *_ in found.walk()]
    assert len(points) == len(positions)
    for point, message in zip(points, positions, strict=True):
        assert (round(point.latitude * 1e7), round(point.longitude * 1e7)) == (message.lat, message.lon)
        assert round(point.elevation * 1e3) == message.alt
        assert abs(point.time.timestamp() - message._timestamp) < 0.0011
    assert [each.name for each in found.waypoints] == ["step 1: allow", "step 2: allow", "step 3: allow"]
    assert "above mean sea level" in found.description


# ---------------------------------------------------------------- GeoJSON


def features(data: bytes) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    for each in geojson_library.loads(data.decode())["features"]:
        found.setdefault(each["properties"]["kind"], []).append(each)
    return found


def places_of(coordinates: Any) -> list[list[float]]:
    if isinstance(coordinates[0], int | float):
        return [coordinates]
    return [place for each in coordinates for place in places_of(each)]


def test_geojson_is_valid_and_its_rings_follow_the_right_hand_rule(anywhere: FlightExport) -> None:
    loaded = geojson_library.loads(geojson(anywhere).decode())
    assert loaded.errors() == [] or not any(loaded.errors())
    for each in loaded["features"]:
        for place in places_of(each["geometry"]["coordinates"]):
            assert len(place) == 2, "RFC 7946 means the ellipsoid by a third value"
            assert abs(place[0]) <= 180
            assert abs(place[1]) <= 90
        geometry = shape(each["geometry"])
        if each["properties"]["kind"] == "zone":
            assert geometry.is_valid
            for polygon in getattr(geometry, "geoms", [geometry]):
                assert polygon.exterior.is_ccw
                assert not any(hole.is_ccw for hole in polygon.interiors)


def test_nothing_passes_longitude_180(export: FlightExport) -> None:
    found = features(geojson(moved(export, *PLACES["antimeridian"])))
    assert len(found["track"]) > 1
    assert any(each["geometry"]["type"] == "MultiPolygon" for each in found["zone"])
    for each in [*found["track"], *found["planned_path"]]:
        for (one, _), (other, _) in pairwise(each["geometry"]["coordinates"]):
            assert abs(one - other) < 1
    ends = {abs(each["geometry"]["coordinates"][-1][0]) for each in found["track"][:-1]}
    assert ends == {180.0}
    for zone in found["zone"]:
        for polygon in getattr(shape(zone["geometry"]), "geoms", [shape(zone["geometry"])]):
            assert polygon.bounds[2] - polygon.bounds[0] < 1


def test_planned_path_is_that_of_the_drawings(export: FlightExport) -> None:
    """A return from above home only descends, also below the height of returns."""
    policy, mission = export.flight.policy, export.flight.mission
    climb, home = mission.invocations[0], mission.invocations[-1]
    above = msgspec.structs.replace(mission, invocations=(climb, home))
    flight = export.flight._replace(
        mission=above,
        policy=msgspec.structs.replace(policy, vehicle=msgspec.structs.replace(policy.vehicle, return_altitude=30_000)),
    )
    assert climb.plan.altitude < 30_000
    assert [each.above_home for each in planned_path(flight)] == [0, climb.plan.altitude, 0]


def test_a_cut_keeps_the_area(export: FlightExport) -> None:
    whole, cut = (features(geojson(each))["zone"] for each in (export, moved(export, *PLACES["antimeridian"])))
    for one, other in zip(whole, cut, strict=True):
        assert shape(one["geometry"]).area == pytest.approx(shape(other["geometry"]).area, rel=1e-6)


def test_geojson_heights_are_properties_with_their_datum(export: FlightExport, positions: list[Any]) -> None:
    [track] = features(geojson(export))["track"]
    said = track["properties"]
    assert [round(each * 1_000) for each in said["above_sea_m"]] == [each.alt for each in positions]
    assert [round(each * 1_000) for each in said["above_home_m"]] == [each.relative_alt for each in positions]
    assert len(track["geometry"]["coordinates"]) == len(said["time_utc"]) == len(said["t_s"]) == len(positions)
    city = next(each for each in features(geojson(export))["zone"] if each["properties"]["name"] == "city")
    assert city["properties"]["airspace"] == "inside"
    assert {"floor_above_home_m", "ceiling_above_home_m", "radius_m"} <= set(city["properties"])


# ---------------------------------------------------------------- CSV


def table(data: bytes) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(data.decode(), newline="")))


def test_csv_has_the_track_and_the_signals(export: FlightExport, positions: list[Any]) -> None:
    data = csv_table(export)
    assert data.count(b"\r\n") == data.count(b"\n")
    rows = table(data)
    assert len(rows) == len(positions)
    for row, message in zip(rows, positions, strict=True):
        exact = {
            "latitude_deg": f"{message.lat / 1e7:.7f}", "longitude_deg": f"{message.lon / 1e7:.7f}",
            "above_sea_m": f"{message.alt / 1e3:.3f}", "above_home_m": f"{message.relative_alt / 1e3:.3f}",
            "speed_down_m_s": f"{message.vz / 100:.3f}",
        }  # fmt: skip
        assert {name: row[name].replace("-0.000", "0.000") for name in exact} == {
            name: each.replace("-0.000", "0.000") for name, each in exact.items()
        }
        assert row["log"] == "not verified"
        assert None not in row.values()
    words = [record for row in rows for record in row["records"].split("; ") if record]
    assert sum(each.startswith("allow step") for each in words) == 3


def test_csv_signals_are_those_of_the_policy_with_their_units(run: Path, export: FlightExport) -> None:
    rows = table(csv_table(export))
    charges = by_pymavlink(run / "telemetry.tlog", "BATTERY_STATUS")
    begun_s = export.flight.genesis.utc_us / 1e6
    for row in rows[50::97]:
        before = [each for each in charges if each._timestamp - begun_s <= float(row["t_s"]) + 1e-5]
        [column] = [name for name in row if name.endswith("_percent") and "battery" in name]
        assert float(row[column]) == before[-1].battery_remaining
    assert any(name.endswith("above_home_m") and name.startswith("signal.") for name in rows[0])


@pytest.mark.parametrize("begin", ["=", "+", "-", "@", "\t=", "＝", " =", "\r@"])
def test_csv_defuses_formulas(export: FlightExport, begin: str) -> None:
    evil = f'{begin}HYPERLINK("http://x")'
    rows = table(csv_table(export._replace(told=(told(evil),))))
    [cell] = {row["records"] for row in rows} - {""}
    assert not cell.lstrip().startswith(tuple("=+-@＝"))
    assert "HYPERLINK" in cell


# ---------------------------------------------------------------- MCAP


def messages(data: bytes) -> dict[str, list[tuple[Any, int, Any]]]:
    found: dict[str, list[tuple[Any, int, Any]]] = {}
    validators: dict[int, Draft202012Validator] = {}
    for schema, channel, message in make_reader(io.BytesIO(data)).iter_messages():
        assert schema is not None
        assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
        content = json.loads(message.data)
        if schema.id not in validators:
            validators[schema.id] = Draft202012Validator(json.loads(schema.data))
        validators[schema.id].validate(content)
        assert message.log_time == message.publish_time
        found.setdefault(channel.topic, []).append((schema, message.log_time, content))
    return found


def test_mcap_messages_follow_their_schemas(export: FlightExport, positions: list[Any]) -> None:
    found = messages(mcap_file(with_telemetry(export, texts=(VehicleText(5, 4, "Low\x00 \u202e battery"),))))
    fixes = found["/location"]
    assert fixes[0][0].name == "foxglove.LocationFix"
    assert len(fixes) == len(positions)
    for (_, time_ns, fix), message in zip(fixes, positions, strict=True):
        assert (round(fix["latitude"] * 1e7), round(fix["longitude"] * 1e7)) == (message.lat, message.lon)
        assert round(fix["altitude"] * 1_000) == message.alt
        assert fix["timestamp"]["sec"] * 10**9 + fix["timestamp"]["nsec"] == time_ns
        assert abs(time_ns / 1e9 - message._timestamp) < 1e-5
    [(schema, _, text)] = found["/texts"]
    assert (schema.name, text["level"], text["message"]) == ("foxglove.Log", 3, "Low<U+0000> <U+202E> battery")
    assert [each["step_number"] for _, _, each in found["/decisions"]] == [1, 2, 3]
    assert {"percent"} <= set(found["/signals/battery"][-1][2])
    reader = make_reader(io.BytesIO(mcap_file(export)))
    [metadata] = reader.iter_metadata()
    assert metadata.metadata["log"] == "not verified: a test"


def test_mcap_is_reproducible(export: FlightExport) -> None:
    assert mcap_file(export) == mcap_file(export)


def test_an_unknown_value_is_absent(export: FlightExport) -> None:
    signal = telemetry_of(export).signals[0]._replace(points=((0, None), (1, 1_500)))
    found = messages(mcap_file(with_telemetry(export, signals=(signal,))))
    [topic] = [each for each in found if each.startswith("/signals")]
    assert [len(each) for _, _, each in found[topic]] == [0, 1]


# ---------------------------------------------------------------- tlog


def test_tlog_is_cut_after_its_last_whole_frame(run: Path, tmp_path: Path) -> None:
    data = (run / "telemetry.tlog").read_bytes()
    assert whole_tlog(data).data == data
    for lost in (1, 7, 20):
        cut = whole_tlog(data[:-lost])
        assert len(cut.data) + cut.left_out == len(data) - lost
        path = tmp_path / "cut.tlog"
        path.write_bytes(cut.data)
        assert len(by_pymavlink(path)) == cut.frames
    assert whole_tlog(b"no telemetry").frames == 0


def test_descriptions_name_the_status_of_the_log(export: FlightExport) -> None:
    assert "log: not verified: a test" in unescape(document(kml(export)).features[0].description)
    assert "log: not verified: a test" in gpxpy.parse(gpx(export).decode()).description
    assert "log: not verified: a test" in json.loads(geojson(export))["description"]
