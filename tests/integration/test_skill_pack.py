"""The example pack: built as a wheel, and used by a project outside of the tree, as docs/skill-packs.md says."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pytest

from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli import app
from virtual.examples import failures_of, flights_of

CHECKOUT = Path(__file__).resolve().parents[2]
PACK = CHECKOUT / "examples" / "skill_pack"
PAGE = (CHECKOUT / "docs" / "skill-packs.md").read_text(encoding="utf-8")
FLIGHTS = PACK / "tests" / "watch_place.rts"


def block(kind: str, has: str) -> str:
    """Return the block of the page that has a text."""
    (found,) = [text for text in re.findall(rf"(?s)```{kind}\n(.*?)```", PAGE) if has in text]
    return str(found)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of packages with the wheel of the pack in it."""
    place = tmp_path_factory.mktemp("pack")
    shutil.copytree(PACK, place / "source", ignore=shutil.ignore_patterns("__pycache__"))
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(place)]
    made = subprocess.run(build, cwd=place / "source", capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stdout + made.stderr
    (wheel,) = place.glob("*.whl")
    with ZipFile(wheel) as archive:
        archive.extractall(place / "site")
    return place / "site"


def run(project: Path, site: Path | None, *words: str) -> subprocess.CompletedProcess[str]:
    paths = [str(CHECKOUT), *([] if site is None else [str(site)])]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
    command = [sys.executable, "-m", "rtshcua", *words]
    return subprocess.run(command, cwd=project, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_pack_is_built_and_used_outside_of_the_tree(site: Path, tmp_path: Path) -> None:
    (tmp_path / "harbour.rts").write_text(block("rts", "mission watch_quay"), encoding="utf-8")
    (tmp_path / "harbour_test.rts").write_text(block("rts", "nominal"), encoding="utf-8")
    without = run(tmp_path, None, "check", "harbour.rts")
    assert without.returncode == ExitCode.DIAGNOSTICS
    assert "is in the pack `acme`, which is not installed" in without.stderr
    for words in (["check", "harbour.rts"], ["lint", "."], ["fmt", "--check", "."], ["test", "harbour_test.rts"]):
        done = run(tmp_path, site, *words)
        assert done.returncode == ExitCode.OK, (words, done.stdout, done.stderr)


def test_page_shows_the_files_of_the_pack() -> None:
    for kind, path in (
        ("toml", "pyproject.toml"),
        ("python", "acme_skills/__init__.py"),
        ("rts", "acme_skills/sources/skills/watch_place.rts"),
        ("rts", "acme_skills/sources/policies/watching.rts"),
    ):
        text = (PACK / path).read_text(encoding="utf-8")
        assert f"`{path}`:\n\n```{kind}\n{text}```" in PAGE, path


def test_decisions_of_the_pack_are_tested(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(PACK)
    assert app.main(["test", "tests/watch_place.rts", "-k", "["]) == ExitCode.OK, capsys.readouterr().out
    assert "12 cases" in capsys.readouterr().out


@pytest.mark.soak
@pytest.mark.parametrize(("name", "flavour"), flights_of(FLIGHTS))
def test_skill_of_the_pack_flies(name: str, flavour: str) -> None:
    assert failures_of(FLIGHTS, name, flavour) == []
