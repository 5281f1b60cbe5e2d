"""`import` of zones: heights by datum, hours, circles and restrictions are those of the file, or a zone is refused."""

from pathlib import Path
from typing import Any

import pytest

from reference.exported_flight import export_of, run_in
from reference.zone_files import (
    CIRCLE,
    SQUARE,
    ed269,
    ed269_zone,
    ed318,
    faa,
    geojson,
    kml,
    kmz,
    layer,
    mark,
    openaip,
    polygon,
    volume,
    write,
)
from rtshcua.app.importing import ImportedSource, ImportRequest, import_file
from rtshcua.app.programs import examine, read_text
from rtshcua.diagnostics.diagnostic import has_errors
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.flight.export.geo_shapes import zone_shapes
from rtshcua.ground.flight.export.kml import kml as exported_kml
from rtshcua.ground.format.format_text import format_text

SITE = {"terrain": "400..460", "clock": "+02:00"}
DATES = {"startDateTime": "2026-06-01T08:00:00+02:00", "endDateTime": "2026-06-30T20:00:00.5Z"}


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def found_in(value: Any, name: str = "zones.json", **request: Any) -> ImportedSource:
    found = import_file(ImportRequest(write(Path(), value, name), **request))
    assert isinstance(found, ImportedSource), found
    return found


def items(value: Any, name: str = "zones.json", **request: Any) -> list[str]:
    """The zones of a source, each on one line, without its name and its shape."""
    found = found_in(value, name, **request)
    if found.not_kept:
        return [f"refused: {each.why}" for each in found.not_kept]
    assert not has_errors(found.diagnostics), found.diagnostics
    assert format_text(found.text) == found.text
    declared = "\n".join(line for line in found.text.splitlines() if not line.startswith("//")).split("zone ")[1:]
    lines = [" ".join(each.split()) for each in declared]
    return [line[line.rindex(")") + 1 :].strip() for line in lines]


def schedule(*days: str, begin: str = "08:00:00.00Z", end: str = "18:00:00.00Z") -> list[dict[str, Any]]:
    return [{"permanent": "NO", **DATES, "schedule": [{"day": list(days), "startTime": begin, "endTime": end}]}]


