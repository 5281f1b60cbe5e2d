"""Threat: CI checks a pull request with modules beside the sources, which Python might import in place of its own.

The owner of an action's tag must not be able to change what CI runs, and no job has a token that it does not need.
"""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from reference.github_runner import ROOT, runner
from rtshcua.front.cli.commands.init import project
from virtual.forked import Forked

OWN_WORKFLOW = ROOT / "examples/starter/.github/workflows/policy.yml"
FILES = [
    ROOT / "action.yml",
    OWN_WORKFLOW,
    ROOT / ".pre-commit-hooks.yaml",
    ROOT / "examples/starter/.pre-commit-config.yaml",
    ROOT / "docs/ci.md",
]
#: modules that Python imports early, which the working folder could shadow
TAKEN = ("json", "pip", "pathlib", "os", "sitecustomize", "usercustomize", "rtshcua", "typer", "encodings")


@pytest.fixture
def hostile(tmp_path: Path) -> Path:
    """A repository of a valid project, with modules that leave a mark when they run."""
    place = tmp_path / "repository"
    for name, data in project("riverside").items():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_bytes(data)
    for name in TAKEN:
        (place / f"{name}.py").write_text(f'open("{tmp_path}/owned", "a").write("{name} ")\n', encoding="utf-8")
    return place


@pytest.mark.slow
def test_the_action_imports_nothing_from_the_checkout(hostile: Path, tmp_path: Path) -> None:
    (hostile / "tests/flights.rts").unlink()  # tests/integration/test_action.py flies it
    ended = runner(tmp_path)(hostile)
    assert not (tmp_path / "owned").exists(), (tmp_path / "owned").read_text()
    assert {*ended.outcomes.values()} == {"success"}, ended.printed


@pytest.mark.slow
def test_a_text_of_the_checkout_gives_the_runner_no_commands(hostile: Path, tmp_path: Path, commands: Forked) -> None:
    (hostile / "tests/::warning::nobody said this.rts").write_text("test  x\n", encoding="utf-8")
    (hostile / "tests/flights.rts").unlink()
    ended = runner(tmp_path, commands)(hostile, sarif="")
    stopped = None
    for line in ended.printed.splitlines():
        if (match := re.match(r"::stop-commands::([0-9a-f]{32})$", line)) is not None:
            stopped = match[1]
        elif stopped is not None and line == f"::{stopped}::":
            stopped = None
        elif line.startswith("::"):
            assert stopped is not None or re.match(r"::(error|warning|notice) title=|::\w+ file=", line), line
    assert stopped is None
    assert ended.printed.count("::stop-commands::") == 2


def test_path_and_name_cannot_inject_options_or_outputs(hostile: Path, tmp_path: Path, commands: Forked) -> None:
    (hostile / "--fix.rts").write_text("zone  a = circle(47 N, 8 E, 10 m)\n", encoding="utf-8")
    ended = runner(tmp_path, commands)(
        hostile, paths="--fix.rts", format="false", sarif="a\nsecret=b.sarif", junit="c\nd=e.xml"
    )
    assert "nothing found in 1 file" in ended.printed
    assert "error" not in ended.printed
    assert ended.outputs == {"sarif": "", "junit": ""}


def test_missing_report_is_not_an_output(hostile: Path, tmp_path: Path, commands: Forked) -> None:
    (tmp_path / "mine.json").write_text('{"runs": [{"results": [{"suppressions": [1]}]}]}', encoding="utf-8")
    (hostile / "rtshcua.sarif").symlink_to(tmp_path / "mine.json")
    ended = runner(tmp_path, commands)(hostile, tests="false", format="false")
    assert ended.outputs == {"sarif": "", "junit": ""}
    assert '"suppressions": [1]' in (tmp_path / "mine.json").read_text(encoding="utf-8")


@pytest.mark.parametrize("file", FILES, ids=lambda each: each.name)
def test_python_is_isolated_and_actions_are_pinned(file: Path) -> None:
    text = file.read_text(encoding="utf-8")
    for started in re.findall(r"\bpython3?\s+-[^\n]*", text):
        assert re.match(r"python3? -I ", started), started
    for used in re.findall(r"uses: (\S+)", text):
        if not used.startswith("ORGANISATION/"):
            assert re.fullmatch(r"[\w./-]+@([0-9a-f]{40}|<[^>]*)", used), used


def workflows() -> list[Any]:
    blocks = re.findall(
        r"^```yaml\n(permissions:.*?)^```$", (ROOT / "docs/ci.md").read_text(), re.DOTALL | re.MULTILINE
    )
    assert blocks
    return [yaml.safe_load(OWN_WORKFLOW.read_text(encoding="utf-8")), *(yaml.safe_load(each) for each in blocks)]


@pytest.mark.parametrize("workflow", workflows())
def test_a_workflow_has_the_least_permissions_and_leaves_no_token_behind(workflow: Any) -> None:
    assert workflow["permissions"]["contents"] == "read"
    assert {*workflow["permissions"]} <= {"contents", "security-events"}
    jobs = workflow.get("jobs", {"only": workflow})
    for step in (step for job in jobs.values() for step in job["steps"]):
        if step.get("uses", "").startswith("actions/checkout@"):
            assert step["with"]["persist-credentials"] is False
