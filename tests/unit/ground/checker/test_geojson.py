"""Areas from GeoJSON files: valid ones (RFC 7946) are read exactly, all others are refused with a message."""

import json
from decimal import Decimal
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.codes import Code
from rtshcua.ground.checker.geojson import GeoPolygon, NoArea, read_area
from virtual.rows import rows

SQUARE = [[8.54, 47.39], [8.55, 47.39], [8.55, 47.40], [8.54, 47.40], [8.54, 47.39]]
INNER = [[8.5425, 47.3925], [8.5425, 47.3935], [8.5435, 47.3935], [8.5435, 47.3925], [8.5425, 47.3925]]
HOLE = [[8.542, 47.392], [8.542, 47.394], [8.544, 47.394], [8.544, 47.392], [8.542, 47.392]]
CORNERS = ((85400000, 473900000), (85500000, 473900000), (85500000, 474000000), (85400000, 474000000))
HOLE_CORNERS = ((85420000, 473920000), (85420000, 473940000), (85440000, 473940000), (85440000, 473920000))


def polygon(*rings: Any) -> dict[str, Any]:
    return {"type": "Polygon", "coordinates": list(rings)}


def feature(geometry: Any, **members: Any) -> dict[str, Any]:
    return {"type": "Feature", "properties": None, "geometry": geometry, **members}


def collection(*features: Any, **members: Any) -> dict[str, Any]:
    return {"type": "FeatureCollection", "features": list(features), **members}


def read(tree: Any, name: str | None = None) -> tuple[GeoPolygon, ...]:
    return read_area(json.dumps(tree).encode(), name)


def refused(data: Any, name: str | None = None) -> NoArea:
    with pytest.raises(NoArea) as caught:
        read_area(data if isinstance(data, bytes) else json.dumps(data).encode(), name)
    return caught.value


POINT = {"type": "Point", "coordinates": [8.5, 47.3]}