MONTH = 'active "2026-06-01T06:00:00Z" .. "2026-06-30T20:00:01Z"'
UP = "ceiling 600 m above sea"
#: a file of ED-269, and the items of its zones
ED269: list[tuple[str, dict[str, Any], list[str]]] = [
    ("above sea", {}, [UP]),
    ("a floor above sea", {"geometry": [volume(lowerLimit=500.5, lowerVerticalReference="AMSL")]},
     [f"floor 500.5 m above sea {UP}"]),
    ("feet", {"geometry": [volume(uomDimensions="FT", upperLimit=2000)]}, ["ceiling 609.6 m above sea"]),
    ("a ceiling above ground", {"geometry": [volume(upperLimit=120, upperVerticalReference="AGL")]},
     ["ceiling 580 m above sea"]),
    ("a floor above ground", {"geometry": [volume(lowerLimit=50)]}, [f"floor 450 m above sea {UP}"]),
    ("no ceiling", {"geometry": [volume(upperLimit=99999)]}, [""]),
    ("no limits", {"geometry": [volume(upperLimit=None, lowerLimit=None)]}, [""]),
    ("two volumes", {"geometry": [volume(), volume(CIRCLE)]}, [UP, UP]),
    ("a month", {"applicability": [{"permanent": "NO", **DATES}]}, [f"{UP} {MONTH}"]),
    ("from a day on", {"applicability": [{"permanent": "NO", "startDateTime": DATES["startDateTime"]}]},
     [f'{UP} active "2026-06-01T06:00:00Z" .. "2100-01-01T00:00:00Z"']),
    ("hours", {"applicability": schedule("MON", "TUE")}, [f"{UP} {MONTH} active 10:00 .. 20:00 on monday, tuesday"]),
    ("hours that are the next day here", {"applicability": schedule("SUN", begin="22:30Z", end="23:15:30Z")},
     [f"{UP} {MONTH} active 00:30 .. 01:16 on monday"]),
    ("a day whose hours begin on the day before in UTC",
     {"applicability": schedule("MON", begin="01:00+02:00", end="05:00+02:00")},
     [f"{UP} {MONTH} active 01:00 .. 05:00 on monday"]),
    ("whole days of the vehicle's clock", {"applicability": schedule("SUN", begin="00:00+02:00", end="24:00+02:00")},
     [f"{UP} {MONTH} active on sunday"]),
    ("from the end of a day", {"applicability": schedule("SUN", begin="24:00Z", end="03:00Z")},
     [f"{UP} {MONTH} active 02:00 .. 05:00 on monday"]),
    ("an hour that no day has", {"applicability": schedule("SUN", begin="25:00Z", end="29:00Z")},
     ["refused: a time of day does not exist"]),
    ("a time after the end of the day", {"applicability": schedule("SUN", end="24:00:30Z")},
     ["refused: a time of day does not exist"]),
    ("an offset that no place has", {"applicability": schedule("SUN", begin="08:00+29:00")},
     ["refused: a time of day does not exist"]),
    ("every day", {"applicability": schedule("ANY", begin="06:00+02:00", end="20:00+02:00")},
     [f"{UP} {MONTH} active 06:00 .. 20:00"]),
    ("two windows", {"applicability": schedule("MON") + schedule("SAT")},
     [f"{UP} {MONTH} active 10:00 .. 20:00 on monday", f"{UP} {MONTH} active 10:00 .. 20:00 on saturday"]),
    ("sunrise", {"applicability": [{"permanent": "NO", "schedule": [{"day": ["ANY"], "startEvent": "SR"}]}]},
     ["refused: it begins or ends with the light of the day, whose times are not known"]),
    ("no times", {"applicability": [{"permanent": "NO"}]}, ["refused: its times are not stated"]),
    ("a date without an offset", {"applicability": [{"permanent": "NO", "startDateTime": "2026-06-01T08:00:00"}]},
     ["refused: a moment does not say its offset from UTC"]),
    ("above the ellipsoid", {"geometry": [volume(upperVerticalReference="WGS84")]}, ["refused: it is not valid"]),
    ("upside down", {"geometry": [volume(lowerLimit=700, lowerVerticalReference="AMSL")]},
     ["refused: its lower limit is not below its upper limit"]),
    ("an unknown restriction", {"restriction": "MAYBE"}, ["refused: its `restriction` is not a kind of restriction"]),
    ("no geometry", {"geometry": []}, ["refused: it has no geometry"]),
    ("a circle without a radius", {"geometry": [volume({"type": "Circle", "center": [8.5, 47.3]})]},
     ["refused: its circle has no centre or no radius"]),
    ("an open ring", {"geometry": [volume({"type": "Polygon", "coordinates": [SQUARE[:-1]]})]}, ["refused: the ring"]),
]  # fmt: skip


def test_unknown_restriction_is_told_the_known_ones() -> None:
    pytest.importorskip("uas_standards", reason="the extra `import` is not installed")
    (refused,) = found_in(ed269(restriction="MAYBE"), **SITE).not_kept
    assert refused.help == "accepted: `PROHIBITED`, `REQ_AUTHORISATION`, `CONDITIONAL`, `NO_RESTRICTION`"


def test_date_of_no_known_form_is_told_without_a_cut_list_of_forms() -> None:
    pytest.importorskip("uas_standards", reason="the extra `import` is not installed")
    changed = {"applicability": [{"permanent": "NO", "startDateTime": "01.06.2026"}]}
    (refused,) = found_in(ed269(**changed), **SITE).not_kept
    assert refused.why.startswith("it is not valid: ")
    assert "01.06.2026" in refused.why
    assert "YYYY" not in refused.why


def test_zones_of_ed269() -> None:
    pytest.importorskip("uas_standards", reason="the extra `import` is not installed")
    wrong = []
    for name, changed, expected in ED269:
        got = items(ed269(**changed), **SITE)
        if len(got) != len(expected) or not all(map(str.startswith, got, expected)):
            wrong.append((name, got))
    assert not wrong


