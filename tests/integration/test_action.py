"""`action.yml`: its steps as a runner of GitHub executes them, on a project that is sound and on one that is not.

Installing is left to others (a wheel: `test_wheel.py`; an environment of its own: `test_pre_commit.py`): `python` only
notes what it was asked.
"""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import pytest
import yaml

from rtshcua.cli.init import project

ROOT = Path(__file__).resolve().parents[2]
ACTION = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
STEPS: list[dict[str, Any]] = ACTION["runs"]["steps"]


class Ended(NamedTuple):
    """What a run of the action did: the outcome of each step, what it printed, and the action's outputs."""

    outcomes: dict[str, str]
    printed: str
    outputs: dict[str, str]


Run = Callable[..., Ended]


def fill(text: str, known: dict[str, str]) -> str:
    """`${{ inputs.a }}` by its value; what is not known is an error, as a slip of the pen would be."""
    return re.sub(r"\$\{\{ ([\w.-]+) \}\}", lambda found: known[found[1]], text)


def wanted(condition: str, known: dict[str, str], failed: bool) -> bool:
    """The condition of a step: comparisons of text, joined by `&&`; without a function it asks for success."""
    inner = re.sub(r"^\$\{\{ (.*) \}\}$", r"\1", condition)
    held = failed is False or "cancelled()" in inner
    for part in inner.split(" && "):
        if part in ("!cancelled()", "success()"):
            continue
        name, operator, literal = part.split()
        held = held and (known[name] == literal.strip("'")) is (operator == "==")
    return held


@pytest.fixture
def run(tmp_path: Path) -> Run:
    (tmp_path / "bin").mkdir()
    python = tmp_path / "bin/python"
    noting = f'[ "$1" != -m ] && exec {sys.executable} "$@"\nprintf "%s\\n" "$@" >{tmp_path}/installed\n'
    python.write_text(f"#!/bin/sh\n{noting}", encoding="utf-8")
    python.chmod(0o755)
    path = f"{python.parent}:{Path(sys.executable).parent}:{os.environ['PATH']}"

    def run(workspace: Path, **given: str) -> Ended:
        known = {f"inputs.{name}": str(each.get("default", "")) for name, each in ACTION["inputs"].items()}
        known |= {f"inputs.{name.replace('_', '-')}": value for name, value in given.items()}
        known["github.action_path"] = str(ROOT)
        outcomes: dict[str, str] = {}
        printed = ""
        for step in STEPS:
            name, id = step["name"], step.get("id", "")
            if not wanted(step.get("if", "success()"), known, "failure" in outcomes.values()):
                outcomes[name] = "skipped"
            if "uses" in step or name in outcomes:
                continue
            (tmp_path / "script").write_text(fill(step["run"], known), encoding="utf-8")
            (tmp_path / "output").write_text("")
            done = subprocess.run(
                ["bash", "--noprofile", "--norc", "-e", "-o", "pipefail", tmp_path / "script"],
                cwd=workspace / fill(step.get("working-directory", "."), known),
                env=os.environ
                | {"PATH": path, "GITHUB_OUTPUT": str(tmp_path / "output"), "GITHUB_WORKSPACE": str(workspace)}
                | {key: fill(value, known) for key, value in step.get("env", {}).items()},
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                check=False,
            )
            printed += done.stdout
            known[f"steps.{id}.outcome"] = outcomes[name] = "success" if done.returncode == 0 else "failure"
            for line in (tmp_path / "output").read_text().splitlines():
                key, value = line.split("=", 1)
                known[f"steps.{id}.outputs.{key}"] = value
        known = {each["value"][4:-3]: "" for each in ACTION["outputs"].values()} | known
        return Ended(outcomes, printed, {key: fill(each["value"], known) for key, each in ACTION["outputs"].items()})

    return run


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    """A repository with what `rtshcua init` makes in a folder of it."""
    for name, data in project("riverside").items():
        file = tmp_path / "repository/drones" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(data)
    return tmp_path / "repository"


def test_a_sound_project_passes_and_leaves_its_reports(run: Run, workspace: Path, tmp_path: Path) -> None:
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


def test_what_is_wrong_is_annotated_and_each_part_runs_all_the_same(run: Run, workspace: Path) -> None:
    rules = workspace / "drones/policies/rules.rts"
    text = rules.read_text(encoding="utf-8").replace("altitude <= 25 m", "altitude<=15 m")
    rules.write_text(text, encoding="utf-8")
    ended = run(workspace, paths="drones", sarif="", junit="out.xml")
    assert ended.outcomes["Format"] == ended.outcomes["Lint"] == ended.outcomes["Test"] == "failure", ended.printed
    assert f"::error file={workspace}/drones/missions/first_look.rts,line=13," in ended.printed
    assert "title=E0703::drones/missions/first_look.rts:13:" in ended.printed
    assert ended.outputs == {"sarif": "", "junit": str(workspace / "out.xml")}


def test_what_an_input_holds_stays_text(run: Run, workspace: Path) -> None:
    hostile = "$(touch owned) `touch owned` ; touch owned #"
    ended = run(workspace, paths=hostile, fail_on=hostile, sarif=f"{hostile}.sarif", tests="false")
    assert ended.outcomes["Lint"] == "failure"
    assert ended.outcomes["Test"] == "skipped"
    assert not list(workspace.rglob("owned"))
