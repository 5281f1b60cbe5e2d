"""`rtshcua check --map`: a mission is drawn whether or not it is refused, with the place where it fails."""

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main

MISSION = """import "lib:policies/bridge_inspection.rts"

mission past_the_school under bridge_inspection@7 on quad {{
  intent "<b>Past the school</b>."
  proposed by agent openclaw for role operator
  phase departure {{ takeoff(altitude = 20 m) }}
  phase inspection {{
    goto(47.39700 N, 8.54640 E, altitude = 20 m)
    goto({}, altitude = {})
  }}
  phase recovery {{ return_home() }}
}}
"""
GOOD = ("bridge_a.entry", "20 m")


@pytest.fixture
def at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path


def check(*arguments: str) -> int:
    return main(["check", *arguments])


def drawn(at: Path, target: str, altitude: str) -> tuple[int, str]:
    (at / "past.rts").write_text(MISSION.format(target, altitude))
    code = check("past.rts", "--map", "map.html")
    return code, (at / "map.html").read_text(encoding="utf-8")


def crosses(page: str) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in re.findall(r'class="failed-mark" d="M([\d.]+) ([\d.]+)m', page)]


def stops(page: str) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in re.findall(r'class="stop" cx="([\d.]+)" cy="([\d.]+)"', page)]


def test_map_marks_where_a_mission_is_refused(at: Path) -> None:
    code, page = drawn(at, "47.39760 N, 8.54900 E", "20 m")
    assert code == ExitCode.DIAGNOSTICS
    page_map, page_side = page.split('id="heights-1-title"')
    assert page_map.count('class="failed-leg"') == page_side.count('class="failed-leg"') == 1
    assert len(crosses(page_side)) == 1
    ((x, y),) = crosses(page_map)
    (from_x, from_y), (to_x, to_y) = stops(page)[1:3]
    part = (x - from_x) / (to_x - from_x)  # on the leg, before its middle, where the school begins
    assert 0.15 < part < 0.3
    assert abs(y - (from_y + part * (to_y - from_y))) < 1
    assert "past.rts:9: error E0508" in page
    assert "<b>Past" not in page
    assert ">refused</strong>" in page


def test_step_refused_for_its_arguments_has_no_cross(at: Path) -> None:
    code, page = drawn(at, "bridge_a.entry", "41 m")
    assert code == ExitCode.DIAGNOSTICS
    assert page.count('class="failed-leg"') == 2  # on the map and in the side view
    assert crosses(page) == []
    assert "error E0703" in page


def test_a_mission_without_errors_is_drawn_too(at: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, page = drawn(at, *GOOD)
    assert code == ExitCode.OK
    assert "1 mission drawn in map.html" in capsys.readouterr().out
    assert 'class="failed-leg"' not in page
    assert ">refused</strong>" not in page
    assert 'class="way"' in page


def test_findings_outside_steps_are_listed_below_the_map(at: Path) -> None:
    (at / "past.rts").write_text(MISSION.format(*GOOD).replace("goto(47", "no_skill(47"))
    assert check("past.rts", "--map", "map.html") == ExitCode.DIAGNOSTICS
    page = (at / "map.html").read_text(encoding="utf-8")
    assert "Missions that are drawn: 0" in page
    assert "What else was found" in page


def test_the_page_is_well_formed_and_the_same_every_time(at: Path) -> None:
    opened: list[str] = []

    class Nesting(HTMLParser):
        def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
            if tag not in ("meta", "link", "br", "hr"):
                opened.append(tag)

        def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
            pass

        def handle_endtag(self, tag: str) -> None:
            assert opened.pop() == tag

    _, page = drawn(at, "47.39760 N, 8.54900 E", "20 m")
    Nesting().feed(page)
    assert opened == []
    assert drawn(at, "47.39760 N, 8.54900 E", "20 m")[1] == page


@pytest.mark.parametrize("target", ["past.rts", "nowhere/map.html", "."])
def test_map_does_not_replace_other_files(at: Path, target: str, capsys: pytest.CaptureFixture[str]) -> None:
    (at / "past.rts").write_text(MISSION.format(*GOOD))
    assert check("past.rts", "--map", target) != ExitCode.OK
    assert (at / "past.rts").read_text() == MISSION.format(*GOOD)
    assert "error" in capsys.readouterr().err


def test_an_imported_source_is_not_replaced_either(at: Path) -> None:
    (at / "policy.rts").write_text('import "lib:policies/bridge_inspection.rts"\n')
    (at / "past.rts").write_text('import "policy.rts"\n' + MISSION.format(*GOOD))
    assert check("past.rts", "--map", "policy.rts") != ExitCode.OK
    assert (at / "policy.rts").read_text() == 'import "lib:policies/bridge_inspection.rts"\n'


def test_map_and_picture_are_two_files() -> None:
    assert check("past.rts", "--map", "one.svg", "--picture", "one.svg") != ExitCode.DIAGNOSTICS
    assert not Path("one.svg").exists()
