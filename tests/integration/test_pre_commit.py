"""`.pre-commit-hooks.yaml` with the real pre-commit, which clones this tree as it does any repository of hooks.

In `make test` the hooks run what is installed (`language: system`). In `make soak` pre-commit also makes their own
environment and installs the clone in it; only dependencies are not fetched again: pip is told to leave them, and Python
finds those of the tests.
"""

import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from rtshcua import library
from rtshcua.front.cli.commands.init import project

ROOT = Path(__file__).resolve().parents[2]
HOOKS = yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text(encoding="utf-8"))

pytestmark = pytest.mark.clients

Commit = Callable[..., subprocess.CompletedProcess[str]]


def git(place: Path, *words: str) -> str:
    given = ["-c", "user.name=test", "-c", "user.email=test@example.org", "-c", "init.defaultBranch=main"]
    done = subprocess.run(["git", *given, *words], cwd=place, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def commit_all(place: Path) -> str:
    git(place, "init", "--quiet")
    git(place, "add", "--all")
    git(place, "commit", "--quiet", "--no-verify", "--message", "all of it")
    return git(place, "rev-parse", "HEAD")


@pytest.fixture(params=["system", pytest.param("python", marks=pytest.mark.soak)])
def language(request: pytest.FixtureRequest) -> str:
    """How the hooks are run: ours say `python`."""
    language: str = request.param
    return language


@pytest.fixture
def repository(tmp_path: Path, language: str) -> tuple[Path, str]:
    """This tree, or what is read of it, as a repository of its own, and its revision."""
    place = tmp_path / "rtshcua"
    left_out = shutil.ignore_patterns("__pycache__", "*.pyc")
    for folder in ("rtshcua", *library.FOLDERS) if language == "python" else ():
        shutil.copytree(ROOT / folder, place / folder, ignore=left_out)
    place.mkdir(exist_ok=True)
    for name in ("pyproject.toml", "README.md", ".pre-commit-hooks.yaml"):
        shutil.copy(ROOT / name, place / name)
    return place, commit_all(place)


@pytest.fixture
def place(tmp_path: Path, repository: tuple[Path, str], language: str) -> Path:
    """A repository with what `rtshcua init` makes, and our hooks in the place of its own."""
    place = tmp_path / "riverside"
    for name, data in project("riverside").items():
        (place / name).parent.mkdir(parents=True, exist_ok=True)
        (place / name).write_bytes(data)
    where, revision = repository
    hooks = [{"id": each["id"], "language": language} for each in HOOKS]
    ours = {"repos": [{"repo": str(where), "rev": revision, "hooks": hooks}]}
    (place / ".pre-commit-config.yaml").write_text(yaml.safe_dump(ours), encoding="utf-8")
    commit_all(place)
    return place


@pytest.fixture
def run(place: Path, tmp_path: Path) -> Commit:
    """Runs hooks on every file."""
    left = {name: value for name, value in os.environ.items() if not name.startswith(("GIT_", "COVERAGE", "COV_"))}
    offline = {"PIP_NO_DEPS": "1", "PIP_NO_INDEX": "1", "PIP_NO_BUILD_ISOLATION": "0"}
    dependencies = os.pathsep.join(dict.fromkeys([sysconfig.get_path("purelib"), sysconfig.get_path("platlib")]))
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    told = left | offline | {"PYTHONPATH": dependencies, "PATH": path, "PRE_COMMIT_HOME": str(tmp_path / "home")}

    def run(*words: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "pre_commit", "run", "--all-files", *words]
        return subprocess.run(command, cwd=place, env=told, capture_output=True, text=True, check=False)

    return run


def verdicts(done: subprocess.CompletedProcess[str]) -> dict[str, str]:
    """What pre-commit says of each hook."""
    lines = [line.split("...") for line in done.stdout.splitlines() if line.startswith("rtshcua ") and "..." in line]
    return {line[0]: line[-1].strip(".") for line in lines}


def test_hooks_pass_a_valid_project_and_fail_an_invalid_one(place: Path, run: Commit) -> None:
    done = run()
    names = [each["name"] for each in HOOKS]
    assert verdicts(done) == dict.fromkeys(names, "Passed"), done.stdout + done.stderr

    rules = place / "policies/rules.rts"
    text = rules.read_text(encoding="utf-8").replace("altitude <= 25 m", "altitude<=15 m")
    rules.write_text(text, encoding="utf-8")
    done = run()
    assert done.returncode == 1
    assert verdicts(done) == dict.fromkeys(names, "Failed"), done.stdout + done.stderr
    assert "files were modified by this hook" in done.stdout
    assert "error[E0703]" in done.stdout
    assert "altitude <= 15 m" in rules.read_text(encoding="utf-8")
