"""`action.yml`: its steps, executed like on GitHub, on a valid and on an invalid project."""

import json
from pathlib import Path
from xml.etree import ElementTree

import pytest

from reference.github_runner import ROOT, Run, runner
from rtshcua.front.cli.commands.init import project
from virtual.forked import Forked


@pytest.fixture
def run(tmp_path: Path, commands: Forked) -> Run:
    return runner(tmp_path, commands)


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    """A repository with what `rtshcua init` makes in a folder of it."""
    for name, data in project("riverside").items():
        file = tmp_path / "repository/drones" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(data)
    return tmp_path / "repository"


@pytest.mark.slow
def test_valid_project_passes_and_writes_reports(run: Run, workspace: Path, tmp_path: Path) -> None:
    ended = run(workspace, working_directory="drones")
    assert {*ended.outcomes.values()} == {"success"}, ended.printed
    assert (tmp_path / "installed").read_text().splitlines()[-1] == str(ROOT)
    assert ended.outputs == {
        "sarif": str(workspace / "drones/rtshcua.sarif"),
        "junit": str(workspace / "drones/rtshcua-tests.xml"),
    }
    log = json.loads(Path(ended.outputs["sarif"]).read_text(encoding="utf-8"))
    assert [one["results"] for one in log["runs"]] == [[]]
    assert int(ElementTree.parse(ended.outputs["junit"]).getroot().get("tests", "0")) > 0


@pytest.mark.slow
def test_errors_are_annotated_and_every_step_runs(run: Run, workspace: Path) -> None:
    rules = workspace / "drones/policies/rules.rts"
    text = rules.read_text(encoding="utf-8").replace("altitude <= 25 m", "altitude<=15 m")
    rules.write_text(text, encoding="utf-8")
    ended = run(workspace, paths="drones", sarif="", junit="out.xml")
    assert ended.outcomes["Format"] == ended.outcomes["Lint"] == ended.outcomes["Test"] == "failure", ended.printed
    assert f"::error file={workspace}/drones/missions/first_look.rts,line=13," in ended.printed
    assert "title=E0703::drones/missions/first_look.rts:13:" in ended.printed
    assert ended.outputs == {"sarif": "", "junit": str(workspace / "out.xml")}


@pytest.mark.slow
def test_action_inputs_are_not_executed_by_the_shell(run: Run, workspace: Path) -> None:
    hostile = "$(touch owned) `touch owned` ; touch owned #"
    ended = run(workspace, paths=hostile, fail_on=hostile, sarif=f"{hostile}.sarif", tests="false")
    assert ended.outcomes["Lint"] == "failure"
    assert ended.outcomes["Test"] == "skipped"
    assert not list(workspace.rglob("owned"))
