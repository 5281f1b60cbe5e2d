"""`--changed`: lint the files that changed in git, and the files that import them."""

import os
import subprocess
from pathlib import Path

import pytest

from reference.lint_project import HABITS, MISSION, POLICY, Lint, put
from rtshcua.diagnostics.exits import ExitCode


def git(*words: str) -> None:
    who = ["-c", "user.name=a", "-c", "user.email=a@b", "-c", "init.defaultBranch=main", "-c", "commit.gpgsign=false"]
    subprocess.run(["git", *who, *words], check=True, capture_output=True)


@pytest.fixture
def repository(here: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in [name for name in os.environ if name.startswith("GIT_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", os.devnull)
    git("init")
    git("add", ".")
    git("commit", "-m", "first")
    return here


def test_changed_files_and_their_importers_are_linted(repository: Path, lint: Lint) -> None:
    assert lint(".", "--changed") == (ExitCode.OK, [])
    put({"two.rts": f"{MISSION}\n"})
    assert lint(".", "--changed") == (ExitCode.DIAGNOSTICS, HABITS[1:])
    put({"two.rts": MISSION, "three.rts": MISSION})
    assert lint(".", "--changed")[1] == [("E1305", "policy.rts"), ("E1302", "three.rts")]
    Path("three.rts").unlink()
    put({"policy.rts": f"{POLICY}\n"})
    assert lint(".", "--changed") == (ExitCode.DIAGNOSTICS, HABITS)
    assert lint("one.rts", "--changed") == (ExitCode.DIAGNOSTICS, HABITS[:1])


def test_deleted_import_counts_as_a_change(repository: Path, lint: Lint) -> None:
    Path("policy.rts").unlink()
    assert lint("one.rts", "--changed") == (ExitCode.DIAGNOSTICS, [("E0108", "one.rts")])


def test_changes_since_the_merge_base_are_linted(repository: Path, lint: Lint) -> None:
    git("checkout", "-b", "mine")
    put({"two.rts": f"{MISSION}\n"})
    git("commit", "-am", "mine")
    git("checkout", "main")
    put({"one.rts": f"{MISSION}\n"})
    git("commit", "-am", "theirs")
    git("checkout", "mine")
    assert lint(".", "--changed") == (ExitCode.OK, [])
    assert lint(".", "--base", "main") == (ExitCode.DIAGNOSTICS, HABITS[1:])
    code, found = lint(".", "--base", "nowhere")
    assert (code, found) == (ExitCode.INPUT, [("changed", "git does not know `nowhere`")])
    assert lint(".", "--base", "--output=x")[0] != ExitCode.OK
    assert not Path("x").exists()


def test_changed_works_before_the_first_commit(here: Path, lint: Lint, monkeypatch: pytest.MonkeyPatch) -> None:
    git("init")
    assert lint(".", "--changed") == (ExitCode.DIAGNOSTICS, HABITS)


def test_changed_without_repository_or_git_is_refused(here: Path, lint: Lint, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(here.parent))
    code, found = lint(".", "--changed")
    assert (code, found[0][0]) == (ExitCode.INPUT, "changed")
    assert "not in a git repository" in found[0][1]
    monkeypatch.setenv("PATH", str(here))
    code, found = lint(".", "--changed")
    assert (code, found) == (ExitCode.INPUT, [("changed", "`git`, which knows the changes, is not installed")])


def test_changed_works_through_links_and_from_other_folders(
    repository: Path, lint: Lint, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    put({"real/policy.rts": POLICY, "real/one.rts": MISSION})
    Path("via").symlink_to("real")
    Path("two.rts").rename("moved.rts")
    Path("two.rts").symlink_to("moved.rts")
    git("add", ".")
    git("commit", "-m", "second")
    assert lint("via", "two.rts", "--changed") == (ExitCode.OK, [])
    put({"real/one.rts": f"{MISSION}\n", "moved.rts": f"{MISSION}\n"})
    assert lint("via", "--changed")[1] == [("E1302", "via/one.rts"), ("E1305", "via/policy.rts")]
    assert lint("two.rts", "--changed")[1] == [("E1302", "two.rts")]
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    (elsewhere / "link").symlink_to(repository)
    for place in (elsewhere, repository):
        monkeypatch.chdir(place)
        code, found = lint(str(elsewhere / "link" / "two.rts"), "--changed")
        assert (code, [each for each, _ in found]) == (ExitCode.DIAGNOSTICS, ["E1302"])


def test_changed_uses_the_repository_of_the_files(
    repository: Path, lint: Lint, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    put({"one.rts": f"{MISSION}\n"})
    other = tmp_path_factory.mktemp("other")
    monkeypatch.chdir(other)
    git("init")
    assert [each for each, _ in lint(str(repository / "one.rts"), "--changed")[1]] == ["E1302"]
    monkeypatch.setenv("GIT_DIR", str(other / ".git"))  # as in a git hook
    assert [each for each, _ in lint(str(repository / "one.rts"), "--changed")[1]] == ["E1302"]


def test_file_outside_of_a_repository_is_refused(
    repository: Path, lint: Lint, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    outside = tmp_path_factory.mktemp("outside")
    (outside / "policy.rts").write_text(POLICY)
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(outside.parent))
    code, found = lint("one.rts", str(outside / "policy.rts"), "--changed")
    assert (code, found[0][0]) == (ExitCode.INPUT, "changed")
    assert "not in a git repository" in found[0][1]
    Path("one.rts").unlink()
    Path("one.rts").symlink_to(outside / "policy.rts")  # a file outside of all repositories is linted
    git("add", ".")
    git("commit", "-m", "second")
    assert lint("one.rts", "--changed")[1] == [("E0108", "")]
    monkeypatch.setenv("RTSHCUA_IMPORTS", str(outside))
    assert lint("one.rts", "--changed")[1] == [("E1305", "one.rts")]


def test_changes_in_a_submodule_are_found(
    repository: Path, lint: Lint, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path_factory.mktemp("part"))
    put({"policy.rts": POLICY})
    git("init")
    git("add", ".")
    git("commit", "-m", "first")
    part = Path.cwd()
    monkeypatch.chdir(repository)
    git("-c", "protocol.file.allow=always", "submodule", "add", str(part), "part")
    put({"one.rts": MISSION.replace("policy.rts", "part/policy.rts")})
    git("add", ".")
    git("commit", "-m", "second")
    assert lint("one.rts", "--changed") == (ExitCode.OK, [])
    put({"part/policy.rts": f"{POLICY}\n"})
    git("config", "submodule.part.ignore", "all")
    expected = [("E1302", "one.rts")]
    assert lint("one.rts", "--changed") == (ExitCode.DIAGNOSTICS, expected)
    assert lint("one.rts", "--base", "HEAD") == (ExitCode.DIAGNOSTICS, expected)
    assert ("E1305", "part/policy.rts") in lint(".", "--changed")[1]
    assert lint("part", "--changed")[1] == [("E1305", "part/policy.rts")]
    monkeypatch.chdir("part")
    git("commit", "-am", "a new state")
    monkeypatch.chdir(repository)
    assert lint("one.rts", "--changed") == (ExitCode.DIAGNOSTICS, expected)
