"""Navigation: definitions, references across programs, and hover texts."""

from pathlib import Path

import pytest

from rtshcua.diagnostics.span import Span
from rtshcua.ground.editor.hover import hover
from rtshcua.ground.editor.navigation import definitions, references, targets
from rtshcua.ground.editor.occurrences import at
from rtshcua.ground.editor.workspace import Workspace
from rtshcua.library import root
from rtshcua.mavlink import dialect

DIP, LAKE, LOOK, SITE = "/w/dip.rts", "/w/lake.rts", "/w/look.rts", "/w/site.rts"


def place(desk: Workspace, file: str, around: str) -> int:
    """The offset of `|` in a piece of a file's text."""
    text = desk.text(file)
    assert text is not None
    before, _, after = around.partition("|")
    assert text.count(before + after) == 1, around
    return text.index(before + after) + len(before)


def shown(desk: Workspace, spans: list[Span] | tuple[Span, ...]) -> list[str]:
    """Spans as the file's name and the text of their line."""
    found = []
    for span in spans:
        text = desk.text(span.file) or ""
        line = text[text.rfind("\n", 0, span.start) + 1 :].split("\n")[0]
        found.append(f"{span.file.rpartition('/')[2]}: {line.strip()[:24]}")
    return found


@pytest.mark.parametrize(
    ("file", "around", "where"),
    [
        (DIP, "under la|ke", ["lake.rts: policy lake version 1 {"[:34]]),
        (DIP, "on survey|or", ["site.rts: vehicle surveyor {"]),
        (DIP, "lo|ok(over", ["look.rts: skill look(target: posit"]),
        (DIP, "look(ov|er.entry", ["dip.rts: mission dip(over: zone ="]),
        (DIP, "height|_above = up", ["look.rts: skill look(target: posit"]),
        (DIP, "manner = fa|st", ["look.rts: skill look(target: posit"]),
        (DIP, "sea.mood == ca|lm", ["site.rts: enum mood { calm = 0, wi"]),
        (DIP, "sea.|mood == calm", ["site.rts: signal sea.mood : mood ="]),
        (DIP, 'import "la|ke.rts"', ["lake.rts: import \"look.rts\""]),
        (LAKE, "near(ci|ty, top", ["site.rts: zone city = polygon("]),
        (LAKE, "near(city, t|op", ["lake.rts: template near(over: zone"]),
        (LAKE, "by role wh|o through", ["lake.rts: template near(over: zone"]),
        (LAKE, "when target inside gr|ow", []),
        (LAKE, "inside ov|er and", ["lake.rts: template near(over: zone"]),
        (LAKE, "height_ab|ove <= top", ["look.rts: skill look(target: posit"]),
        (LAKE, "phase == rec|overy", ["dip.rts: phase recovery  { return"]),
        (SITE, "difference(city, po|nd)", ["site.rts: zone pond = circle(47.39"]),
        (SITE, "sea.mood : mo|od", ["site.rts: enum mood { calm = 0, wi"]),
    ],
)  # fmt: skip
def test_definition_of_a_name(desk: Workspace, file: str, around: str, where: list[str]) -> None:
    view = desk.view(DIP)
    found = definitions(view, file, place(desk, file, around))
    assert shown(desk, found) == [each[: each.index(": ") + 26] for each in where]


def test_name_in_a_broken_declaration_is_found(desk: Workspace) -> None:
    desk.put(DIP, 'import "lake.rts"\nmission m under lake@1 on quad { phase p { look(pond.entry, } }')
    assert shown(desk, definitions(desk.view(DIP), DIP, place(desk, DIP, "look(po|nd"))) == [
        "site.rts: zone pond = circle(47.39"
    ]


def test_references_are_found_in_all_programs(desk: Workspace) -> None:
    """In the file that declares the zone and those that import it, but not in a program with another zone."""
    desk.put("/w/other.rts", "zone pond = circle(47.3 N, 8.5 E, 5 m)\nzone two = union(pond, pond)\n")
    view = desk.view(SITE)
    (target,) = targets(view, SITE, place(desk, SITE, "zone po|nd"))
    found = references(desk.views([DIP, LAKE, LOOK, SITE]), view, target)
    assert shown(desk, sorted(found)) == [
        "dip.rts: mission dip(over: zone =",
        "site.rts: zone pond = circle(47.39",
        "site.rts: zone shore = difference(",
    ]
    assert [span.file for span, gives in found.items() if gives] == [SITE]