def test_what_the_site_does_not_state_is_refused() -> None:
    pytest.importorskip("uas_standards", reason="the extra `import` is not installed")
    above_ground = ed269(geometry=[volume(upperLimit=120, upperVerticalReference="AGL")])
    assert items(above_ground) == ["refused: its height is above ground, and the ground is not known"]
    assert items(ed269(applicability=schedule("MON"))) == [
        "refused: its hours are in UTC, and the vehicle's clock is not known"
    ]
    both = {"features": [ed269_zone(), ed269_zone(identifier="XX-9", geometry=above_ground["features"][0]["geometry"])]}
    found = found_in(both)
    assert (found.code, found.text, found.not_kept[0].name) == (ExitCode.DIAGNOSTICS, "", "XX-9 Power plant")
    left = found_in(both, skip=("XX-9 Power plant",))
    assert (left.zones, [each.place for each in left.left_out]) == (1, ["/features/1/geometry/0"])


def test_restrictions_become_rules_that_a_policy_can_have() -> None:
    pytest.importorskip("uas_standards", reason="the extra `import` is not installed")
    kinds = ("PROHIBITED", "REQ_AUTHORISATION", "CONDITIONAL", "NO_RESTRICTION")
    zones = [ed269_zone(identifier=kind, restriction=kind, restrictionConditions="below 50 m" * (kind == "CONDITIONAL"))
             for kind in kinds]  # fmt: skip
    found = found_in({"features": zones})
    assert {each.name for each in found.losses} == {"authority", "conditions"}
    assert found.rules[0] == (
        "airspace outside prohibited_power_plant, req_authorisation_power_plant, conditional_power_plant"
    )
    assert found.rules[1:] == (
        "forbid goto by any when target inside req_authorisation_power_plant",
        "forbid goto by any when target inside conditional_power_plant",
    )
    assert all(f"// For a policy: {rule}" in found.text for rule in found.rules)
    rules = "\n".join(
        ("  permit goto by role operator", "  permit hover, return_home, emergency_land by any", *found.rules)
    )
    libs = "".join(
        f'import "lib:skills/{each}.rts"\n' for each in ("signals", "goto", "hover", "return_home", "emergency_land")
    )
    policy = f"policy p version 1 {{\n{rules}\n contingency hover for 10 s, return_home, emergency_land\n}}\n"
    checked = examine(read_text("policy.rts", f"{libs}{found.text}{policy}"))
    assert not has_errors(checked.diagnostics), checked.diagnostics


def test_zones_of_ed318() -> None:
    pytest.importorskip("uas_standards", reason="the extra `import` is not installed")
    point = {"type": "Point", "coordinates": [8.545, 47.398], "extent": {"subType": "Circle", "radius": 250.5}}
    two = [
        {"type": "Polygon", "coordinates": [SQUARE], "layer": layer()},
        point | {"layer": layer(uom="ft", upper=2000)},
    ]
    period = {"startDateTime": "2026-06-01T00:00Z", "endDateTime": "2026-06-02T00:00Z"}
    assert items(ed318()) == [UP]
    assert items(ed318(point | {"layer": layer(upper=120, upperReference="AGL")}), **SITE) == [
        "ceiling 580 m above sea"
    ]
    assert items(ed318({"type": "GeometryCollection", "geometries": two})) == [UP, "ceiling 609.6 m above sea"]
    assert items(ed318(limitedApplicability=[period])) == [
        f'{UP} active "2026-06-01T00:00:00Z" .. "2026-06-02T00:00:00Z"'
    ]
    assert items(ed318({"type": "Polygon", "coordinates": [SQUARE]})) == [""]
    assert items(ed318(two[0] | {"layer": layer(upperReference="WGS84")})) == ["refused: its height is above WGS84"]
    assert items(ed318({"type": "Point", "coordinates": [8.5, 47.3]}))[0].startswith("refused: it is a point")
    assert items(ed318({"type": "LineString", "coordinates": SQUARE}))[0].startswith("refused: its geometry")
    assert items(ed318(type="FORBIDDEN"))[0].startswith("refused: its `type`")
    assert "circle(47.3980000 N, 8.5450000 E, 250.5 m)" in found_in(ed318(point)).text


