"""Files that are imported come from strangers: whatever they contain, the answer is a refusal, in bounded time."""

import contextlib
import copy
import io
import json
import socket
import warnings
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reference.qgc_plans import RETURN, TAKEOFF, at, circle, fence, mapped, plan, structure, survey
from reference.zone_files import (
    CIRCLE,
    HOLE,
    SQUARE,
    ed269,
    ed318,
    faa,
    geojson,
    kml,
    kmz,
    mark,
    openaip,
    polygon,
    volume,
)
from reference.zone_files import write as zone_file
from rtshcua.app import importing
from rtshcua.app.gateway.outlines import read_outline
from rtshcua.app.importing import ImportedSource, ImportRequest, import_file
from rtshcua.diagnostics.diagnostic import has_errors
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.front.cli import app
from rtshcua.ground.exchange.losses import NotReadable
from rtshcua.ground.exchange.plan_source import draft_policy, fence_zones, mission_text
from rtshcua.ground.exchange.plan_steps import StepTable, plan_steps
from rtshcua.ground.exchange.plan_surveys import cover_survey, covered_plan
from rtshcua.ground.exchange.qgc_reading import read_plan_file
from rtshcua.ground.exchange.qgc_surveys import NoSurvey
from rtshcua.ground.exchange.stock_policy import GeoPoint
from rtshcua.ground.exchange.zone_source import SourceNames
from rtshcua.ground.language.size_limits import MAX_SIZE

WHOLE = plan(
    TAKEOFF, at(16, 2, 1, 20, 5), survey(at(16, 3, 1, 25)), mapped(), structure(), RETURN,
    polygons=[fence()], circles=[circle(9, 9, 10)], rally=[[47.3, 8.5, 3]],
)  # fmt: skip
#: values in the place of others
VALUES: tuple[Any, ...] = (
    None, True, False, "", "x" * 300, "\u202e\x00", [], {}, [[]], [[[[]]]], {"type": 1}, 0, -1, 0.5, 1e300, -1e300,
    1e-300,
    2**31, 2**63, 10**60, [1], [1, 2], [1, 2, 3], [None] * 7, ["x"] * 7, [1e9] * 7, 65_536, 16, 22, "SimpleItem",
)  # fmt: skip
NOT_A_PLAN: tuple[bytes, ...] = (
    b"", b"{", b"\xff\xfe", b"null", b"[]", b"{}", b'{"fileType": "Plan"', b'{"fileType": "Plan", "mission": NaN}',
    b'{"fileType": "Plan", "mission": ' + b"[" * 100_000, b'{"fileType": "Plan", "a": ' + b'{"a":' * 50_000,
    b'{"fileType": "Plan", "mission": {"items": [' + b"1e999999999," * 1_000 + b"1]}}",
    b'{"fileType": "Plan", "version": ' + b"9" * 10_000 + b"}",
    b'{"fileType": "Plan", "fileType": "Plan"}', b'{"fileType": "Plan", "a": [' + b"0," * 300_000 + b"0]}",
    b'{"fileType": "Plan", "a": [' + b"[0,0]," * 300_000 + b"[0,0]]}",
)  # fmt: skip


