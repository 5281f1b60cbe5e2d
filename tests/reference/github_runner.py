"""A minimal GitHub runner for `action.yml`: it executes the steps of a composite action in a workspace.

Installing is left to others (a wheel: `test_wheel.py`; an environment of its own: `test_pre_commit.py`): pip only notes
what it was asked. What a workspace holds can get in between all the same: it is a Python that starts, isolated or not.
"""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from virtual.forked import Forked

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


#: `python` of the runner: asked for `pip install ...`, it starts as it was told to, loads pip, and notes the words
PYTHON = """#!/bin/sh
case "$*" in
*"-m pip install"*)
  printf "%s\\n" "$@" >{noted}
  flags=
  while [ "$1" != -m ]; do flags="$flags $1"; shift; done
  exec {python} $flags -m pip --version >/dev/null
  ;;
esac
exec {python} "$@"
"""


def runner(tmp_path: Path, commands: Forked | None = None) -> Run:
    """What executes the action's steps in a workspace, with inputs by name (`fail_on="error"`).

    With `commands`, `rtshcua` is loaded already: where it is not the start that is looked at.
    """
    (tmp_path / "bin").mkdir()
    if commands is not None:
        commands.program(tmp_path / "bin/rtshcua")
    python = tmp_path / "bin/python"
    python.write_text(PYTHON.format(python=sys.executable, noted=tmp_path / "installed"), encoding="utf-8")
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
