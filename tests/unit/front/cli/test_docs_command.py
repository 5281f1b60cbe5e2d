"""`rtshcua docs`: output, refusals, and the same digest as `compile`."""

import io
import json
import os
import re
import sys
import time
from pathlib import Path

import pytest

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main

CHECKOUT = Path(__file__).resolve().parents[4]
POLICY = CHECKOUT / "policies" / "training_field.rts"
MISSION = CHECKOUT / "missions" / "short.rts"
AT = ["--at", "2026-01-31T08:00:00Z"]
NO_POLICY = 'import "lib:skills/hover.rts"\n'
WRONG = 'import "lib:skills/hover.rts"\npolicy p version 1 { permit hoover by any }\n'


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


class Terminal(io.StringIO):
    """A standard output that is a terminal."""

    def isatty(self) -> bool:
        return True


def test_page_is_written_and_its_digest_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["docs", str(MISSION), "-o", "page.html", *AT]) == ExitCode.OK
    told = capsys.readouterr().out
    text = Path("page.html").read_text(encoding="utf-8")
    assert text.startswith("<!DOCTYPE html>")
    assert "written to page.html" in told
    digest = told.split("digest ")[1].split()[0]
    assert "".join(f"<span>{digest[at : at + 8]}</span> " for at in range(0, 64, 8)) in text


def test_digest_equals_that_of_compile(capsys: pytest.CaptureFixture[str], keys: None) -> None:
    del keys
    assert main(["docs", str(MISSION), "--json", *AT]) == ExitCode.OK
    (chapter,) = json.loads(capsys.readouterr().out)["handbook"]["chapters"]
    assert main(["compile", str(MISSION), "-o", "short.bundle", "--json", *AT]) == ExitCode.OK
    assert json.loads(capsys.readouterr().out)["bundle"]["policy_digest"] == chapter["digest"]
    assert [mission["name"] for mission in chapter["missions"]] == ["short"]


@pytest.fixture
def keys(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["keys", "init"]) == ExitCode.OK
    capsys.readouterr()


def test_the_same_time_gives_the_same_bytes_and_a_pipe_gets_the_page(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["docs", str(POLICY), *AT]) == ExitCode.OK
    page = capsys.readouterr().out
    assert main(["docs", str(POLICY), "-o", "page.html", *AT]) == ExitCode.OK
    assert Path("page.html").read_text(encoding="utf-8") == page
    assert Path.cwd().joinpath("page.html").stat().st_mode & 0o777 == 0o644


def test_at_a_terminal_the_page_goes_to_a_file(monkeypatch: pytest.MonkeyPatch) -> None:
    Path("own.rts").write_text('import "lib:policies/training_field.rts"\n', encoding="utf-8")
    monkeypatch.setattr(sys, "stdout", Terminal())
    assert main(["docs", "own.rts", *AT]) == ExitCode.OK
    assert Path("own.html").is_file()


def test_since_highlights_changes(capsys: pytest.CaptureFixture[str]) -> None:
    Path("new.rts").write_text(newer("<= 15 m\n", "<= 12 m\n"), encoding="utf-8")
    assert main(["docs", "new.rts", "--since", str(POLICY), "--json", *AT]) == ExitCode.OK
    (chapter,) = json.loads(capsys.readouterr().out)["handbook"]["chapters"]
    assert chapter["since"].endswith("training_field.rts")
    assert [rule["number"] for rule in chapter["rules"] if rule["changed"]] == [1]
    (change,) = chapter["changes"]
    assert "<= 15 m" in change["before"][0]
    assert "<= 12 m" in change["after"][0]


def test_current_folder_is_shown_by_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("old.rts").write_text(POLICY.read_text(encoding="utf-8"), encoding="utf-8")
    assert main(["docs", str(POLICY), "--since", ".", "--json", *AT]) == ExitCode.OK
    (chapter,) = json.loads(capsys.readouterr().out)["handbook"]["chapters"]
    assert chapter["since"] == tmp_path.name