def nodes(tree: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The paths to all values of a tree."""
    if path:
        yield path
    for key, each in tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ():
        yield from nodes(each, (*path, key))


PATHS = tuple(nodes(WHOLE))


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> StepTable:
    path = tmp_path_factory.mktemp("hostile") / "whole.plan"
    path.write_text(json.dumps(WHOLE), encoding="utf-8")
    policy = importing._drafted(ImportRequest(path), read_plan_file(path.read_bytes()), SourceNames())
    assert not isinstance(policy, Refusal)
    return policy.table


def read_whole(table: StepTable, data: bytes) -> None:
    """Read a plan and write all that is made of it."""
    try:
        found = read_plan_file(data)
    except NotReadable:
        return
    fence_zones(found, SourceNames())
    steps = plan_steps(found, table)
    for each in (*found.not_kept, *steps.not_kept):
        assert all((each.name, each.place.startswith("/"), each.why))
    header = importing.MissionHeader("m", "p", 1, "v", "operator", "x.plan")
    assert mission_text(header, steps.steps).startswith("mission m under p@1 on v {\n")
    if found.home is not None:
        home, surveys = GeoPoint(*found.home), []
        for each in found.surveys.values():
            with contextlib.suppress(NoSurvey):
                if not isinstance(each, str):
                    surveys.append(cover_survey(found, each, home, SourceNames()))
        draft_policy(covered_plan(found, surveys), home, SourceNames(), surveys)


@pytest.mark.slow
@settings(max_examples=400, deadline=None)
@given(st.sampled_from(PATHS), st.sampled_from(VALUES), st.sampled_from(PATHS), st.sampled_from(VALUES))
def test_a_plan_with_other_values_is_read_or_refused(
    table: StepTable, one: tuple[Any, ...], value: Any, other: tuple[Any, ...], another: Any
) -> None:
    tree = copy.deepcopy(WHOLE)
    for path, new in ((one, value), (other, another)):
        place: Any = tree
        try:
            for key in path[:-1]:
                place = place[key]
            place[path[-1]] = copy.deepcopy(new)  # the other change may be within it
        except (KeyError, IndexError, TypeError):
            pass  # the other change removed it
    read_whole(table, json.dumps(tree).encode())


@pytest.mark.parametrize("number", range(len(NOT_A_PLAN)))
def test_what_is_no_plan_is_refused(number: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "hostile.plan"
    path.write_bytes(NOT_A_PLAN[number])
    assert app.main(["import", str(path)]) == ExitCode.INPUT
    assert "Traceback" not in capsys.readouterr().err


def test_a_file_that_is_too_large_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "large.plan"
    with path.open("wb") as file:
        file.truncate(MAX_SIZE + 1)
    found = import_file(ImportRequest(path))
    assert isinstance(found, Refusal)
    assert "more than" in found.text


def test_a_hostile_name_of_a_file_is_shown_harmlessly(tmp_path: Path) -> None:
    path = tmp_path / 'a\u202e"\n zone x = circle(0 N, 0 E, 1 m)\\.plan'
    path.write_text(json.dumps(WHOLE), encoding="utf-8")
    found = import_file(ImportRequest(path))
    assert isinstance(found, ImportedSource)
    assert "\u202e" not in found.text
    assert "\nzone x" not in found.text.replace("\n zone x", "\nzone x")
    assert not [each for each in found.diagnostics if each.code.id.startswith("E01")], "one comment, one string"


@pytest.mark.parametrize("name", ["copter", "goto", "battery", "field"])
def test_the_name_of_a_file_takes_no_name_of_the_policy(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"{name}.plan"
    path.write_text(json.dumps(WHOLE), encoding="utf-8")
    found = import_file(ImportRequest(path, skip=("all",)))
    assert isinstance(found, ImportedSource)
    assert not has_errors(found.diagnostics), found.diagnostics
    assert f"mission {name}" in found.text


# ---------------------------------------------------------------- zones

BOMB = '<!DOCTYPE k [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]><kml>&b;</kml>'
EXTERNAL = '<!DOCTYPE k [<!ENTITY x SYSTEM "file:///etc/passwd">]><kml><Document><name>&x;</name></Document></kml>'
DEEP = "<kml>" + "<Folder>" * 200_000
RING = "<LinearRing><coordinates>8,47 8.1,47 8.1,47.1 8,47</coordinates></LinearRing>"
BAD_KML: dict[str, bytes] = {
    "entities": BOMB.encode(),
    "another file": EXTERNAL.encode(),
    "deep": DEEP.encode(),
    "deep and closed": (DEEP + "</Folder>" * 200_000 + "</kml>").encode(),
    "no XML": b"<kml><Document",
    "no encoding": b'<?xml version="1.0" encoding="no-such"?><kml/>',
    "no position": kml(mark(polygon().replace("8.544,", "NaN,"))).encode(),
    "a huge number": kml(mark(polygon().replace("8.544,", "1e999,"))).encode(),
    "a long number": kml(mark(polygon().replace("8.544,", "8" * 5_000 + ","))).encode(),
    "no outline": kml(mark("<Polygon/>")).encode(),
    "two outer rings": kml(mark(polygon().replace("</outer", f"{RING}</outer"))).encode(),
    "a hole alone": kml(
        mark(polygon(hole=True).replace("<LinearRing>", "<Ring>", 1).replace("</LinearRing>", "</Ring>", 1))
    ).encode(),
    "two lists of positions": kml(mark(polygon().replace("</coordinates>", "</coordinates><coordinates/>"))).encode(),
    "an element among positions": kml(mark(polygon().replace("</coordinates>", "<b/></coordinates>"))).encode(),
    "many placemarks": kml("<Placemark/>" * 10_001).encode(),
    "no area": kml(mark("")).encode(),
}


@pytest.mark.parametrize("name", BAD_KML)
def test_hostile_kml_is_refused(name: str, tmp_path: Path) -> None:
    path = zone_file(tmp_path, BAD_KML[name], "hostile.kml")
    found = import_file(ImportRequest(path))
    assert isinstance(found, Refusal) or found.not_kept
    inside = read_outline(path)
    assert isinstance(inside, Refusal), "the gateway has the same reader"


def _bomb() -> bytes:
    """An archive that unfolds to 80 MB."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("doc.kml", "w") as file:
        for _ in range(10):
            file.write(b" " * 8_000_000)
    return made.getvalue()


def _lying() -> bytes:
    """An archive whose directory says that its document is small."""
    data = bytearray(kmz(doc_kml=kml(mark(polygon())).encode()))
    at_ = data.rindex(b"PK\x01\x02")
    data[at_ + 24 : at_ + 28] = (1).to_bytes(4, "little")
    return bytes(data)


def _many() -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        for number in range(10_001):
            archive.writestr(f"{number}.txt", b"")
    return made.getvalue()


def _twice() -> bytes:
    """An archive with two documents of one name: readers differ in which one they read."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive, warnings.catch_warnings(action="ignore"):
        for name in ("north", "south"):
            archive.writestr("doc.kml", kml(mark(polygon(), name)))
    return made.getvalue()


ARCHIVES: dict[str, Any] = {
    "bomb": _bomb,
    "lying": _lying,
    "many": _many,
    "empty": kmz,
    "twice": _twice,
    "no document": lambda: kmz(a_txt=b"x"),
    "cut": lambda: kmz(doc_kml=kml(mark(polygon())).encode())[:-30],
    "broken": lambda: kmz(doc_kml=kml(mark(polygon())).encode() * 9).replace(b"\x00\x00", b"\xff\x00", 2),
    "no archive": lambda: b"PK\x03\x04" + bytes(1_000),
}


@pytest.mark.parametrize("name", ARCHIVES)
def test_a_hostile_archive_is_refused(name: str, tmp_path: Path) -> None:
    found = import_file(ImportRequest(zone_file(tmp_path, ARCHIVES[name](), "hostile.kmz")))
    assert isinstance(found, Refusal), found


def test_nothing_of_an_archive_is_extracted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    monkeypatch.chdir(inner)
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        archive.writestr("../../outside.kml", kml(mark(polygon())))
        archive.writestr("/absolute.kml", kml(mark(polygon())))
    found = import_file(ImportRequest(zone_file(inner, made.getvalue(), "site.kmz")))
    assert isinstance(found, ImportedSource)
    assert found.zones == 1
    assert [*tmp_path.rglob("*.kml")] == []


def test_a_link_is_not_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def reached(*_: object, **__: object) -> None:
        raise AssertionError("something was looked up in the network")

    monkeypatch.setattr(socket, "getaddrinfo", reached)
    monkeypatch.setattr(socket.socket, "connect", reached)
    link = "<NetworkLink><Link><href>http://127.0.0.1:9/x.kml</href></Link></NetworkLink>"
    icon = "<Style><IconStyle><Icon><href>file:///etc/passwd</href></Icon></IconStyle></Style>"
    path = zone_file(tmp_path, kml(link, icon, mark(polygon())), "a.kml")
    found = import_file(ImportRequest(path, skip=("NetworkLink",)))
    assert isinstance(found, ImportedSource)
    assert found.zones == 1


ZONE_FILES = {
    "ed-269": ed269(geometry=[volume(), volume(CIRCLE)]),
    "ed-318": ed318(),
    "openaip": openaip((2500, 1, 1), (0, 1, 0), hoursOfOperation={"operatingHours": []}),
    "faa": faa(TIMESOFUSE="H24"),
    "geojson": geojson({"name": "field"}, "MultiPolygon", [[SQUARE, HOLE]]),
    "line": geojson({}, "LineString", SQUARE),
}
CHANGES = [(name, path) for name, value in ZONE_FILES.items() for path in nodes(value)]


@pytest.mark.slow
@settings(max_examples=500, deadline=None)
@given(st.sampled_from(CHANGES), st.sampled_from((*VALUES, "Polygon", "Point", "AGL", "M", "NaN", "2026-01-01T00:00Z")))
def test_zones_with_other_values_are_read_or_refused(change: tuple[str, tuple[Any, ...]], value: Any) -> None:
    name, path = change
    tree = copy.deepcopy(ZONE_FILES[name])
    place: Any = tree
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    request = ImportRequest(Path("x.json"), terrain="400..460", clock="utc", width="20")
    terms = importing._terms(request)
    assert not isinstance(terms, Refusal)
    with contextlib.suppress(NotReadable):
        importing._imported_json(request, terms, json.dumps(tree).encode())


@pytest.mark.parametrize(
    "said", [True, 5, 1e300, {"a": "b"}, [["x"], 1], "a\n// b\u2028zone x = circle(0 N, 0 E, 1 m)"]
)
def test_conditions_of_any_form_are_one_comment(said: Any, tmp_path: Path) -> None:
    data = json.dumps(ed269(restriction="CONDITIONAL", restrictionConditions=said)).encode()
    found = import_file(ImportRequest(zone_file(tmp_path, data, "zones.json"), terrain="400..460"))
    assert isinstance(found, ImportedSource)
    assert [line.split(" ")[1] for line in found.text.splitlines() if line.startswith("zone ")] != ["x"]
    assert found.text.count("\nzone ") == 1
    assert not has_errors(found.diagnostics)


@pytest.mark.parametrize("number", range(len(NOT_A_PLAN)))
def test_what_is_no_file_with_zones_is_refused(number: int, tmp_path: Path) -> None:
    found = import_file(ImportRequest(zone_file(tmp_path, NOT_A_PLAN[number], "hostile.geojson")))
    assert isinstance(found, Refusal)