@pytest.mark.parametrize(
    ("file", "around", "said"),
    [
        (
            SITE,
            "sea.mo|od : mood",
            ["signal sea.mood", "HEARTBEAT.custom_mode", "older than 2 s", "`255`"],
        ),
        (SITE, "zone po|nd", ["80 m × 80 m, 5,026 m²", "Where we practise."]),
        (SITE, "difference(city, p|ond)", ["zone pond"]),
        (SITE, "HEARTBEAT.custom|_mode", ["MAVLink field", "uint32_t"]),
        (SITE, "HEART|BEAT", ["MAVLink message", "`system_status`"]),
        (SITE, "4|0 m)  ceiling", ["length, kept as 40000 mm", "4000 cm", "0.04 km"]),
        (SITE, "6|0 m above home", ["altitude above home, kept as 60000 mm"]),
        (LOOK, "skill lo|ok", ["tactical skill; deadline 5 s", "require `gps.fix >= fix_3d`", "fallback `hover for"]),
        (LOOK, "12 m|/s", ["12000 mm/s", "43.2 km/h"]),
        (LOOK, "30 |%", ["ratio, kept as 3000 hundredths of 1 %"]),
        (LOOK, "height_abov|e: altitude", ["default `20 m`", "range 5 m .. 60 m"]),
        (LOOK, "class    tac|tical", ["timing class `tactical`: Begins within 30 s"]),
        (LOOK, "gr|ace    1 s", ["How long a clause may be unknown"]),
        (LAKE, "height_above <= t|op", ["parameter of `near`", "required"]),
        (LAKE, "contin|gency hover", ["The chain that flies if a step is denied in the air."]),
        (LAKE, "who = oper|ator", ["role `operator`"]),
        (DIP, "manner = fa|st", ["a choice for `manner` of `look`"]),
        (DIP, "sea.mood == ca|lm", ["`calm` = 0, a value of `mood`"]),
        (DIP, 'import "lake|.rts"', ["declares `near`, `lake`"]),
    ],
)
def test_hover_describes_a_name(desk: Workspace, file: str, around: str, said: list[str]) -> None:
    found = hover(desk.view(DIP), file, place(desk, file, around), dialect.load())
    assert found is not None
    assert [each for each in said if each not in found.text] == []


@pytest.mark.parametrize(
    ("around", "said"),
    [
        ("link_si|lence", ["fault `link_silence`: Nothing gets through", "`for = 10 s` (optional)"]),
        ("flies  d|ip", ["mission dip("]),
        ("after lo|ok", ["skill look("]),
        ("when hei|ght", ["signal height"]),
        ("mute(message = HEART|BEAT", ["MAVLink message `HEARTBEAT`"]),
        ("approve(role = oper|ator", ["role `operator`"]),
        ("distance to po|nd", ["zone pond"]),
        ("expect rea|ction", ["to the first frame of the fallback"]),
        ("because state/vio|lated", ["does not hold"]),
        ("f|lies  dip", ["the mission"]),
        ("signal ro|om", ["reported every 100 ms", "unknown when older than 3 s"]),
        ("eve|ry 100 ms", ["`every 100 ms`: the sender"]),
    ],
)
def test_hover_describes_names_in_a_scenario(desk: Workspace, around: str, said: list[str]) -> None:
    text = """import "dip.rts"
scenario "it" {
  flies  dip
  after look       link_silence(for = 2 s)
  when height > 3 m mute(message = HEARTBEAT)
  at 20 s          approve(role = operator)
  expect distance to pond >= 2 m
  expect reaction <= 200 ms
  expect fallback hover because state/violated
}
signal room : ratio = RADIO_STATUS.txbuf  every 100 ms  stale after 3 s
"""
    desk.put("/w/s.rts", text)
    found = hover(desk.view("/w/s.rts"), "/w/s.rts", place(desk, "/w/s.rts", around), dialect.load())
    assert found is not None
    assert [each for each in said if each not in found.text] == []


