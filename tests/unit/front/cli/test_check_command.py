"""`rtshcua check`: selected files, findings and exit codes."""

import io
import json
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest

from reference.mapping import PROGRAM
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main
from rtshcua.front.cli.render.findings import Findings
from rtshcua.front.cli.render.progress import watched

AT = ["--at", "2026-01-31T08:00:00Z"]

POLICY = """import "lib:policies/site.rts"
import "lib:skills/takeoff.rts"
import "lib:skills/hover.rts"
import "lib:skills/return_home.rts"
import "lib:skills/emergency_land.rts"

policy meadow_flight version 2 {
  permit takeoff by role operator through agent when altitude <= 15 m
  permit hover, return_home, emergency_land by any
  airspace inside meadow
  contingency return_home, emergency_land
}
"""
MISSION = """import "policy.rts"

mission look under meadow_flight@2 on quad {
  proposed by agent openclaw for role operator
  phase departure  { takeoff(altitude = 10 m) }
  phase inspection { hover(5 s) }
  phase recovery   { return_home() }
}
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a policy, and two missions of one name under it."""
    monkeypatch.chdir(tmp_path)
    put({"policy.rts": POLICY, "a/one.rts": above(MISSION), "b/two.rts": above(MISSION)})
    return tmp_path


def above(text: str) -> str:
    return text.replace('"policy.rts"', '"../policy.rts"')


def put(files: dict[str, str]) -> None:
    for name, text in files.items():
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text(text, encoding="utf-8")


def answer(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, dict[str, Any]]:
    code = main(["check", *words, "--json"])
    said = capsys.readouterr()
    assert said.err == ""
    return code, json.loads(said.out)


def found(answered: dict[str, Any]) -> list[tuple[str, str]]:
    return [(each["code"], each["at"]["file"]) for each in answered["diagnostics"]]


def test_missions_of_one_name_in_unrelated_files_do_not_clash(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "."]) == ExitCode.OK
    said = capsys.readouterr()
    assert said.err == ""
    lines = said.out.splitlines()
    assert lines[0] == "no errors in 9 files"
    missions = ["look (a/one.rts)", "look (b/two.rts)"]
    told = [line for line in lines[1:] if not line.startswith("  ")]  # the costs of the steps are indented
    assert [line.split(":")[0] for line in told] == [*missions, "meadow_flight on quad"]
    assert lines[-1].endswith("`where fitted` left out, without link.quality, obstacle.distance, wind.speed")


