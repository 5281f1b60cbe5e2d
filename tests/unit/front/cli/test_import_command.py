"""`rtshcua import`: what is printed and written, refusals, JSON and exit codes."""

import json
import sys
from pathlib import Path
from typing import Any

import pytest

from reference.qgc_plans import RETURN, TAKEOFF, at, circle, fence, plan, simple, write
from reference.zone_files import ed269, kml, mark, polygon
from reference.zone_files import write as zone_file
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app

GOOD = plan(TAKEOFF, at(16, 2, 1, 20), simple(206, 25), simple(206, 0), RETURN, polygons=[fence()])
UNKEPT = plan(TAKEOFF, at(17, 2, 1, 20), RETURN, polygons=[fence()])
ACROSS = plan(TAKEOFF, at(16, 10, 0, 20), RETURN, polygons=[fence()], circles=[circle(5, 0, 20)])


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(value: Any, *words: str) -> int:
    return app.main(["import", str(write(Path(), value)), *words])


def test_the_source_is_printed_and_the_losses_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(GOOD) == ExitCode.OK
    said = capsys.readouterr()
    assert said.out.startswith("// Imported from `site.plan`")
    assert "goto(target = 47.3979400 N" in said.out
    lines = said.err.splitlines()
    at_ = next(number for number, line in enumerate(lines) if line.startswith("lost: camera (2): no picture"))
    assert "/mission/items/2  DO_SET_CAM_TRIGG_DIST" in "\n".join(lines[at_ : at_ + 4])
    assert "/mission/items/3" in said.err


def test_a_written_source_is_checked_by_check(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(GOOD, "-o", "site.rts") == ExitCode.OK
    assert "wrote `site.rts`: 3 steps, 1 zone" in capsys.readouterr().out
    assert app.main(["check", "site.rts"]) == ExitCode.OK
    assert app.main(["fmt", "--check", "site.rts"]) == ExitCode.OK
    assert run(GOOD, "-o", "site.rts") == ExitCode.USAGE, "a source is never replaced"


def test_what_is_not_kept_is_an_error_until_it_is_left_out(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(UNKEPT, "-o", "site.rts") == ExitCode.DIAGNOSTICS
    said = capsys.readouterr()
    assert "error: NAV_LOITER_UNLIM at /mission/items/1: it waits without an end" in " ".join(said.err.split())
    assert "`--skip NAME`" in said.err
    assert not Path("site.rts").exists()
    assert run(UNKEPT, "-o", "site.rts", "--skip", "NAV_LOITER_UNLIM") == ExitCode.OK
    assert "left out: NAV_LOITER_UNLIM at /mission/items/1" in capsys.readouterr().err


def test_the_finding_of_the_checker_points_at_the_leg(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(ACROSS, "-o", "site.rts") == ExitCode.DIAGNOSTICS
    said = capsys.readouterr()
    assert Path("site.rts").exists(), "to be corrected there"
    assert "--> site.rts:" in said.err
    assert "no_fly" in said.err


def test_json_has_everything(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(GOOD, "--json") == ExitCode.OK
    found = json.loads(capsys.readouterr().out)
    assert (found["kind"], found["to"], found["steps"], found["zones"], found["file"]) == (
        "plan",
        "mission",
        3,
        1,
        None,
    )
    assert found["source"].startswith("// Imported")
    assert {each["name"] for each in found["losses"]} == {"camera", "planned-speed"}
    assert set(found["losses"][0]) == {"name", "place", "what", "consequence"}
    assert run(UNKEPT, "--json") == ExitCode.DIAGNOSTICS
    found = json.loads(capsys.readouterr().out)
    assert found["not_kept"][0]["name"] == "NAV_LOITER_UNLIM"
    assert (found["exit_code"], found["source"], found["file"]) == (1, "", None)
    assert run(GOOD, "--json", "-o", "a.rts") == ExitCode.OK
    found = json.loads(capsys.readouterr().out)
    assert (found["file"], found["source"]) == ("a.rts", None)


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["none.plan"], ExitCode.INPUT),
        (["site.plan", "--to", "zone"], ExitCode.USAGE),
        (["site.plan", "-o", "site.txt"], ExitCode.USAGE),
        (["site.plan", "--skip", "nothing"], ExitCode.USAGE),
        (["site.plan", "--policy", "none.rts"], ExitCode.DIAGNOSTICS),
        ([], ExitCode.USAGE),
    ],
)
def test_wrong_command_lines(words: list[str], code: ExitCode, capsys: pytest.CaptureFixture[str]) -> None:
    write(Path(), UNKEPT)
    assert app.main(["import", *words]) == code
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("error")


def test_zones_with_what_the_site_states(capsys: pytest.CaptureFixture[str]) -> None:
    zone_file(Path(), kml(mark(polygon(",120", "relativeToGround", extrude=True))), "site.kml")
    assert app.main(["import", "site.kml", "-o", "site.rts"]) == ExitCode.DIAGNOSTICS
    said = " ".join(capsys.readouterr().err.split())
    assert "error: Quarry at Placemark[1]: its height is above ground" in said
    assert "help: state the lowest and the highest ground of the site: `--terrain LOW..HIGH`" in said
    words = ["import", "site.kml", "-o", "site.rts", "--terrain", "400..460", "--as", "inside", "--json"]
    assert app.main(words) == ExitCode.OK
    found = json.loads(capsys.readouterr().out)
    assert (found["kind"], found["to"], found["zones"], found["rules"]) == (
        "kml",
        "zones",
        1,
        ["airspace inside quarry"],
    )
    assert "ceiling 520 m above sea" in Path("site.rts").read_text(encoding="utf-8")
    assert app.main(["check", "site.rts"]) == ExitCode.OK


def test_the_extra_is_named_if_it_is_not_installed(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "rtshcua.ground.exchange.geographical_zones", raising=False)
    monkeypatch.setitem(sys.modules, "uas_standards", None)
    monkeypatch.setitem(sys.modules, "implicitdict", None)
    zone_file(Path(), ed269(), "zones.json")
    assert app.main(["import", "zones.json"]) == ExitCode.INPUT
    assert "pip install '.[import]'" in capsys.readouterr().err
