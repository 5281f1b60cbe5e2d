"""Heights, times and radii in a GeoJSON file are refused with their place; other members are accepted."""

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.diagnostics import codes
from rtshcua.ground.checker.geojson import NoArea, read_area, said_by
from virtual.rows import rows

RING = [[8.545, 47.397], [8.546, 47.397], [8.546, 47.398], [8.545, 47.398], [8.545, 47.397]]
OUTLINE = {"type": "Polygon", "coordinates": [RING]}


def refused(tree: Any, feature: str | None = None) -> NoArea | None:
    try:
        read_area(json.dumps(tree).encode(), feature)
    except NoArea as found:
        return found
    return None


def feature(geometry: Any = OUTLINE, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "id": "z", "properties": properties, "geometry": geometry}


LAYER = {"upper": 30, "upperReference": "AGL", "lower": 0, "lowerReference": "AGL", "uom": "m"}
PERIODS = [{"startDateTime": "2026-11-28T00:00:00Z", "endDateTime": "2026-11-28T23:00:00Z"}]
RAISED = [[*each, 120] for each in RING]

#: what a file has besides an outline, and the places that its refusal names; none for what is let be
TABLE: list[tuple[Any, tuple[str, ...]]] = [
    # ED-318: the layer of a geometry, the times among the properties, a circle as the extent of a point
    (feature(OUTLINE | {"layer": LAYER}), ("a height at `/geometry/layer`",)),
    (feature(limitedApplicability=PERIODS), ("a time at `/properties/limitedApplicability`",)),
    (feature({"type": "Point", "coordinates": [8.5, 47.3], "extent": {"subType": "Circle", "radius": 150}}),
     ("a radius at `/geometry/extent`",)),
    (feature(extendedProperties={"limits": [{"maxHeight": 30}]}),
     ("a height at `/properties/extendedProperties/limits/0/maxHeight`",)),
    ({"type": "FeatureCollection", "metadata": {"validFrom": "2026-01-01"}, "features": [feature()]},
     ("a time at `/metadata/validFrom`",)),
    # ED-269, its members as properties of features, as some feeds have them
    (feature(lowerLimit=0, upperLimit=120, upperVerticalReference="AGL"),
     ("`/properties/lowerLimit`", "`/properties/upperLimit`", "`/properties/upperVerticalReference`")),
    (feature(applicability=[{"permanent": "YES"}]), ("a time at `/properties/applicability`",)),
    # FAA: facility maps, class airspace, special use airspace, restrictions
    (feature(CEILING=400, UNIT="Feet"), ("a height at `/properties/CEILING`",)),
    (feature(FLOOR=0), ("a height at `/properties/FLOOR`",)),
    (feature(UPPER_VAL=2500, LOWER_VAL=700, WKHR_CODE="H24"),
     ("`/properties/UPPER_VAL`", "`/properties/LOWER_VAL`", "a time at `/properties/WKHR_CODE`")),
    (feature(TIMESOFUSE="SR-SS"), ("a time at `/properties/TIMESOFUSE`",)),
    (feature(EFF_DATE="2026-01-01"), ("a time at `/properties/EFF_DATE`",)),
    # others: OpenAIP, ASTM F3548, dipul, DGAC, drones' makers, OpenStreetMap
    (feature(upperLimit={"value": 30, "unit": 1}), ("`/properties/upperLimit`",)),
    (feature(hoursOfOperation={"operatingHours": []}), ("a time at `/properties/hoursOfOperation`",)),
    (feature(altitude_upper=30, time_start="x"), ("a height at `/properties/altitude_upper`", "a time at")),
    (feature(lower_limit_altitude=10), ("a height at `/properties/lower_limit_altitude`",)),
    (feature(limite="30"), ("a height at `/properties/limite`",)),
    (feature(remarque="50 m AGL"), ("a length at `/properties/remarque`",)),
    (feature(note="400ft"), ("a length at `/properties/note`",)),
    (feature(note="FL 95"), ("a length at `/properties/note`",)),
    (feature(radius=500), ("a radius at `/properties/radius`",)),
    (feature(buffer_m=5), ("a radius at `/properties/buffer_m`",)),
    (feature(height=0), ("a height at `/properties/height`",)),
    (feature(start_date="2020"), ("a time at `/properties/start_date`",)),
    (feature(opening_hours="Mo-Fr 08:00-18:00"), ("a time at `/properties/opening_hours`",)),
    (feature(max_height_updated=30), ("a height at `/properties/max_height_updated`",)),
    (feature(**{"a/b~c": {"alt": 1}}), ("a height at `/properties/a~1b~0c/alt`",)),
    # heights of positions
    (feature({"type": "Polygon", "coordinates": [RAISED]}),
     ("the position at `/geometry/coordinates/0/0` has a height, 120",)),
    ({"type": "Polygon", "coordinates": [[*RING[:2], [8.546, 47.398, -1e-9], *RING[3:]]]},
     ("the position at `/coordinates/0/2` has a height",)),
    ({"type": "Polygon", "coordinates": [[[*each, 0, 7] for each in RING]]}, ("has a height, 7",)),
    (OUTLINE | {"bbox": [8, 47, 0, 9, 48, 120]}, ("a height at `/bbox`",)),
    # let be: names, notes, styles, identifiers, dates of the record, what has no value, zeros for heights of positions
    (feature(), ()),
    (feature(name="30 m", title="FL 95", note="nobody flies here", owner="city works"), ()),
    (feature(stroke="#f00", **{"stroke-width": 2, "fill-opacity": 0.5, "marker-size": "small"}), ()),
    (feature(OBJECTID=7, Shape__Area=12.5, Shape__Length=3.5, GlobalID="{x}", area_ha=1.2, admin_level="8"), ()),
    (feature(created_at="2026-01-01", LAST_EDIT_DATE="x", lastUpdateTime=1, date_published=2, timestamp="x"), ()),
    (feature(identifier="LUX-07", country="LUX", type="PROHIBITED", variant="COMMON", reason=["SENSITIVE"]), ()),
    (feature(ceiling=None, floor="", schedule=[], layer={}), ()),
    (feature({"type": "Polygon", "coordinates": [[[*each, 0] for each in RING]]}), ()),
    (OUTLINE | {"bbox": [8, 47, 9, 48]}, ()),
    (OUTLINE | {"bbox": [8, 47, 0, 9, 48, 0.0]}, ()),
    ({"type": "FeatureCollection", "name": "zones", "features": [feature()]}, ()),
]  # fmt: skip


