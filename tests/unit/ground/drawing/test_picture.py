"""Pictures are well-formed, self-contained SVG 1.1, and hostile names do no harm."""

import re
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from rtshcua.app.programs import compile_sources
from rtshcua.ground.drawing.drawn_site import FlightMark, FlownPlace, FlownWay, PlannedWay, Site
from rtshcua.ground.drawing.flat_site import site_of, way_of
from rtshcua.ground.drawing.height_profile import planned_heights
from rtshcua.ground.drawing.picture import PictureSheet, picture
from rtshcua.ground.drawing.zone_map import ZoneMap, mission_map

MISSIONS = Path(__file__).resolve().parents[4] / "missions"
SVG = "{http://www.w3.org/2000/svg}"
HOSTILE = [
    "]]><script>alert(1)</script>",
    '"><image href="http://example.org/x.png"/>',
    "&lt;&amp;&#x3c;",
    "a\u202eb\u2066c\x00\x07\ufffe\r\n",
    "</style><style>*{fill:url(http://example.org)}",
    "{{ 7 * 7 }}",
    "x" * 4_000,
]


@pytest.fixture(scope="module")
def standard() -> tuple[Site, PlannedWay]:
    compiled, _ = compile_sources([MISSIONS / "extended.rts"], mission=None, issued_at_us=0)
    assert compiled.policy is not None
    assert compiled.mission is not None
    return site_of(compiled.policy, 408_000), way_of(compiled.mission)


def sheet(site: Site, way: PlannedWay, title: str = "t") -> PictureSheet:
    return PictureSheet(title, (f"About {title}.",), mission_map(site, way), planned_heights(site, way), (title,))


def check(text: str) -> ET.Element:
    """Parse a picture, and check that it refers to nothing outside of it."""
    root = ET.fromstring(text)
    ids = [each.attrib["id"] for each in root.iter() if "id" in each.attrib]
    assert len(ids) == len(set(ids))
    for each in root.iter():
        assert each.tag.removeprefix(SVG) in {
            "svg", "title", "desc", "style", "defs", "clipPath", "g", "rect", "path", "circle", "polyline", "text",
        }  # fmt: skip
        for name, value in each.attrib.items():
            assert not name.startswith("on")
            assert "href" not in name
            assert name not in ("style", "src", "vector-effect")
            assert all(found in ids for found in re.findall(r"url\(#(.*?)\)", value))
    (style,) = root.iter(f"{SVG}style")
    assert style.text is not None
    assert not re.search(r"@import|url\(|var\(", style.text)
    return root


def test_picture_is_self_contained(standard: tuple[Site, PlannedWay]) -> None:
    text = picture("two", [sheet(*standard), sheet(*standard, "again")])
    root = check(text)
    assert root.attrib["version"] == "1.1"
    assert [each.tag for each in root][:3] == [f"{SVG}title", f"{SVG}desc", f"{SVG}style"]
    assert root.attrib["aria-labelledby"] == "title desc"
    assert text == picture("two", [sheet(*standard), sheet(*standard, "again")])


def test_dark_colours_are_in_a_media_query(standard: tuple[Site, PlannedWay]) -> None:
    text = picture("t", [sheet(*standard)])
    light, dark = re.findall(r"<style.*?>(.*)</style>", text, re.DOTALL)[0].split(
        "@media (prefers-color-scheme: dark) {"
    )
    for page in (light, dark):
        assert len(re.findall(r"\.zone\.forbidden \{.*?stroke: #\w{6};", page)) == 1
    assert ".sheet { fill: #fbfcfd; }" in light
    assert ".sheet { fill: #191f25; }" in dark


def test_everything_drawn_is_within_its_page(standard: tuple[Site, PlannedWay]) -> None:
    root = check(picture("t", [sheet(*standard)]))
    width, height = float(root.attrib["width"]), float(root.attrib["height"])
    for each in root.iter(f"{SVG}text"):
        assert 0 <= float(each.attrib["x"]) < width
        assert 0 < float(each.attrib["y"]) < height


@pytest.mark.parametrize("hostile", HOSTILE)
def test_hostile_names_are_escaped(standard: tuple[Site, PlannedWay], hostile: str) -> None:
    site, way = standard
    zones = tuple(replace(zone, name=hostile + zone.name, shape=hostile) for zone in site.zones)
    flown = FlownWay(((FlownPlace(0, 0, 0, 0), FlownPlace(9, 9, 9, 9)),), (FlightMark(5, 3, 3, hostile),))
    bad = replace(site, policy=hostile, zones=zones)
    named = replace(way, name=hostile)
    one = sheet(bad, named, hostile)._replace(plan=mission_map(bad, named, flown=flown))
    text = picture(hostile, [one])
    check(text)
    assert not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f\u202e\u2066\ufffe]", text)
    assert ("7 * 7" in hostile) == ("{{ 7 * 7 }}" in text)


def test_long_texts_are_cut(standard: tuple[Site, PlannedWay]) -> None:
    root = check(picture("t", [PictureSheet("nothing", below=tuple(f"finding {n}" for n in range(500)))]))
    texts = [each.text for each in root.iter(f"{SVG}text")]
    assert "finding 39" in texts
    assert "and 460 more lines" in texts
    assert len(texts) < 60


def test_flown_track_and_marks_are_on_the_map(standard: tuple[Site, PlannedWay]) -> None:
    site, way = standard
    flown = FlownWay(
        (tuple(FlownPlace(n, n * 1_000, n * 500, 20_000) for n in range(100)), (FlownPlace(200, -90_000, 0, 0),)),
        tuple(FlightMark(n, n * 9_000, n * 4_500, f"step {n} allowed") for n in range(1, 9)),
    )
    plan: ZoneMap = mission_map(site, way, flown=flown)
    assert len(plan.flown) == 2
    assert len(plan.flown[0].split(" ")) == 100
    assert {label.text for label in plan.labels} >= {f"step {n} allowed" for n in range(1, 9)}
    boxes = [label.box for label in plan.labels]
    assert not [pair for pair in combinations(boxes, 2) if pair[0].meets_any(pair[1:])]
    assert "flown" in {key.kind for key in plan.keys}
    assert all(0 < mark.x < plan.width and 0 < mark.y < plan.height for mark in plan.marks)
