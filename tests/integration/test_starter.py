"""A project of `rtshcua init` in CI: docs/ci.md as written, and the commands of the project's workflow."""

import re
import shlex
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

from rtshcua.front.cli import app
from rtshcua.front.cli.commands.init import project

PAGE = (Path(__file__).resolve().parents[2] / "docs/ci.md").read_text(encoding="utf-8")


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A new project with a name as long as they may be, so that nothing rests on the length of it."""
    for name, data in project("a" * 40).items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(data)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def commands_of(workflow: dict[str, Any]) -> list[list[str]]:
    """What a workflow runs of ours, in order."""
    (job,) = workflow["jobs"].values()
    lines = "\n".join(step.get("run", "") for step in job["steps"]).splitlines()
    return [words[1:] for words in (shlex.split(line, comments=True) for line in lines) if words[:1] == ["rtshcua"]]


@pytest.mark.slow
def test_workflow_of_a_new_project_passes(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    commands = commands_of(yaml.safe_load((place / ".github/workflows/policy.yml").read_text(encoding="utf-8")))
    assert [words[0] for words in commands] == ["fmt", "lint", "test", "keys", "compile"]
    for words in commands:
        assert app.main(words) == 0, "\n".join([*words, *capsys.readouterr()])
    assert (place / "rtshcua-tests.xml").is_file()
    assert (place / "missions/first_look.bundle").is_file()


def test_hooks_of_a_new_project_pass(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (ours,) = yaml.safe_load((place / ".pre-commit-config.yaml").read_text(encoding="utf-8"))["repos"]
    sources = sorted(str(path.relative_to(place)) for path in place.rglob("*.rts"))
    for hook in ours["hooks"]:
        words = shlex.split(hook["entry"])[1:] + (sources if hook.get("pass_filenames", True) else [])
        assert app.main(words) == 0, "\n".join([*words, *capsys.readouterr()])
        assert all(re.search(hook["files"], source) for source in sources)


@pytest.mark.slow
def test_project_settings_apply(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    settings = place / "rtshcua.toml"
    text, changed = re.subn(r"(?m)^fail-under = \d+", "fail-under = 100", settings.read_text(encoding="utf-8"))
    assert changed == 1
    settings.write_text(text, encoding="utf-8")
    assert app.main(["test", "."]) == 13
    assert "below the required 100 %" in capsys.readouterr().out


@pytest.mark.slow
def test_changed_rule_fails_a_test(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rules = place / "policies/rules.rts"
    rules.write_text(rules.read_text("utf-8").replace("altitude <= 25 m", "altitude <= 26 m"), encoding="utf-8")
    assert app.main(["test", "."]) == 13
    assert "error[E1411]" in capsys.readouterr().err


@pytest.mark.slow
def test_page_runs_as_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (session,) = re.findall(r"^```console\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
    commands = [shlex.split(line) for line in re.findall(r"^\$ (.*)$", session, re.MULTILINE)]
    assert len(commands) == 5
    for words in commands:
        if words[0] == "cd":
            monkeypatch.chdir(words[1])
        else:
            assert app.main(words[1:]) == 0, "\n".join([*words, *capsys.readouterr()])


def test_page_names_every_action_input_and_hook() -> None:
    root = Path(__file__).resolve().parents[2]
    action = yaml.safe_load((root / "action.yml").read_text(encoding="utf-8"))
    hooks = yaml.safe_load((root / ".pre-commit-hooks.yaml").read_text(encoding="utf-8"))
    rows = re.findall(r"^\| `([\w-]+)` \| ", PAGE, re.MULTILINE)
    assert {*rows} == {*action["inputs"]} | {each["id"] for each in hooks}


@pytest.mark.parametrize(
    ("source", "installs"),
    [
        ("", False),
        ("rtshcua", False),
        ("rtshcua==0.1.0", False),
        ("rtshcua @ git+https://git.example.org/rtshcua@0123abc", True),
        ("./wheels/rtshcua-0.1.0-py3-none-any.whl", True),
    ],
)
def test_workflow_never_installs_the_bare_name(place: Path, source: str, installs: bool) -> None:
    """An attacker who registers the name at a package index would run code in the CI of its users."""
    workflow = yaml.safe_load((place / ".github/workflows/policy.yml").read_text(encoding="utf-8"))
    (job,) = workflow["jobs"].values()
    assert job["env"] == {"RTSHCUA": ""}
    (script,) = (step["run"] for step in job["steps"] if step.get("name") == "Install")
    (place / "bin").mkdir()
    (place / "bin/python").write_text('#!/bin/sh\nprintf "%s\\n" "$@" >installed\n')
    (place / "bin/python").chmod(0o755)
    environment = {"PATH": f"{place}/bin:/usr/bin:/bin", "RTSHCUA": source}
    done = subprocess.run(["bash", "-e", "-c", script], env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode == 0) == installs
    assert (place / "installed").exists() == installs
    assert ("::error::RTSHCUA" in done.stdout) != installs
    if installs:
        assert (place / "installed").read_text().splitlines()[-1] == source


def test_pages_never_install_the_bare_name_in_ci() -> None:
    assert not re.search(r"pip install [\"']?rtshcua", PAGE)