def newer(old: str, new: str, *, raised: bool = True) -> str:
    """The shipped policy with changed text, and optionally a higher version."""
    text = POLICY.read_text(encoding="utf-8")
    assert old in text
    text = text.replace(old, new, 1)
    found = re.search(r"policy training_field version (\d+)", text)
    assert found is not None
    return text.replace(found[0], f"policy training_field version {int(found[1]) + 1}") if raised else text


@pytest.mark.parametrize("machine", [[], ["--json"]])
def test_since_refuses_like_check(machine: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    Path("new.rts").write_text(newer("<= 15 m\n", "<= 12 m\n", raised=False), encoding="utf-8")
    assert main(["check", "new.rts", "--since", str(POLICY)]) == ExitCode.DIAGNOSTICS
    assert "E0716" in capsys.readouterr().err
    assert main(["docs", "new.rts", "-o", "page.html", "--since", str(POLICY), *machine, *AT]) == ExitCode.DIAGNOSTICS
    said = capsys.readouterr()
    assert "E0716" in said.out + said.err
    assert not Path("page.html").exists()


def test_no_path_of_this_machine_is_in_the_page(tmp_path: Path) -> None:
    """Neither of an earlier file nor of a source in another folder."""
    elsewhere, here = tmp_path / "elsewhere", tmp_path / "here"
    elsewhere.mkdir()
    here.mkdir()
    (elsewhere / "new.rts").write_text(newer("<= 15 m\n", "<= 12 m\n"), encoding="utf-8")
    (elsewhere / "old.rts").write_text(POLICY.read_text(encoding="utf-8"), encoding="utf-8")
    os.chdir(here)  # the fixture puts it back
    old, new = str(elsewhere / "old.rts"), str(elsewhere / "new.rts")
    assert main(["docs", new, "-o", "page.html", "--since", old, *AT]) == ExitCode.OK
    text = Path("page.html").read_text(encoding="utf-8")
    assert str(tmp_path) not in text
    assert "old.rts" in text
    assert "../elsewhere/new.rts" in text


def test_rules_and_files_are_called_alike(capsys: pytest.CaptureFixture[str]) -> None:
    """Paths are relative to the working folder, whichever file was selected; the library has its own name."""
    for folder in ("rules", "tests"):
        Path(folder).mkdir()
    Path("rules/own.rts").write_text(POLICY.read_text(encoding="utf-8"), encoding="utf-8")
    Path("tests/root.rts").write_text('import "../rules/own.rts"\n', encoding="utf-8")
    assert main(["docs", "tests/root.rts", "--json", *AT]) == ExitCode.OK
    (chapter,) = json.loads(capsys.readouterr().out)["handbook"]["chapters"]
    files = [file["name"] for file in chapter["files"]]
    assert files[0] == "rules/own.rts"
    assert {rule["place"].rpartition(":")[0] for rule in chapter["rules"]} == {"rules/own.rts"}
    assert {skill["place"].rpartition(":")[0] for skill in chapter["skills"]} <= set(files)
    assert "lib:skills/goto.rts" in files


def test_the_date_has_no_parts_of_a_second(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(time, "time_ns", lambda: 1_769_846_400_987_654_321)
    assert main(["docs", str(POLICY), "--json"]) == ExitCode.OK
    assert json.loads(capsys.readouterr().out)["handbook"]["made_at"] == "2026-01-31 08:00 UTC"


def test_missing_earlier_version_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    other = str(CHECKOUT / "policies" / "bridge_inspection.rts")
    assert main(["docs", str(POLICY), "-o", "page.html", "--since", other, *AT]) == ExitCode.OK
    assert "earlier version" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (["wrong.rts"], ExitCode.DIAGNOSTICS, "hoover"),
        (["none.rts"], ExitCode.INPUT, "no policy"),
        (["missing.rts"], ExitCode.INPUT, "missing.rts"),
        (["binary.rts"], ExitCode.DIAGNOSTICS, "binary.rts"),
        (["spec.json"], ExitCode.USAGE, "specification"),
        (["none.rts", "--at", "yesterday"], ExitCode.USAGE, "yesterday"),
        (["none.rts", "-o", "none.rts"], ExitCode.USAGE, "one of the sources"),
        (["none.rts", "-o", "folder"], ExitCode.USAGE, "not a regular file"),
        (["none.rts", "-o", "nowhere/page.html"], ExitCode.INPUT, "nowhere"),
        (["none.rts", "--since", "missing.rts"], ExitCode.INPUT, "missing.rts"),
    ],
)
def test_invalid_arguments_are_refused(
    words: list[str], code: ExitCode, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("wrong.rts").write_text(WRONG, encoding="utf-8")
    Path("none.rts").write_text(NO_POLICY, encoding="utf-8")
    Path("binary.rts").write_bytes(b"\xff\xfe\x00")
    Path("spec.json").write_text("{}", encoding="utf-8")
    Path("folder").mkdir()
    before = sorted(path.name for path in Path.cwd().iterdir())
    assert main(["docs", *words, *([] if "--at" in words else AT)]) == code
    said = capsys.readouterr()
    assert told in said.err
    assert said.out == ""
    assert sorted(path.name for path in Path.cwd().iterdir()) == before


def test_failing_policy_test_prevents_output(capsys: pytest.CaptureFixture[str]) -> None:
    """Also if another selected file imports it; tests in files that are only imported do not count."""
    source = CHECKOUT / "policies" / "bridge_inspection_test.rts"
    text = source.read_text(encoding="utf-8")
    assert text.count("expect allow") > 1
    Path("own.rts").write_text(text.replace("expect allow", "expect deny", 1), encoding="utf-8")
    Path("above.rts").write_text('import "own.rts"\nimport "lib:policies/bridge_inspection.rts"\n', encoding="utf-8")
    for words in (["own.rts"], ["above.rts", "own.rts"], ["own.rts", "--json"]):
        assert main(["docs", *words, *([] if "--json" in words else ["-o", "page.html"]), *AT]) == ExitCode.TESTS
        said = capsys.readouterr()
        assert "E1411" in said.err + said.out
        assert "<html" not in said.out
        assert '"handbook"' not in said.out
        assert not Path("page.html").exists()
    assert main(["docs", "above.rts", "-o", "page.html", *AT]) == ExitCode.OK
    assert main(["docs", str(source), "-o", "page.html", *AT]) == ExitCode.OK
    assert "came out as they must" in Path("page.html").read_text(encoding="utf-8")


def test_page_shows_the_scenarios_of_the_named_files(capsys: pytest.CaptureFixture[str]) -> None:
    scenario = (
        'import "lib:missions/short.rts"\nscenario "{}" {{ flies short  at 9 s gps_loss()  expect ends aborted }}\n'
    )
    Path("flights.rts").write_text(scenario.format("no fix"))
    Path("all.rts").write_text('import "flights.rts"\n' + scenario.format("again no fix"))
    for words, names in ((["all.rts"], ["again no fix"]), (["."], ["again no fix", "no fix"])):
        assert main(["docs", *words, "--json", *AT]) == ExitCode.OK
        (chapter,) = json.loads(capsys.readouterr().out)["handbook"]["chapters"]
        assert sorted(each["name"] for each in chapter["scenarios"]) == names
        assert chapter["scenarios"][0]["told"][-1] == "it ends `aborted`"


def test_refusal_as_json_is_an_object(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["docs", "missing.rts", "--json"]) == ExitCode.INPUT
    assert json.loads(capsys.readouterr().out)["exit"] == "input"


def test_policies_with_equal_names_show_vehicle_and_file(capsys: pytest.CaptureFixture[str]) -> None:
    text = POLICY.read_text(encoding="utf-8")
    for folder, digits in (("east", "20"), ("west", "25")):
        Path(folder).mkdir()
        changed = text.replace("<= 15 m", f"<= {digits} m")
        assert changed != text
        Path(folder, "own.rts").write_text(changed, encoding="utf-8")
    assert main(["docs", "east", "west", "-o", "page.html", *AT]) == ExitCode.OK
    said, page = capsys.readouterr().out, Path("page.html").read_text(encoding="utf-8")
    for folder in ("east", "west"):
        assert f"for quad-07 ({folder}/own.rts): version" in said
        assert f'<dt>Declared in</dt><dd><span class="path">{folder}/own.rts</span>' in page
        assert f'for quad-07</a>, in <span class="path">{folder}/own.rts</span>' in page