@rows("tree, places", TABLE)
def test_ignored_members_are_named_with_their_place(tree: Any, places: tuple[str, ...]) -> None:
    found = refused(tree)
    if not places:
        assert found is None
        return
    assert found is not None
    assert found.code is codes.GEOJSON_UNREAD
    assert [each for each in places if each not in found.message] == []
    assert "`floor` and `ceiling`" in (found.help or "")


def test_only_the_selected_feature_is_examined() -> None:
    tree = {"type": "FeatureCollection", "features": [feature(), feature(CEILING=400) | {"id": "other"}]}
    assert refused(tree, "z") is None
    assert refused(tree, "other") is not None


def test_many_ignored_members_are_counted() -> None:
    found = refused(feature(**{f"{each}_height": 1 for each in "abcdefghi"}))
    assert found is not None
    assert found.message.count("a height at") == 4
    assert found.message.endswith("and 5 more")


CIRCLE = {"type": "Point", "coordinates": [8.5, 47.3], "extent": {"subType": "Circle", "radius": 150}}
GATHERED = {"type": "GeometryCollection", "geometries": [OUTLINE]}


@pytest.mark.parametrize("other", [CIRCLE, GATHERED])
def test_area_in_another_form_counts_as_an_area(other: Any) -> None:
    """Without `feature`, the only polygon of a file is selected only if there is no other area."""
    tree = {"type": "FeatureCollection", "features": [feature(), feature(other) | {"id": "other"}]}
    found = refused(tree)
    assert found is not None
    assert "2 of its 2 features are areas" in found.message
    assert refused(tree, "z") is None


NAMES = ("EPSG:4326", "urn:ogc:def:crs:EPSG::4326", "urn:ogc:def:crs:EPSG:6.6:4326", "urn:ogc:def:crs:OGC:1.3:CRS84",
         "urn:ogc:def:crs:OGC::CRS84", "http://www.opengis.net/def/crs/EPSG/0/4326", "WGS84", "WGS 84",
         "OGC:CRS84")  # fmt: skip
OTHERS = ("EPSG:43260", "EPSG:3857", "urn:ogc:def:crs:EPSG::4327", "", "4326")


@rows("name, taken", [(each, True) for each in NAMES] + [(each, False) for each in OTHERS])
def test_crs_of_wgs_84_is_read_longitude_first(name: str, taken: bool) -> None:
    tree = {"type": "FeatureCollection", "crs": {"type": "name", "properties": {"name": name}}, "features": [feature()]}
    assert (refused(tree) is None) is taken
    if taken:
        (found,) = read_area(json.dumps(tree).encode(), None)
        assert found.outer[0] == (85450000, 473970000)


JSON = st.recursive(
    st.none() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=8,
)


@given(st.sampled_from(["layer", "CEILING", "upperLimit", "validFrom", "radius"]), st.text("abc", max_size=4), JSON)
def test_member_with_a_value_is_found_at_any_depth(name: str, way: str, value: Any) -> None:
    tree: Any = {name: value}
    for each in way:
        tree = {each: tree} if each != "c" else {each: [None, tree]}
    assert (refused(feature(**tree)) is None) is (value in (None, "", [], {}))


def test_words_of_member_names_are_split_in_any_style() -> None:
    for name in (
        "upper-limit",
        "UpperLimit",
        "UPPER_LIMIT",
        "upper limit",
        "upperlimit",
        "MaxUpperLimitFt",
        "ft:upper",
    ):
        assert said_by(name) is not None, name
    for name in ("supper", "uppercut", "flowers", "altar", "timeless", "friend", "startup", "floral", "dayton"):
        assert said_by(name) is None, name
