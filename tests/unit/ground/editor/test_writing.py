"""Completion, signatures, outline and code actions while a text is written."""

from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtshcua.diagnostics.codes import REGISTRY
from rtshcua.diagnostics.diagnostic import Applicability, Diagnostic, Fix
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.editor.code_actions import actions, all_safe
from rtshcua.ground.editor.code_completion import complete, signature
from rtshcua.ground.editor.document_structure import folds, outline
from rtshcua.ground.editor.incremental_parse import parse_text
from rtshcua.ground.editor.workspace import Workspace
from rtshcua.mavlink import dialect

FILE = "/w/new.rts"
HEAD = 'import "lake.rts"\n'
POLICY = HEAD + "policy p version 1 {\n  "
VEHICLE = HEAD + "vehicle v {\n  "
SCENARIO = 'import "dip.rts"\nscenario "s" {\n  '
MISSION = HEAD + "mission m under lake@1 on quad {\n  "
MAPPING = (
    HEAD
    + """vehicle mapping_quad {
  identity "m-1"  home 47.39774 N, 8.54559 E within 50 m  speed at most 12 m/s  climb at most 3 m/s
  position error 3 m  energy 100 % = 18 min hover  reserve 15 %
  camera eye sensor 13.2 mm by 8.8 mm focal 8.8 mm pixels 5472 by 3648 every at least 700 ms exposure at most 1 ms
}
"""
)
SKILL = HEAD + "skill s(far: length in 1 m .. 5 m, area: zone) {\n  "


def proposed(desk: Workspace, before: str, after: str = "") -> dict[str, str]:
    """The proposals between two texts, with their kinds."""
    now = desk.put(FILE, before + after)
    return {item.text: item.kind for item in complete(desk, desk.view(FILE), now, len(before), dialect.load())}