@pytest.mark.parametrize(
    ("around", "said"),
    [
        ("acc|epts MAV_CMD", ["by which a client of a gateway means"]),
        ("MAV_CMD_NAV_TAKE|OFF", ["MAVLink command `MAV_CMD_NAV_TAKEOFF`", "- `param7`: Altitude, in `m`"]),
        ("param|7 above", ["MAVLink command `MAV_CMD_NAV_TAKEOFF`, `param7`: Altitude, in `m`"]),
        ("with hi|gh = param7", ["parameter of `rise`", "range 3 m .. 60 m"]),
        ("SET_POSITION|_TARGET", ["MAVLink message `SET_POSITION_TARGET_GLOBAL_INT`: `time_boot_ms`"]),
        ("type_|mask", ["`uint16_t`, values of `POSITION_TARGET_TYPEMASK`"]),
        ("mode TAKE|OFF", ["flight mode `TAKEOFF` of px4: `custom_mode` 33816576"]),
        ("mode NO|NE", ["flight mode `NONE`"]),
    ],
)
def test_hover_describes_what_a_skill_accepts(desk: Workspace, around: str, said: list[str]) -> None:
    text = """skill rise(high: altitude in 3 m .. 60 m) {
  motion  climb to high
  accepts MAV_CMD_NAV_TAKEOFF with high = param7 above home
  accepts message SET_POSITION_TARGET_GLOBAL_INT where type_mask has 504 with high = alt in frame
  accepts mode TAKEOFF on px4 with high = here
  accepts mode NONE on px4 with high = here
}
"""
    desk.put("/w/s.rts", text)
    found = hover(desk.view("/w/s.rts"), "/w/s.rts", place(desk, "/w/s.rts", around), dialect.load())
    assert found is not None
    assert [each for each in said if each not in found.text] == []


@pytest.mark.parametrize(
    ("around", "places", "said"),
    [
        ("pictures by e|ye", ["camera ^eye", "by ^eye"], "camera `eye`"),
        ("distance aw|ay", ["^away: length", "distance ^away"], "parameter of `look_at`"),
    ],
)
def test_cameras_and_distances_have_a_declaration(desk: Workspace, around: str, places: list[str], said: str) -> None:
    text = """vehicle mapping_quad {
  identity "m-1"  home 47.39774 N, 8.54559 E within 50 m  speed at most 12 m/s  climb at most 3 m/s
  position error 3 m  energy 100 % = 18 min hover  reserve 15 %
  camera eye sensor 13.2 mm by 8.8 mm focal 8.8 mm pixels 5472 by 3648 every at least 700 ms exposure at most 1 ms
}
skill look_at(area: zone, up: altitude in 3 m .. 60 m, away: length in 5 m .. 9 m, way: one of face) {
  motion   cover area at up distance away pattern way
  pictures by eye every 10 m
}
"""
    desk.put("/w/s.rts", text)
    view, offset = desk.view("/w/s.rts"), place(desk, "/w/s.rts", around)
    found = hover(view, "/w/s.rts", offset, dialect.load())
    assert found is not None
    assert said in found.text
    target = at(view.occurrences("/w/s.rts"), offset)[0].target
    spans = sorted(each.span.start for each in view.occurrences("/w/s.rts") if each.target == target)
    assert spans == [text.index(each.replace("^", "")) + each.index("^") for each in places]


def test_hover_is_empty_without_a_name(desk: Workspace) -> None:
    text = desk.text(DIP) or ""
    assert hover(desk.view(DIP), DIP, text.index("\n\n") + 1, dialect.load()) is None
    assert hover(desk.view("/w/none.rts"), "/w/none.rts", 3, dialect.load()) is None


def test_every_name_of_the_library_has_a_target() -> None:
    """Each occurrence covers exactly its name and is declared, except for roles, phases and similar kinds."""
    desk = Workspace(lambda path: Path(path).read_bytes(), str(root()))
    view = desk.view(str(root() / "missions" / "standard.rts"))
    free = {
        "ROLE",
        "SOURCE",
        "PROPOSER",
        "CLASS",
        "RECORD",
        "TYPE",
        "MESSAGE",
        "FIELD",
        "DIALECT_ENUM",
        "COMMAND",
        "MODE",
        "WORD",
        "IMPORT",
    }
    seen = 0
    for file in view.units:
        for each in view.occurrences(file):
            seen += 1
            if each.target.kind.name != "IMPORT":
                assert view.slice(each.span) == each.target.name
            if each.target.kind.name not in free:
                assert definitions(view, file, each.span.start), each
    assert seen > 200