def test_ed269_as_properties_of_geojson() -> None:
    pytest.importorskip("uas_standards", reason="the extra `import` is not installed")
    limits = {name: value for name, value in volume().items() if name != "horizontalProjection"}
    feed = geojson(ed269_zone(geometry=limits | {"upperLimit": 120, "upperVerticalReference": "AGL"}))
    assert items(feed, "feed.geojson", **SITE) == ["ceiling 580 m above sea"]
    assert "hole (" in found_in(feed, "feed.geojson", **SITE).text
    assert items(geojson(ed269_zone(geometry=limits), "LineString", SQUARE))[0].startswith("refused: it is not valid")


#: GeoJSON of other feeds
FEEDS: list[tuple[str, Any, list[str]]] = [
    ("a plain area", geojson({"name": "field"}), [""]),
    ("a height that nobody reads", geojson({"maxAltitude": 100}), ["refused: it has members"]),
    ("a time that nobody reads", geojson({"validFrom": "2026-01-01"}), ["refused: it has members"]),
    ("a line", geojson(kind="LineString", coordinates=SQUARE[:3]), ["refused: it is a line"]),
    ("a point with a radius", geojson({"radius": 500}, "Point", [8.5, 47.3]), ["refused: it has members"]),
    ("positions with heights", geojson(coordinates=[[[*each, 5] for each in SQUARE]]), ["refused: the position"]),
    ("no geometry", {"type": "FeatureCollection", "features": [{"type": "Feature", "properties": {}}]},
     ["refused: it has no geometry"]),
    ("OpenAIP above sea", openaip((2500, 1, 1), (0, 1, 0)), ["ceiling 762 m above sea"]),
    ("OpenAIP above ground", openaip((100, 0, 0), (0, 1, 0)), ["ceiling 560 m above sea"]),
    ("OpenAIP, a flight level", openaip((95, 6, 2), (0, 1, 0)), ["refused: its height is a flight level"]),
    ("OpenAIP, by notice", openaip((2500, 1, 1), (0, 1, 0), byNotam=True), ["refused: it is active by notice"]),
    ("OpenAIP, with hours", openaip((2500, 1, 1), (0, 1, 0), hoursOfOperation={"operatingHours": []}),
     ["refused: its hours"]),
    ("OpenAIP, the greater of two limits", openaip((2500, 1, 1), (0, 1, 0), upperLimitMax={"value": 9}),
     ["refused: it has members"]),
    ("OpenAIP, activated at times",
     openaip((2500, 1, 1), (0, 1, 0), activationTimes=[{"start": "2026-01-01T12:00:00Z", "end": "2026-01-01T13:00:00Z"},
                                                       {"end": "2026-02-01T12:00:00Z"}]),
     ['ceiling 762 m above sea active "2026-01-01T12:00:00Z" .. "2026-01-01T13:00:00Z"',
      'ceiling 762 m above sea active "1970-01-01T00:00:00Z" .. "2026-02-01T12:00:00Z"']),
    ("OpenAIP, activated when", openaip((2500, 1, 1), (0, 1, 0), activationTimes=[{}]), ["refused: its activation"]),
    ("FAA temporary restriction", geojson({"NOTAM_KEY": "6/1234", "TITLE": "until Monday"}), ["refused: its heights"]),
    ("FAA class airspace", faa(), ["ceiling 914.4 m above sea"]),
    ("FAA, numbers as texts", faa(UPPER_VAL="3000"), ["ceiling 914.4 m above sea"]),
    ("FAA, no number", faa(UPPER_VAL="NaN"), ["refused: a limit is not a number"]),
    ("FAA above ground", faa(UPPER_CODE="AGL"), ["ceiling 1374.4 m above sea"]),
    ("FAA, times as text", faa(TIMESOFUSE="SUNRISE TO SUNSET"), ["refused: its times of use"]),
    ("FAA facility map", geojson({"CEILING": 200, "APT1_ICAO": "KLGA", "MAP_EFF": "2026-06-12"}),
     ["floor 460.96 m above sea"]),
    ("FAA facility map, no height", geojson({"CEILING": 1e300, "APT1_ICAO": "KLGA"}),
     ["refused: a limit is out of range"]),
    ("a height of all features", {**geojson(), "maxAltitude": 100}, ["refused: it has members"]),
    ("a time of all features", {**geojson(), "metadata": {"validFrom": "2026-01-01"}}, ["refused: it has members"]),
    ("FAA facility map, nothing permitted", geojson({"CEILING": 0, "APT1_ICAO": "KLGA"}), [""]),
]  # fmt: skip