@pytest.mark.parametrize(
    ("before", "some", "none"),
    [
        (HEAD, ["zone", "policy", "mission", "import", "test", "nominal"], ["pond", "permit", "and"]),
        (HEAD + "zo", ["zone"], ["permit"]),
        (POLICY, ["permit", "forbid", "airspace", "contingency", "without"], ["zone", "pond", "deadline"]),
        (SKILL + "accepts ", ["MAV_CMD_NAV_TAKEOFF", "item", "message", "mode"], ["look", "area", "HOLD"]),
        (SKILL + "accepts item ", ["MAV_CMD_NAV_WAYPOINT"], ["look", "item"]),
        (SKILL + "emits ", ["MAV_CMD_IMAGE_START_CAPTURE", "MAV_CMD_DO_SET_SERVO"], ["MAV_CMD_NAV_LAND", "look"]),
        (SKILL + "emits MAV_CMD_IMAGE_START_CAPTURE to camera with ", ["param3"], ["param7", "far"]),
        (SKILL + "emits MAV_CMD_IMAGE_START_CAPTURE to camera with param1 = ", ["far", "area"], ["param3", "look"]),
        (SKILL + "emits MAV_CMD_IMAGE_START_CAPTURE to camera with param1 = far, ", ["param3"], ["far", "param7"]),
        (SKILL + "accepts message ", ["SET_POSITION_TARGET_GLOBAL_INT"], ["MAV_CMD_NAV_TAKEOFF"]),
        (SKILL + "accepts mode ", ["RETURN", "RTL"], ["MAV_CMD_NAV_TAKEOFF"]),
        (SKILL + "accepts mode RTL on ", ["px4", "ardupilot"], ["quad"]),
        (SKILL + "accepts MAV_CMD_NAV_TAKEOFF ", ["on", "where", "with", "record"], ["param7"]),
        (SKILL + "accepts MAV_CMD_NAV_TAKEOFF with ", ["far", "area"], ["param7", "look"]),
        (SKILL + "accepts MAV_CMD_NAV_TAKEOFF with far = ", ["param7", "here", "parameter"], ["look", "far"]),
        (SKILL + "accepts MAV_CMD_NAV_TAKEOFF with far = param7 or ", ["here", "default"], ["param7", "look"]),
        (SKILL + "accepts MAV_CMD_NAV_TAKEOFF with far = param7, ", ["area"], ["param7"]),
        (SKILL + "accepts MAV_CMD_NAV_TAKEOFF with far = (param5, ", ["param6"], ["area"]),
        (SKILL + "accepts MAV_CMD_NAV_TAKEOFF where ", ["param1"], ["area", "param2"]),
        (SKILL + "accepts MAV_CMD_NAV_TAKEOFF where param1 = ", [], ["area", "param2"]),
        (SKILL + "accepts message HEARTBEAT where ", ["base_mode"], ["param1"]),
        (SKILL + "accepts MAV_CMD_NAV_LAND require ", ["battery", "far"], ["param1", "MAV_CMD_NAV_LAND"]),
        (VEHICLE + "without ", ["gps.fix", "position"], ["pond", "quad", "evidence"]),
        (POLICY + "permit ", ["look", "goto", "any"], ["pond", "quad", "operator"]),
        (POLICY + "permit look, ho", ["hover", "goto"], ["pond"]),
        (POLICY + "permit look by ", ["role", "any"], ["look"]),
        (POLICY + "permit look by role ", ["operator"], ["agent", "look"]),
        (POLICY + "permit look by role operator through ", ["agent", "operator", "onboard", "reflex"], ["look"]),
        (POLICY + "permit look by any when ", ["battery", "target", "pond", "not", "local time"], ["through"]),
        (POLICY + "permit look by any when target inside ", ["pond", "city", "grow"], ["battery", "look"]),
        (POLICY + "permit look by any when gps.fix >= ", ["fix_3d", "no_gps"], ["calm"]),
        (POLICY + "permit look by any when manner == ", ["slow", "fast"], ["fix_3d"]),
        (POLICY + "permit look by any when sea.mood in {", ["calm", "wild"], ["fix_3d"]),
        (POLICY + "permit look by any when phase == ", ["survey", "recovery"], ["calm"]),
        (POLICY + "permit look by any when battery > 20 ", ["%"], ["m", "s"]),
        (POLICY + "permit look by any when wind.speed > 20 ", ["m/s", "km/h"], ["%", "m"]),
        (POLICY + "permit look by any when local time in 08:00 .. 18:00 on ", ["monday", "sunday"], ["quad", "lake"]),
        (POLICY + "permit look by any when local time on monday, ", ["friday"], ["quad"]),
        (HEAD + "zone z = circle(47.1 N, 8.1 E, 9 m) active on ", ["saturday"], ["quad"]),
        (POLICY + "airspace inside ", ["pond", "city"], ["look"]),
        (POLICY + "contingency ", ["hover", "return_home"], ["pond"]),
        (POLICY + "use ", ["near"], ["look"]),
        (POLICY + "use near(", ["over = ", "who = ", "pond"], ["battery"]),
        (POLICY + "use near(pond, who = ", ["operator"], ["pond"]),
        (HEAD + "mission m under ", ["lake"], ["quad", "pond"]),
        (HEAD + "mission m under lake@1 on ", ["quad"], ["lake", "pond"]),
        (MISSION, ["phase", "intent", "proposed by", "lasts at most"], ["permit", "zone"]),
        (MISSION + "phase a { ", ["look(", "hover(", "repeat"], ["pond"]),
        (MISSION + "phase a { look(", ["target = ", "pond.entry"], ["battery", "city.entry"]),
        (MISSION + "phase a { look(pond.entry, manner = ", ["slow", "fast"], ["pond"]),
        (MISSION + "phase a { takeoff(altitude = 20 m) look(pond.entry) on inadmissible ", ["abort", "skip"], []),
        (SCENARIO, ["flies", "aboard", "seeds", "start", "at", "after", "when", "expect"], ["permit", "dip"]),
        (SCENARIO + "flies ", ["dip"], ["look", "lake"]),
        (SCENARIO + "aboard px4, ", ["ardupilot"], ["dip"]),
        (SCENARIO + "start ", ["wind("], ["dip"]),
        (SCENARIO + "at 20 s ", ["gps_loss(", "link_silence("], ["dip", "look", "m"]),
        (SCENARIO + "at 20 ", ["s", "min"], []),
        (SCENARIO + "after ", ["look"], ["dip"]),
        (SCENARIO + "when ", ["height", "not"], ["dip"]),
        (SCENARIO + "at 20 s link_silence(", ["for = ", "way = ", "held = "], ["look"]),
        (SCENARIO + "at 20 s link_silence(for = 2 s, ", ["way = ", "held = "], ["for = "]),
        (SCENARIO + "at 20 s link_silence(way = ", ["both", "up", "down"], ["look"]),
        (SCENARIO + "at 20 s wind(speed = 3 ", ["m/s", "km/h"], ["s", "%", "m"]),
        (SCENARIO + "expect ", ["ends", "flies", "never", "reaction", "distance to", "lands in", "deny"], ["dip"]),
        (SCENARIO + "expect ends completed, ", ["aborted", "stood_down"], ["dip"]),
        (SCENARIO + "expect flies ", ["look"], ["dip"]),
        (SCENARIO + "expect distance to ", ["pond"], ["look"]),
        (SCENARIO + "expect lands in ", ["pond"], ["look"]),
        (SKILL, ["motion", "deadline", "lasts at most", "require", "record"], ["permit"]),
        (SKILL + "class ", ["tactical", "semantic", "reflex"], ["decision"]),
        (SKILL + "record intent, ", ["decision", "synced_first"], ["tactical"]),
        (SKILL + "motion cover ", ["area", "far"], ["pond"]),
        (SKILL + "motion cover area at far distance ", ["far"], ["pond"]),
        (MAPPING + "skill s() {\n  pictures by ", ["eye"], ["pond", "agent"]),
        (MAPPING + "skill s() {\n  pictures by eye ", ["every", "resolution", "blur"], ["eye"]),
        (SKILL + "require far < 3 ", ["m", "cm"], ["s", "%"]),
        (SKILL + "deadline 5 ", ["s", "min"], []),
        (SKILL + "fallback ", ["hover", "goto"], ["pond"]),
        (HEAD + "sizes ", ["goto"], ["pond"]),
        (HEAD + "sizes goto(highest = 90 m, ", ["longest = "], ["target = ", "highest = "]),
        (HEAD + "signal a : ", ["speed", "position", "mood"], ["pond"]),
        (HEAD + "signal a : speed = ", ["HEARTBEAT", "WIND"], ["battery"]),
        (HEAD + "signal a : speed = WIND.", ["WIND.speed", "WIND.direction"], []),
        (HEAD + "enum a = ", ["MAV_STATE"], ["battery"]),
        (HEAD + "zone a = ", ["circle", "polygon", "union"], ["battery"]),
        (HEAD + "zone a = union(", ["pond", "city"], ["battery"]),
        (HEAD + 'import "', ["lib:skills/", "lake.rts", "site.rts"], ["new.rts", "battery"]),
        (HEAD + 'import "lib:', ["lib:skills/", "lib:policies/"], ["lib:docs/", "lake.rts"]),
        (HEAD + 'import "lib:skills/', ["lib:skills/goto.rts"], ["lake.rts"]),
        (HEAD + "// so", [], ["zone", "pond"]),
        (POLICY + 'permit look by any when /* battery', [], ["battery"]),
        (POLICY + "forbid )\n  permit ", ["look"], ["pond"]),  # after an error in the same block
    ],
)  # fmt: skip
def test_completion_proposes_what_fits(desk: Workspace, before: str, some: list[str], none: list[str]) -> None:
    found = proposed(desk, before, "\n\nzone z = pond\n")
    assert [each for each in some if each not in found] == []
    assert [each for each in none if each in found] == []


