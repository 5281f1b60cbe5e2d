"""The outline of an area: KML and GeoJSON give the same polygon, and hostile files are refused in bounded time."""

import json
from pathlib import Path

import pytest

from reference.zone_files import kmz
from reference.zone_files import write as zone_file
from rtshcua.app.gateway.outlines import read_outline
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.checker.geojson import GeoPolygon

CORNERS = ((8.5440, 47.3967), (8.5470, 47.3967), (8.5470, 47.3987), (8.5440, 47.3987), (8.5440, 47.3967))
INNER = ((8.5450, 47.3975), (8.5455, 47.3975), (8.5455, 47.3980), (8.5450, 47.3980), (8.5450, 47.3975))
KML = (
    '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{}</Document></kml>'
)


def ring(corners: tuple[tuple[float, float], ...], height: str = ",0") -> str:
    places = " ".join(f"{longitude},{latitude}{height}" for longitude, latitude in corners)
    return f"<LinearRing><coordinates>\n  {places}\n</coordinates></LinearRing>"


def placemark(name: str, polygons: str) -> str:
    return f"<Folder><Placemark><name>{name}</name>{polygons}</Placemark></Folder>"


def polygon(mode: str = "", height: str = ",0", hole: bool = False) -> str:
    inner = f"<innerBoundaryIs>{ring(INNER)}</innerBoundaryIs>" if hole else ""
    altitude = f"<altitudeMode>{mode}</altitudeMode>" if mode else ""
    return f"<Polygon>{altitude}<outerBoundaryIs>{ring(CORNERS, height)}</outerBoundaryIs>{inner}</Polygon>"


def outline(folder: Path, text: str, feature: str | None = None, name: str = "field.kml") -> object:
    path = folder / name
    path.write_bytes(text.encode())
    return read_outline(path, feature)


def refused(found: object) -> Refusal:
    assert isinstance(found, Refusal)
    assert found.code is ExitCode.INPUT
    return found


def test_kml_and_geojson_give_the_same_polygon(tmp_path: Path) -> None:
    geometry = {"type": "Polygon", "coordinates": [CORNERS, INNER]}
    feature = {"type": "Feature", "properties": {}, "geometry": geometry}
    by_kml = outline(tmp_path, KML.format(placemark("field", polygon(hole=True))))
    by_geojson = outline(tmp_path, json.dumps(feature), name="field.geojson")
    assert by_kml == by_geojson
    assert isinstance(by_kml, tuple)
    assert by_kml[0].outer[0] == (85_440_000, 473_967_000)
    assert len(by_kml[0].holes) == 1


def test_a_kmz_is_its_document(tmp_path: Path) -> None:
    text = KML.format(placemark("field", polygon()))
    path = zone_file(tmp_path, kmz(doc_kml=text.encode()), "field.kmz")
    assert read_outline(path) == outline(tmp_path, text)


def test_one_of_several_areas_is_chosen_by_name(tmp_path: Path) -> None:
    text = KML.format(placemark("north", polygon()) + placemark("south", polygon(hole=True)))
    told = refused(outline(tmp_path, text))
    assert "2 of its 2 features are areas" in told.text
    assert "`FILE#NAME`" in (told.help or "")
    assert "`north`, `south`" in (told.help or "")
    found = outline(tmp_path, text, "south")
    assert isinstance(found, tuple)
    assert found[0].holes
    assert "did you mean `south`?" in (refused(outline(tmp_path, text, "suoth")).help or "")


def test_several_polygons_of_one_placemark_are_one_area(tmp_path: Path) -> None:
    text = KML.format(placemark("field", f"<MultiGeometry>{polygon()}{polygon(hole=True)}</MultiGeometry>"))
    found = outline(tmp_path, text)
    assert isinstance(found, tuple)
    assert [isinstance(each, GeoPolygon) for each in found] == [True, True]


def test_no_digit_is_lost(tmp_path: Path) -> None:
    text = KML.format(placemark("field", polygon())).replace("8.544,47.3967", "8.54400004999999999999,+47.3967e0")
    found = outline(tmp_path, text)
    assert isinstance(found, tuple)
    assert found[0].outer[0] == (85_440_000, 473_967_000)  # the last position is still the first corner, rounded


def test_heights_are_refused_unless_the_area_lies_on_the_ground(tmp_path: Path) -> None:
    on_ground = outline(tmp_path, KML.format(placemark("field", polygon("clampToGround", ",400"))))
    assert isinstance(on_ground, tuple)
    told = refused(outline(tmp_path, KML.format(placemark("field", polygon("absolute", ",400")))))
    assert "has a height, 400" in told.text
    assert "`--below`" in (told.help or "")


HOSTILE = {
    "an external entity": '<!DOCTYPE kml [<!ENTITY f SYSTEM "file:///etc/passwd">]><kml>&f;</kml>',
    "entities that expand": "<!DOCTYPE kml [<!ENTITY a 'aaaaaaaaaa'>"
    + "".join(f"<!ENTITY {chr(98 + n)} '&{chr(97 + n)};&{chr(97 + n)};'>" for n in range(20))
    + "]><kml>&u;</kml>",
    "cut off": KML.format("")[:60],
    "not XML": "\0\1\2 field",
    "another encoding": '<?xml version="1.0" encoding="x-no-such"?><kml/>',
    "nested deeply": "<kml>" + "<a>" * 200_000,
    "no polygon": KML.format(placemark("way", "<Point><coordinates>8.5,47.3</coordinates></Point>")),
    "no boundary": KML.format(placemark("field", "<Polygon/>")),
    "no number": KML.format(placemark("field", polygon().replace("8.547,", "nan,"))),
    "an endless exponent": KML.format(placemark("field", polygon().replace("8.547,", "1e999999999,"))),
    "open": KML.format(placemark("field", polygon().replace("8.544,47.3967,0\n", "8.544,47.3968,0\n"))),
    "too many places": KML.format("<Placemark/>" * 2_000),
}


@pytest.mark.parametrize("what", HOSTILE)
def test_hostile_and_damaged_files_are_refused(tmp_path: Path, what: str) -> None:
    told = refused(outline(tmp_path, HOSTILE[what]))
    assert "passwd" not in told.text
    assert len(told.text) < 400


def test_other_files_are_named(tmp_path: Path) -> None:
    assert "no such file" in refused(read_outline(tmp_path / "missing.kml")).text
    assert "not a readable archive" in refused(outline(tmp_path, "PK\3\4", name="field.kmz")).text
    large = tmp_path / "large.kml"
    large.write_bytes(b" " * ((8 << 20) + 1))
    assert "more than 8 MiB" in refused(read_outline(large)).text