def test_geojson_of_other_feeds() -> None:
    wrong = []
    for name, value, expected in FEEDS:
        got = items(value, "feed.geojson", **SITE)
        if len(got) != len(expected) or not all(map(str.startswith, got, expected)):
            wrong.append((name, got))
    assert not wrong


def test_a_point_is_a_loss_and_a_line_needs_a_width() -> None:
    both = geojson()
    both["features"].append(geojson({"name": "mast"}, "Point", [8.5, 47.3])["features"][0])
    assert {(each.name, each.what) for each in found_in(both).losses} == {
        ("no-height", "an area on the ground"),
        ("point", "mast"),
    }
    line = found_in(geojson(kind="LineString", coordinates=SQUARE[:3]), width="20")
    assert "corridor(47.3970000 N, 8.5440000 E" in line.text
    assert "width 20 m" in line.text


def test_terrain_shrinks_a_zone_to_stay_inside_of() -> None:
    text = kml(mark(f"{polygon(',120', 'relativeToGround', extrude=True)}"))
    assert items(text, "a.kml", terrain="400..460") == ["ceiling 580 m above sea"]
    assert items(text, "b.kml", terrain="400..460", use="inside") == ["ceiling 520 m above sea"]
    inside = found_in(text, "c.kml", terrain="400..460", use="inside")
    assert inside.rules == ("airspace inside quarry",)
    two = found_in(kml(mark(polygon(), "north"), mark(polygon(), "south")), "d.kml", use="inside")
    assert two.rules == ("airspace inside north  // or inside south",)


#: placemarks, and the items of their zones
KML: list[tuple[str, str, list[str]]] = [
    ("on the ground", polygon(), [""]),
    ("on the ground, heights ignored", polygon(",30"), [""]),
    ("with a hole", polygon(hole=True), [""]),
    ("extruded, above sea", polygon(",500.5", "absolute", extrude=True), ["ceiling 500.5 m above sea"]),
    ("extruded, above ground", polygon(",50", "relativeToGround", extrude=True), ["ceiling 510 m above sea"]),
    ("a floor and a ceiling", polygon(",500", "absolute") + polygon(",450", "absolute"),
     ["floor 450 m above sea ceiling 500 m above sea"]),
    ("a surface", polygon(",500", "absolute"), ["refused: it is a surface at a height"]),
    ("a slope", polygon(",500", "absolute", extrude=True).replace(",500", ",501", 1), ["refused: its corners"]),
    ("an unknown mode", polygon(",5", "relativeToSeaFloor", extrude=True), ["refused: its altitude mode"]),
    ("two modes on the ground, as Google Earth writes them", polygon().replace(
        "<outer", "<altitudeMode>clampToGround</altitudeMode><altitudeMode>clampToSeaFloor</altitudeMode><outer", 1),
     [""]),
    ("two modes", polygon(",50", "relativeToGround", extrude=True).replace(
        "<outer", "<altitudeMode>absolute</altitudeMode><outer", 1), ["refused: its altitude mode is not known, or"]),
    ("a span", f"<TimeSpan><begin>2026-06-01T00:00:00Z</begin></TimeSpan>{polygon()}",
     ['active "2026-06-01T00:00:00Z" .. "2100-01-01T00:00:00Z"']),
    ("a span of days", f"<TimeSpan><begin>2026-06-01</begin></TimeSpan>{polygon()}",
     ["refused: a moment does not say"]),
    ("a line", "<LineString><coordinates>8.5,47.3 8.6,47.3</coordinates></LineString>", ["refused: it is a line"]),
]  # fmt: skip


