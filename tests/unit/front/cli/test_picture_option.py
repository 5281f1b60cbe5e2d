"""`--picture` of `check` and `compile`: missions are drawn whether or not they are refused, and no file is lost."""

import json
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main

MISSION = """import "lib:policies/bridge_inspection.rts"

mission {} under bridge_inspection@7 on quad {{
  intent "<b>Past the school</b> & home ]]>."
  proposed by agent openclaw for role operator
  phase departure {{ takeoff(altitude = 20 m) }}
  phase inspection {{ goto({}, altitude = {}) }}
  phase recovery {{ return_home() }}
}}
"""
GOOD = MISSION.format("near", "bridge_a.entry", "20 m")
REFUSED = MISSION.format("past", "47.39720 N, 8.54960 E", "20 m")


@pytest.fixture
def at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Path:
    monkeypatch.chdir(tmp_path)
    assert main(["keys", "init"]) == ExitCode.OK
    capsys.readouterr()
    (tmp_path / "near.rts").write_text(GOOD)
    (tmp_path / "past.rts").write_text(REFUSED)
    return tmp_path


def titles(path: Path) -> list[str]:
    root = ET.fromstring(path.read_bytes())
    return ["".join(each.itertext()) for each in root.iter() if each.get("class") == "picture-title"]


@pytest.mark.parametrize("command", ["check", "compile"])
def test_mission_is_drawn(at: Path, command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, "near.rts", "--picture", "near.svg"]) == ExitCode.OK
    assert titles(at / "near.svg") == ["near: no errors"]
    assert "1 mission drawn in near.svg" in capsys.readouterr().out
    assert (at / "near.bundle").exists() == (command == "compile")


@pytest.mark.parametrize("command", ["check", "compile"])
def test_refused_mission_is_drawn_too(at: Path, command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, "past.rts", "--picture", "past.svg"]) == ExitCode.DIAGNOSTICS
    text = (at / "past.svg").read_text(encoding="utf-8")
    assert titles(at / "past.svg") == ["past: refused"]
    assert text.count('<polyline class="failed-leg"') == 2  # on the map and in the side view
    assert "Step 2: past.rts:7: error E0508" in text
    assert "1 mission drawn in past.svg" in capsys.readouterr().out
    assert not (at / "past.bundle").exists()


def test_policy_without_a_mission_says_what_to_do(at: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (at / "policy.rts").write_text('import "lib:policies/bridge_inspection.rts"\n')
    main(["check", "policy.rts", "--picture", "none.svg"])
    said = " ".join(capsys.readouterr().out.split())
    assert "0 missions drawn in none.svg: name a file with a mission, or draw the zones of a policy" in said


def test_missions_stand_one_below_the_other(at: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", ".", "--picture", "all.svg", "--map", "all.html"]) == ExitCode.DIAGNOSTICS
    assert titles(at / "all.svg") == ["near: no errors", "past: refused"]
    said = capsys.readouterr().out
    assert "2 missions drawn in all.html" in said
    assert "2 missions drawn in all.svg" in said


@pytest.mark.parametrize("command", ["check", "compile"])
def test_without_a_planned_mission_the_picture_has_the_findings(at: Path, command: str) -> None:
    (at / "past.rts").write_text(REFUSED.replace("goto(", "no_skill("))
    assert main([command, "past.rts", "--picture", "past.svg"]) == ExitCode.DIAGNOSTICS
    assert titles(at / "past.svg") == ["No mission is drawn"]
    assert "no_skill" in (at / "past.svg").read_text()


def test_errors_of_one_mission_do_not_count_for_another(at: Path) -> None:
    (at / "both.rts").write_text(REFUSED + GOOD.partition("\n")[2])
    assert main(["check", "both.rts", "--picture", "both.svg"]) == ExitCode.DIAGNOSTICS
    assert titles(at / "both.svg") == ["past: refused", "near: no errors"]


def test_only_the_compiled_mission_is_drawn_with_its_values(at: Path) -> None:
    many = REFUSED + GOOD.partition("\n")[2].replace("mission near", "mission near(up: altitude in 5 m .. 30 m)")
    (at / "past.rts").write_text(many.replace("bridge_a.entry, altitude = 20 m", "bridge_a.entry, altitude = up"))
    words = ["compile", "past.rts", "--mission", "near", "--set", "up=27 m", "--picture", "near.svg"]
    main(words)
    text = (at / "near.svg").read_text()
    assert [each.partition(":")[0] for each in titles(at / "near.svg")][:1] == ["near"]
    assert "27 m above home" in text
    assert titles(at / "near.svg")[1:] == ["What else was found"]  # the errors of the other one


@pytest.mark.parametrize("command", ["check", "compile"])
def test_picture_on_standard_output(at: Path, command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, "near.rts", "--picture", "-"]) == ExitCode.OK
    root = ET.fromstring(capsys.readouterr().out)
    assert root.tag.endswith("svg")
    assert not list(at.glob("*.svg"))


@pytest.mark.parametrize("command", ["check", "compile"])
@pytest.mark.parametrize("name", ["near.rts", "past.rts"])
def test_json_names_the_picture(at: Path, command: str, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    main([command, name, "--picture", "made.svg", "--json"])
    assert json.loads(capsys.readouterr().out)["picture"] == {"path": "made.svg", "missions": 1}


@pytest.mark.parametrize("command", ["check", "compile"])
@pytest.mark.parametrize(
    ("target", "code", "said"),
    [
        ("near.png", ExitCode.USAGE, "is not the name of an SVG file"),
        ("near", ExitCode.USAGE, "is not the name of an SVG file"),
        ("near.rts", ExitCode.USAGE, "is not the name of an SVG file"),
        ("nowhere/near.svg", ExitCode.INPUT, "there is no folder"),
        ("folder.svg", ExitCode.USAGE, "is not a regular file"),
        ("link.svg", ExitCode.USAGE, "is one of the sources"),
    ],
)
def test_unfit_target_is_refused(
    at: Path, command: str, target: str, code: ExitCode, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (at / "folder.svg").mkdir()
    (at / "link.svg").hardlink_to(at / "near.rts")
    assert main([command, "near.rts", "--picture", target]) == code
    assert said in " ".join(capsys.readouterr().err.split())
    assert (at / "near.rts").read_text() == GOOD
    assert not (at / "near.bundle").exists()


@pytest.mark.parametrize("command", ["check", "compile"])
def test_imported_source_is_not_replaced(at: Path, command: str) -> None:
    (at / "policy.rts").write_text('import "lib:policies/bridge_inspection.rts"\n')
    (at / "near.rts").write_text('import "policy.rts"\n' + GOOD)
    (at / "linked.svg").hardlink_to(at / "policy.rts")
    assert main([command, "near.rts", "--picture", "linked.svg"]) == ExitCode.USAGE
    assert (at / "policy.rts").read_text() == 'import "lib:policies/bridge_inspection.rts"\n'


@pytest.mark.parametrize("command", ["check", "compile"])
def test_standard_output_has_one_thing(at: Path, command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, "near.rts", "--picture", "-", "--json"]) == ExitCode.USAGE
    assert json.loads(capsys.readouterr().out)["error"]["slug"] == "usage"


def test_bundle_and_picture_are_two_files(at: Path) -> None:
    assert main(["compile", "near.rts", "-o", "near.svg", "--picture", "./near.svg"]) == ExitCode.USAGE
    assert not (at / "near.svg").exists()