def test_folder_selects_all_sources_in_order(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    put(
        {
            "a/.hidden/x.rts": "?",
            "a/.x.rts": "?",
            "a/notes.txt": "?",
            "a/deep/er.rts": MISSION.replace("policy.rts", "../../policy.rts"),
        }
    )
    code, answered = answer(capsys, "b", "a", "b/two.rts", "a/one.rts")
    assert code == ExitCode.OK
    assert [each["file"] for each in answered["missions"]] == ["b/two.rts", "a/deep/er.rts", "a/one.rts"]
    assert {each["mission"] for each in answered["missions"]} == {"look"}
    told = {"missions", "versions", "not_here", "left_out", "issued_now"}
    assert set(answered) == {"format", "version", "diagnostics", "exit", "exit_code", *told}


def test_default_path_is_the_current_folder(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answers = []
    for words in (["check"], ["check", "--deny-warnings"], ["check", "."]):
        assert main(words) == ExitCode.OK
        answers.append(capsys.readouterr().out)
    assert answers[0] == answers[1] == answers[2]


def test_repeated_check_gives_the_same_result(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    put({"policy.rts": POLICY.replace("<= 15 m", "<= 5 m")})
    assert answer(capsys, ".") == answer(capsys, ".")


def test_finding_in_a_shared_file_is_reported_once(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    put({"policy.rts": POLICY.replace("meadow\n", "meddow\n")})
    code, answered = answer(capsys, "a", "b")
    assert code == ExitCode.DIAGNOSTICS
    assert found(answered) == [("E0201", "policy.rts")]


def test_each_file_sees_only_its_imports(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    put({"alone.rts": MISSION.replace('import "policy.rts"\n', "")})
    code, answered = answer(capsys, "alone.rts", "policy.rts")
    assert (code, found(answered)[0]) == (ExitCode.DIAGNOSTICS, ("E0201", "alone.rts"))
    code, answered = answer(capsys, "alone.rts", "--with", "policy.rts")
    assert (code, found(answered)) == (ExitCode.OK, [])


def test_files_that_import_each_other_are_checked_once(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    put(
        {
            "x.rts": 'import "y.rts"\nzone a = circle(47 N, 8 E, 9 m)\nzone c = union(b)',
            "y.rts": 'import "x.rts"\nzone b = union(a)',
        }
    )
    code, answered = answer(capsys, "y.rts", "x.rts")
    assert (code, [each for each, _ in found(answered)]) == (ExitCode.OK, ["E0111"])


def test_unreadable_source_does_not_hide_other_findings(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    put({"b/two.rts": "zone ?"})
    code = main(["check", "a", "nowhere.rts", "b"])
    assert code == ExitCode.INPUT
    said = capsys.readouterr().err
    assert "cannot read `nowhere.rts`" in said
    assert "b/two.rts:1:6" in said
    assert main(["check", "a", "b"]) == ExitCode.DIAGNOSTICS


def test_habits_are_for_lint(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    put({"policy.rts": POLICY.replace("\npolicy", 'import "lib:skills/goto.rts"\npolicy')})
    code, answered = answer(capsys, ".")
    assert (code, found(answered)) == (ExitCode.OK, [])
    assert main(["check", ".", "--deny-warnings"]) == ExitCode.OK


def test_notes_do_not_count_as_warnings(capsys: pytest.CaptureFixture[str]) -> None:
    for code, denied in ((codes.UNDECIDED, False), (codes.NAMING, True), (codes.SYNTAX, True)):
        assert Findings(json=False, deny_warnings=True).report([Diagnostic(code, "something")], {}) == denied
    assert not Findings(json=False).report([Diagnostic(codes.NAMING, "something")], {})


def test_a_specification_takes_all_other_sources_as_its_policys(
    checkout: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    proposal = json.loads((checkout / "missions" / "proposal.json").read_text(encoding="utf-8"))
    text = (checkout / "policies" / "bridge_inspection.rts").read_text(encoding="utf-8")
    put({"proposal.json": json.dumps(proposal | {"imports": []}), "own/bridges.rts": text})
    code, answered = answer(capsys, "proposal.json", "own")
    assert (code, [each["file"] for each in answered["missions"]]) == (ExitCode.OK, ["proposal.json"])
    assert answer(capsys, "proposal.json", "--with", "own/bridges.rts")[0] == ExitCode.OK
    code, answered = answer(capsys, "own", "proposal.json")
    assert (code, answered["error"]["slug"]) == (ExitCode.USAGE, "usage")


def test_a_folder_without_a_source(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("empty").mkdir()
    code, answered = answer(capsys, "empty")
    assert (code, answered["error"]["slug"]) == (ExitCode.INPUT, "no-source")


@pytest.mark.parametrize(
    "words", [["check", "x.rts", "--bogus", "--json"], ["compile", "--json"],
              ["compile", "x.rts", "--at", "noon", "--json"]]
)  # fmt: skip
def test_a_wrong_command_line_is_answered_in_json_too(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == ExitCode.USAGE
    said = capsys.readouterr()
    assert said.err == ""
    answered = json.loads(said.out)
    assert (answered["exit"], answered["error"]["slug"], answered["diagnostics"]) == ("usage", "usage", [])


# ---------------------------------------------------------------------------------------------------- --since


@pytest.fixture
def old(here: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """The same folder with a bundle of one mission, and a copy of all sources as they were."""
    assert main(["keys", "init"]) == ExitCode.OK
    assert main(["compile", "a/one.rts", "-o", "old.bundle", *AT]) == ExitCode.OK
    for name in ("a", "b"):
        shutil.copytree(name, f".old/{name}")
    shutil.copy("policy.rts", ".old/policy.rts")
    capsys.readouterr()
    return here


@pytest.mark.parametrize("earlier", ["old.bundle", ".old/policy.rts", ".old"])
def test_a_policy_that_changes_needs_a_new_version(old: Path, earlier: str, capsys: pytest.CaptureFixture[str]) -> None:
    code, answered = answer(capsys, "a", "b", "--since", earlier)
    assert (code, answered["diagnostics"]) == (ExitCode.OK, [])
    (compared,) = answered["versions"]
    changes = compared.pop("changes")
    assert compared == {"policy": "meadow_flight", "version": 2, "earlier": 2}
    assert changes == []
    put({"policy.rts": "// said again\n" + POLICY})
    assert answer(capsys, "a", "b", "--since", earlier)[0] == ExitCode.OK
    changed = POLICY.replace("15 m", "16 m")
    put({"policy.rts": changed})
    code, answered = answer(capsys, "a", "b", "--since", earlier)
    assert (code, found(answered)) == (ExitCode.DIAGNOSTICS, [("E0716", "policy.rts")])
    (compared,) = answered["versions"]
    changes = compared.pop("changes")
    assert compared == {"policy": "meadow_flight", "version": 2, "earlier": 2}
    assert [each["direction"] for each in changes] == ["looser"]
    assert changes[0]["before"] != changes[0]["after"]
    (finding,) = answered["diagnostics"]
    assert changed[finding["at"]["start"] : finding["at"]["end"]] == "2"
    assert finding["fixes"][0]["replacement"] == "3"
    assert "`permit takeoff by role operator" in finding["help"]
    put({"policy.rts": changed.replace("version 2", "version 3")})
    (raised,) = answer(capsys, "policy.rts", "--since", earlier)[1]["versions"]
    assert [each["direction"] for each in raised.pop("changes")] == ["looser"]
    assert raised == {"policy": "meadow_flight", "version": 3, "earlier": 2}


def test_compared_versions_are_printed(old: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "a", "--since", "old.bundle"]) == ExitCode.OK
    assert (
        capsys.readouterr().out.splitlines()[-1]
        == "meadow_flight: version 2, and 2 in old.bundle; no change in meaning"
    )


@pytest.mark.parametrize("earlier", ["old.bundle", ".old"])
def test_gate_fails_if_nothing_was_compared(old: Path, earlier: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The policy was renamed, or the bundle is of another project: no version was compared."""
    put({"policy.rts": POLICY.replace("meadow_flight", "other_flight")})
    assert main(["check", "policy.rts", "--since", earlier]) == ExitCode.INPUT
    said = capsys.readouterr().err
    assert f"nothing in `{earlier}` is an earlier version of a policy here" in " ".join(said.split())
    assert "`meadow_flight`" in said
    code, answered = answer(capsys, "policy.rts", "--since", earlier)
    assert (code, answered["exit"], answered["error"]["slug"]) == (ExitCode.INPUT, "input", "since")


def test_unmatched_earlier_policy_is_printed(old: Path, capsys: pytest.CaptureFixture[str]) -> None:
    put({".old/second.rts": POLICY.replace("meadow_flight", "second_flight")})
    code, answered = answer(capsys, "policy.rts", "--since", ".old")
    assert (code, answered["not_here"]) == (ExitCode.OK, ["second_flight"])
    assert main(["check", "policy.rts", "--since", ".old"]) == ExitCode.OK
    assert "second_flight: only in .old; no policy here to compare with" in capsys.readouterr().out


def test_invalid_since_is_refused(old: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("empty").mkdir()
    Path("bad.bundle").write_bytes(b"\xd9\xd9\xf7nothing")
    put({"bad.rts": "zone ?"})
    for earlier in ("nowhere.bundle", "nowhere.rts", "empty", "bad.rts"):
        code, answered = answer(capsys, "a", "--since", earlier)
        assert (code, answered["exit"]) == (ExitCode.INPUT, "input"), earlier
    code, answered = answer(capsys, "a", "--since", "bad.bundle")
    assert code in (ExitCode.INPUT, ExitCode.UNTRUSTED)
    assert "bad.bundle" in answered["error"]["message"]


# ---------------------------------------------------------------------------------------------------- progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_progress_is_for_a_person_who_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    items = [(f"file {number}",) for number in range(5)]
    for stream, count, shown in ((Terminal(), 5, True), (Terminal(), 3, False), (io.StringIO(), 5, False)):
        monkeypatch.setattr(sys, "stderr", stream)
        assert list(watched(items[:count])) == items[:count]
        assert ("3/5 file 2" in stream.getvalue()) == shown
        assert stream.getvalue().endswith("\r\033[K") == shown


def test_a_specification_without_its_policy_says_how_to_name_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    proposal = json.loads((Path(__file__).parents[4] / "missions/proposal.json").read_text(encoding="utf-8"))
    monkeypatch.chdir(tmp_path)
    Path("alone.json").write_text(json.dumps(proposal | {"imports": []}), encoding="utf-8")
    assert main(["check", "alone.json"]) == ExitCode.DIAGNOSTICS
    assert "pass them with `--with FILE`" in capsys.readouterr().err
    Path("policy.rts").write_text('import "lib:policies/bridge_inspection.rts"\n', encoding="utf-8")
    assert main(["check", "alone.json", "--with", "policy.rts"]) == ExitCode.OK
    assert "names them" not in capsys.readouterr().err


DATED = """import "policy.rts"
import "lib:skills/goto.rts"

zone works = circle(47.39774 N, 8.54559 E, 100 m) {}
policy dated version 1 {{
  permit takeoff by role operator through agent
  permit hover, return_home, emergency_land by any
  airspace inside meadow outside works
  contingency return_home, emergency_land
}}
mission look under dated@1 on quad {{
  proposed by agent openclaw for role operator
  phase departure  {{ takeoff(altitude = 10 m) }}
  phase recovery   {{ return_home() }}
}}
"""


@pytest.mark.parametrize(
    ("active", "now", "then"),
    [
        ('active "2020-01-01T00:00Z" .. "2039-01-01T00:00Z"', True, True),
        ('active "2020-01-01T00:00Z" .. "2021-01-01T00:00Z"', False, False),
        ('active "2025-01-01T00:00Z" .. "2026-02-28T00:00Z"', False, True),
    ],
)
def test_dated_zone_is_checked_at_the_given_time(
    active: str, now: bool, then: bool, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    put({"dated.rts": DATED.format(active)})
    assert main(["check", "dated.rts"]) == ExitCode.OK, "no check fails because of another day"
    told = capsys.readouterr().out
    assert ("issued now, it would be refused: E0508" in told) is now
    assert ("`rtshcua check --at 2" in told) is now
    assert main(["check", "dated.rts", "--json"]) == ExitCode.OK
    said = json.loads(capsys.readouterr().out)["issued_now"]
    assert {each["code"] for each in said} == ({"E0508"} if now else set())
    assert main(["check", "dated.rts", *AT]) == (ExitCode.DIAGNOSTICS if then else ExitCode.OK)
    assert ("E0508" in capsys.readouterr().err) is then


def test_invalid_time_is_refused(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "policy.rts", "--at", "noon"]) == ExitCode.USAGE
    assert "`noon` is not a UTC time" in capsys.readouterr().err


def test_pictures_of_a_survey_are_printed_below_its_step(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("map.rts").write_text(PROGRAM, encoding="utf-8")
    assert main(["check", "map.rts"]) == ExitCode.OK
    lines = capsys.readouterr().out.splitlines()
    at = next(number for number, line in enumerate(lines) if line.startswith("  2 look: at most "))
    assert lines[at + 1].startswith("    mapper, grid: 13.707 mm per pixel, pictures of 75 m by 50 m, overlap 84 %")
    assert lines[at + 3].startswith("  3 return_home")
    code, told = answer(capsys, "map.rts")
    (one,) = told["missions"][0]["pictures"]
    assert (code, one["step_number"], one["camera"], one["pixel_um"], one["forward"]) == (0, 2, "mapper", 13_707, 8_400)
    code, told = answer(capsys, "a")
    assert (code, told["missions"][0]["pictures"]) == (0, [])