@rows(
    ("tree", "name"),
    [
        (polygon(SQUARE, HOLE), None),
        ({"type": "MultiPolygon", "coordinates": [[SQUARE, HOLE]]}, None),
        (feature(polygon(SQUARE, HOLE)), None),
        (feature(polygon(SQUARE, HOLE), id="site"), "site"),
        (feature(polygon(SQUARE, HOLE), properties={"name": "site"}), "site"),
        (feature(polygon(SQUARE, HOLE), id=17), "17"),
        (collection(feature(POINT), feature(polygon(SQUARE, HOLE)), feature(None)), None),
        (collection(feature(polygon(HOLE), id="b"), feature(polygon(SQUARE, HOLE), id="a")), "a"),
        (polygon(SQUARE[::-1], HOLE[::-1]) | {"bbox": [8, 47, 9, 48], "note": {"foreign": [True, None]}}, None),
        (polygon([[*each, 0.0] for each in SQUARE], HOLE), None),
        (
            collection(
                feature(polygon(SQUARE, HOLE)),
                crs={"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}},
            ),
            None,
        ),
    ],
    ids=[
        "polygon", "multipolygon", "feature", "id", "name", "number", "collection", "among", "foreign", "altitude",
        "crs",
    ],
)  # fmt: skip
def test_area_is_read_at_any_place_in_the_file(tree: Any, name: str | None) -> None:
    (found,) = read(tree, name)
    assert set(found.outer) == set(CORNERS)
    assert set(found.holes[0]) == set(HOLE_CORNERS)
    assert len(found.holes) == 1


def test_rings_keep_their_order_and_lose_the_last_position() -> None:
    assert read(polygon(SQUARE, HOLE)) == (GeoPolygon(CORNERS, (HOLE_CORNERS,)),)
    assert read(polygon([*SQUARE[:2], SQUARE[1], *SQUARE[2:]])) == (GeoPolygon(CORNERS, ()),)


def test_multipolygon_keeps_all_its_polygons() -> None:
    far = [[x + 0.1, y] for x, y in SQUARE]
    assert len(read({"type": "MultiPolygon", "coordinates": [[SQUARE], [far]]})) == 2


def test_line_ends_and_a_byte_order_mark_are_accepted() -> None:
    text = json.dumps(polygon(SQUARE), indent=1).replace("\n", "\r\n")
    assert read_area(b"\xef\xbb\xbf" + text.encode(), None) == read(polygon(SQUARE))


DIGITS = st.integers(-(10**17), 10**17).map(lambda whole: str(Decimal(whole).scaleb(-15)))


@given(DIGITS, DIGITS)
def test_fifteen_decimals_are_rounded_to_the_nearest_half_to_even(longitude: str, latitude: str) -> None:
    latitude = str(Decimal(latitude) * Decimal("0.8"))
    text = f'{{"type":"Polygon","coordinates":[[[{longitude},{latitude}],[0,89e-1],[9,84],[{longitude},{latitude}]]]}}'
    try:
        (found,) = read_area(text.encode(), None)
    except NoArea:
        assume(False)
        return
    assert found.outer[0] == tuple(round(Fraction(each) * 10_000_000) for each in (longitude, latitude))


@rows(
    ("written", "whole"),
    [("1.00000005", 10_000_000), ("1.00000015", 10_000_002), ("-1.00000005", -10_000_000), ("1e1", 100_000_000),
     ("1E-7", 1), ("5e-8", 0), ("0.1500000e-6", 2), ("1e-999", 0), ("-0.0", 0)],
)  # fmt: skip
def test_numbers_are_exact_decimals(written: str, whole: int) -> None:
    text = f'{{"type":"Polygon","coordinates":[[[{written},9],[20,10],[20,20],[{written},9]]]}}'
    assert read_area(text.encode(), None)[0].outer[0][0] == whole


@rows(
    ("data", "words"),
    [
        (b"", "line 1, column 1: expecting value"),
        (b'{"type": "Polygon",\n "coordinates": [}', "line 2, column 18: expecting value"),
        (b'{"type": "Polygon", "type": "Polygon"}', "repeats the key `type`"),
        (b'{"type": "Polygon", "coordinates": [[[NaN, 1]]]}', "`NaN` is not a number"),
        (b'{"type": "Polygon", "coordinates": [[[1.' + b"1" * 99 + b", 1]]]}", "more than 64 characters"),
        (b'{"type": "Polygon", "coordinates": [[[1' + b"1" * 9999 + b", 1]]]}", "more than 64 characters"),
        (b'{"type": "Polygon", "coordinates": [[[1e9999999999999999999, 1]]]}', "has more than 3 digits"),
        (b'{"a\xff": 1}', "byte 3 (0xff) is not UTF-8"),
        (b"[" * 100_000, "nested more than 32 levels deep"),
        (b"[" * 33 + b"]" * 33, "nested more than 32 levels deep"),
        (b'[[], {"]": "[[\\""}, ' + b'{"a":' * 32 + b"1" + b"}" * 32 + b"]", "nested more than 32 levels deep"),
        (b"[" * 32 + b"]" * 32, "not a GeoJSON object"),
        (b'{"type": "Polygon", "coordinates": [1, 2],[3, 4]}', "`coordinates` has several values without brackets"),
        (b'{"type": "Polygon",\n"coordinates": [[[1, 2],\n[3, 4]], [[5, 6]]] "', "line 3, column 20: expecting ','"),
        ('{"é": [[1, 2]], "ü": [[1, 2], [3, 04]]}'.encode(), "line 1, column 36: expecting ','"),
        (b'{"type": "Polygon", "coordinates": [[[1, 2], NaN, [3, 4]]]}', "`NaN` is not a number"),
        (b'{"coordinates": [[1, 2]], "a": ] NaN', "line 1, column 32: expecting value"),
        (b'{"type": "Polygon", "coordinates": [[[1, 2.]]]}', "line 1, column 43: expecting ','"),
        (b"[[]]" * 40, "line 1, column 5: extra data"),
        (b"]" * 40, "line 1, column 1: expecting value"),
        (b'"' + b"[" * 50 + b'"', "not a GeoJSON object"),
        (b"[1, 2]", "not a GeoJSON object"),
        (b'{"type": "Topology"}', "not a GeoJSON object"),
        (b'{"type": ["Polygon"]}', "not a GeoJSON object"),
        (b'{"type": "FeatureCollection"}', "`/features` is not an array"),
        (b'{"type": "FeatureCollection", "features": [{"type": "Polygon"}]}', "`/features/0` is not a Feature"),
        (b'{"type": "Feature", "geometry": {"type": "Blob"}}', "`/geometry` is not a geometry"),
        (b'{"type": "Feature", "geometry": 7}', "`/geometry` is not a geometry"),
    ],
)
def test_invalid_geojson_is_refused(data: bytes, words: str) -> None:
    found = refused(data)
    assert found.code == codes.NOT_GEOJSON
    assert words in found.message


NORTH = [[8.5, 86.0], [8.6, 86.0], [8.6, 86.1], [8.5, 86.0]]
SWAPPED = [[47.39, 108.54], [47.39, 108.55], [47.40, 108.55], [47.39, 108.54]]
FIJI = [[179.9, -16], [-179.9, -16], [-179.9, -17], [179.9, -17], [179.9, -16]]
BOW = [[8.0, 47.0], [8.1, 47.1], [8.1, 47.0], [8.0, 47.1], [8.0, 47.0]]


@rows(
    ("tree", "name", "words"),
    [
        (POINT, None, "is a Point"),
        (feature(None), None, "has no geometry"),
        (feature(POINT), None, "the geometry at `/geometry` is a Point"),
        (polygon(SQUARE), "site", "it is a Polygon without features"),
        (feature(polygon(SQUARE), id="a"), "b", "its only feature is not named `b`"),
        (collection(), None, "none of its 0 features are areas"),
        (collection(feature(polygon(SQUARE), id="a"), feature(polygon(SQUARE), id="b")), None, "2 of its 2 features"),
        (collection(feature(polygon(SQUARE), id="site")), "sit", "no feature is named `sit`"),
        (collection(feature(polygon(SQUARE), id="a"), feature(POINT, id="a")), "a", "2 of its 2 features are named"),
        (collection(feature(POINT, id="a")), "a", "`/features/0/geometry` is a Point"),
        (polygon(SQUARE) | {"crs": {"properties": {"name": "EPSG:2056"}}}, None, "`crs` `EPSG:2056` is not"),
        (
            feature(polygon(SQUARE) | {"crs": {"properties": {"name": "urn:ogc:def:crs:EPSG::2056"}}}),
            None,
            "is not WGS 84",
        ),
        (polygon(SQUARE) | {"crs": {"type": "link", "properties": {"href": "x"}}}, None, "`crs` is not WGS 84"),
        (polygon(SQUARE, [[x + 1, y] for x, y in HOLE]), None, "`/coordinates/1` is outside its polygon"),
        (polygon(SQUARE, HOLE, INNER), None, "the hole at `/coordinates/2` is inside the hole at `/coordinates/1`"),
        (polygon(SQUARE, INNER, HOLE), None, "the hole at `/coordinates/1` is inside the hole at `/coordinates/2`"),
        (polygon(SQUARE, [[x + 0.007, y] for x, y in HOLE]), None, "the hole at `/coordinates/1` crosses or touches"),
        (polygon(HOLE, SQUARE), None, "the hole at `/coordinates/1` is outside its polygon"),
        (polygon(SQUARE, SQUARE), None, "the hole at `/coordinates/1` crosses or touches the ring at `/coordinates/0`"),
        (
            {"type": "MultiPolygon", "coordinates": [[HOLE], [SQUARE, [[x + 1, y] for x, y in HOLE]]]},
            None,
            "the hole at `/coordinates/1/1` is outside",
        ),
        (polygon(), None, "`/coordinates` has no ring"),
        ({"type": "Polygon"}, None, "`/coordinates` is not an array"),
        ({"type": "MultiPolygon", "coordinates": []}, None, "`/coordinates` has no polygon"),
        ({"type": "MultiPolygon", "coordinates": [7]}, None, "`/coordinates/0` is not an array"),
        (polygon(SQUARE[:-1]), None, "the ring at `/coordinates/0` is not closed"),
        (polygon(SQUARE, HOLE[:3]), None, "`/coordinates/1` has fewer than four positions"),
        (polygon([[8.5]] * 4), None, "`/coordinates/0/0` is not a position"),
        (polygon([["8.5", 1]] * 4), None, "`/coordinates/0/0` is not a position"),
        (polygon([[True, 1]] * 4), None, "`/coordinates/0/0` is not a position"),
        (polygon([[8.5, 47.3]] * 4), None, "encloses no area"),
        (polygon([[8.5, 47.3]] * 9_000), None, "has 9,000 positions; the limit is 4,096 corners"),
        (polygon([[10**60, 0]] * 4), None, "outside the supported coordinates"),
        (polygon(NORTH), None, "is 8.5, 86.0, outside the supported"),
        (polygon(SWAPPED), None, "outside the supported coordinates"),
        (polygon(FIJI), None, "crosses the antimeridian after its position 0"),
        (polygon(BOW), None, "crosses or touches itself"),
    ],
)  # fmt: skip
def test_file_without_the_area_is_refused(tree: Any, name: str | None, words: str) -> None:
    found = refused(tree, name)
    assert found.code == codes.GEOJSON_SHAPE
    assert words in found.message


def test_positions_in_strings_stay_strings() -> None:
    ring = [[8, 47], [9, 47], [9, 48], [8, 47]]
    told = {"name": '"[1,2],[3,4]', "a": [1, 2], "b": [[1, 2], "x"], "c": [[[1, 2]], [3, 4], 5]}
    feature = {"type": "Feature", "properties": told, "geometry": {"type": "Polygon", "coordinates": [ring]}}
    (area,) = read_area(json.dumps({"type": "FeatureCollection", "features": [feature]}).encode(), '"[1,2],[3,4]')
    assert len(area.outer) == 3
    feature["geometry"] = {"type": "Polygon", "coordinates": [[*ring[:2], "x", *ring[2:]]]}
    with pytest.raises(NoArea, match="`/geometry/coordinates/0/2` is not an array"):
        read_area(json.dumps(feature).encode(), None)
    feature["geometry"] = {"type": "Polygon", "coordinates": [[[8]], ring]}
    with pytest.raises(NoArea, match="the ring at `/geometry/coordinates/0` has fewer than four"):
        read_area(json.dumps(feature).encode(), None)


def test_hints_name_the_features() -> None:
    assert (
        refused(polygon(FIJI)).help
        == "cut the area at longitude 180 into two parts of a MultiPolygon (RFC 7946, 3.1.9)"
    )
    two = collection(feature(polygon(SQUARE), id="site"), feature(polygon(SQUARE), properties={"name": "yard"}))
    assert refused(two).help == "select one with `feature`: `site`, `yard`"
    assert refused(two, "sitt").help == "did you mean `site`?"
    assert "longitude comes first" in (refused(polygon(SWAPPED)).help or "")
    many = collection(*(feature(polygon(SQUARE), id=f"plot {k}") for k in range(7)))
    assert (refused(many).help or "").endswith("`plot 4` and 2 more")


JSON = st.recursive(
    st.none() | st.booleans() | st.floats(-200, 200) | st.sampled_from(["Polygon", "Feature", "x"]),
    lambda inner: (
        st.lists(inner, max_size=5)
        | st.dictionaries(st.sampled_from(["type", "coordinates", "geometry", "features", "id", "properties"]), inner)
    ),
    max_leaves=30,
)


@given(
    JSON | st.builds(polygon, JSON) | st.builds(feature, JSON) | st.builds(collection, JSON),
    st.sampled_from([None, "x"]),
)
def test_any_json_is_an_area_or_refused(tree: Any, name: str | None) -> None:
    outcome(json.dumps(tree).encode(), name)


@given(st.binary(max_size=80))
def test_any_bytes_are_an_area_or_refused(data: bytes) -> None:
    outcome(data, None)


def outcome(data: bytes, name: str | None) -> Code | None:
    try:
        read_area(data, name)
    except NoArea as refusal:
        return refusal.code
    return None