@settings(max_examples=settings().max_examples // 2)
@given(st.integers(0, 10_000), st.integers(0, 400))
def test_completion_never_fails(make_lake: Workspace, start: int, cut_off: int) -> None:
    """At every place of a text, and a proposal begins at the start of the word."""
    text = "".join(make_lake.text(file) or "" for file in ("/w/site.rts", "/w/look.rts", "/w/lake.rts", "/w/dip.rts"))
    start %= len(text)
    desk = make_lake.with_texts({FILE: text[:start] + text[start + cut_off :]})
    now = desk.open[FILE]
    for item in complete(desk, desk.view(FILE), now, start, dialect.load()):
        assert 0 <= item.start <= start
    signature(desk.view(FILE), now, start)


@pytest.mark.parametrize(
    ("before", "label", "active"),
    [
        ("phase a { look(", "look(target: position", 0),
        ("phase a { look(pond.entry, ", "look(", 1),
        ("phase a { look(pond.entry, manner = fa", "look(", 2),
        ("phase a { look(pond.entry, height_above = (1 m + 2 m)", "look(", 1),
        ("phase a { look(pond.entry)", None, 0),
        ("phase a { nothing(", None, 0),
    ],
)
def test_signature_of_the_open_call(desk: Workspace, before: str, label: str | None, active: int) -> None:
    now = desk.put(FILE, MISSION + before)
    found = signature(desk.view(FILE), now, len(MISSION + before))
    assert (found is None) == (label is None)
    if found is not None and label is not None:
        assert found.label.startswith(label)
        assert found.active == active
        assert found.note == "Look at something from near."


def test_outline_and_folding_ranges() -> None:
    text = 'import "a"\nimport "b"\n\n// one\n// two\nenum e {\n  a = 1,\n  b = 2,\n}\n'
    text += "mission m under p@1 on q {\n  phase x { }\n}\n"
    now = parse_text(Source(FILE, text))
    assert [(each.kind, each.name, [one.name for one in each.inner]) for each in outline(now)] == [
        ("enum", "e", ["a", "b"]),
        ("mission", "m", ["x"]),
    ]
    assert [(text[:each.start].count("\n"), text[: each.end].count("\n"), each.kind) for each in folds(now)] == [
        (3, 4, "comment"), (5, 8, ""), (9, 11, ""), (0, 1, "imports"),
    ]  # fmt: skip


def finding(code: str, start: int, end: int, *fixes: tuple[int, int, str, Applicability]) -> Diagnostic:
    made = tuple(Fix(Span(FILE, a, b), text, f"write `{text}`", how) for a, b, text, how in fixes)
    return Diagnostic(REGISTRY[code], "wrong", Span(FILE, start, end), fixes=made)


def test_code_actions_of_findings() -> None:
    safe, suggested = Applicability.SAFE, Applicability.SUGGESTED
    text = "zone a = b\n  zone C = d\n"
    found = [
        finding("E1302", 18, 19, (18, 19, "c", suggested)),
        finding("E1305", 0, 4, (0, 4, "", safe)),
        finding("E0201", 9, 10),
        finding("E1305", 2, 6, (2, 6, "", safe)),  # overlaps the other one
        finding("E1305", 9, 10, (9, 10, "x", safe)),
    ]
    here = [(each.title, [(fix.span.start, fix.replacement) for fix in each.fixes], each.safe)
            for each in actions(found, FILE, 18, 18, text)]  # fmt: skip
    assert here == [
        ("write `c`", [(18, "c")], False),
        ("ignore `naming` here, with a reason",
         [(11, "  // rtshcua: ignore E1302 because\n")], False),
        ("apply all safe fixes", [(0, ""), (9, "x")], True),
    ]  # fmt: skip
    assert [each.title for each in actions(found, FILE, 9, 9, text)][:2] == [
        "write `x`",
        "ignore `unused-import` here, with a reason",
    ]
    assert len(all_safe(found, FILE)) == 2
    assert list(actions(found, "/w/other.rts", 0, 99, text)) == []


def test_workspace_prefers_an_open_text_to_the_file_on_disk(make: Callable[[dict[str, str]], Workspace]) -> None:
    desk = make(
        {"/w/a.rts": 'import "b.rts"\nzone one = union(two, two)\n', "/w/b.rts": "zone two = circle(47 N, 8 E, 5 m)\n"}
    )
    assert "two" in desk.view("/w/a.rts").symbols.zones
    desk.put("/w/b.rts", "zone three = circle(47 N, 8 E, 5 m)\n")
    assert set(desk.view("/w/a.rts").symbols.zones) == {"one", "three"}
    desk.close("/w/b.rts")
    assert "two" in desk.view("/w/a.rts").symbols.zones
    assert desk.text("/w/none.rts") is None