def test_zones_of_kml() -> None:
    wrong = []
    for name, inside, expected in KML:
        geometries = f"<MultiGeometry>{inside}</MultiGeometry>" if inside.count("<Polygon>") > 1 else inside
        got = items(kml(mark(geometries)), "site.kml", terrain="400..460")
        if len(got) != len(expected) or not all(map(str.startswith, got, expected)):
            wrong.append((name, got))
    assert not wrong


def test_losses_of_kml_are_named_with_their_place() -> None:
    overlay = "<GroundOverlay><name>photo</name></GroundOverlay>"
    point = "<Point><coordinates>8.5,47.3</coordinates></Point>"
    style = "<styleUrl>#a</styleUrl><description>text</description><TimeStamp><when>2026</when></TimeStamp>"
    track = '<gx:Track xmlns:gx="http://www.google.com/kml/ext/2.2"/>'
    found = found_in(kml(overlay, mark(style + polygon()), mark(point, "mast"), mark(track, "flown")), "site.kml")
    told = {(each.name, each.place) for each in found.losses}
    assert told == {
        ("style", "GroundOverlay[1]"), ("style", "Placemark[1]"), ("description", "Placemark[1]"),
        ("time-stamp", "Placemark[1]"), ("point", "Placemark[2]"), ("track", "Placemark[3]"),
        ("no-height", "Placemark[1]"),
    }  # fmt: skip
    linked = found_in(
        kml(mark(polygon()), "<NetworkLink><Link><href>http://x.invalid/</href></Link></NetworkLink>"), "a.kml"
    )
    assert [(each.name, each.place) for each in linked.not_kept] == [("NetworkLink", "NetworkLink[1]")]
    spanned = found_in(kml("<Folder><TimeSpan/>", mark(polygon()), "</Folder>"), "b.kml")
    assert [(each.name, each.place) for each in spanned.not_kept] == [("TimeSpan", "TimeSpan[1]")]
    hidden = found_in(kml(mark(polygon()), f"<Update><Create>{mark(polygon())}</Create></Update>"), "c.kml")
    assert [(each.name, each.place) for each in hidden.not_kept] == [("Update", "Update[1]")]


def test_a_kmz_is_its_document() -> None:
    document = kml(mark(polygon())).encode()
    assert items(kmz(other_kml=b"<kml/>", doc_kml=document), "site.kmz") == [""]
    assert items(kmz(files_png=b"x", first_kml=document), "site.kmz") == [""]


def test_the_zones_of_an_exported_flight_come_back(tmp_path: Path) -> None:
    export = export_of(run_in(tmp_path / "run"))
    found = found_in(exported_kml(export).decode(), "flight.kml", skip=("planned path",))
    names = {each.name for each in zone_shapes(export.flight.policy)}
    declared = {line.split()[1] for line in found.text.splitlines() if line.startswith("zone ")}
    assert names <= declared
    assert {"point", "track"} <= {each.name for each in found.losses}


def test_names_are_names_of_the_language() -> None:
    areas = geojson({"name": "Österreich: Sperrgebiet №1"})
    for name in ("inside", "42", "\u202e", "x", "x", "a" * 100):
        areas["features"].append(geojson({"name": name})["features"][0])
    found = found_in(areas)
    declared = [line.split()[1] for line in found.text.splitlines() if line.startswith("zone ")]
    assert declared == ["osterreich_sperrgebiet_no1", "inside_area", "zone_42", "zone", "x", "x_2", "a" * 40]
    assert not has_errors(found.diagnostics)


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        ({"terrain": "460..400"}, "the lowest ground comes first"),
        ({"terrain": "400"}, "not accepted by `--terrain`"),
        ({"clock": "Europe/Zurich"}, "not accepted by `--clock`"),
        ({"width": "-3"}, "not accepted by `--width`"),
        ({"use": "above"}, "not accepted by `--as`"),
        ({"to": "mission"}, "only a plan becomes a mission"),
    ],
)
def test_wrong_requests(request_: dict[str, Any], words: str) -> None:
    found = import_file(ImportRequest(write(Path(), geojson(), "a.geojson"), **request_))
    assert isinstance(found, Refusal)
    assert words in found.text


def test_the_hole_of_the_square_stays_a_hole() -> None:
    assert ") hole (" in " ".join(found_in(geojson()).text.split())
