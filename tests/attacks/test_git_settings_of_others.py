"""Threat: the git settings in a checkout name programs, and `lint --changed` runs git there."""

import os
import subprocess
from pathlib import Path

import pytest

from reference.lint_project import MISSION, POLICY, put
from rtshcua.adapters.store import git as asking
from rtshcua.adapters.store.git import NoChanges, changed_files
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.front.cli.app import main

WHO = ("-c", "user.name=a", "-c", "user.email=a@example.org")


def git(*words: str) -> None:
    subprocess.run(["git", *WHO, *words], check=True, capture_output=True)


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in [name for name in os.environ if name.startswith("GIT_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", os.devnull)
    place = tmp_path / "checkout"
    place.mkdir()
    monkeypatch.chdir(place)
    put({"policy.rts": POLICY, "one.rts": MISSION, "bin/program": "#!/bin/sh\ntouch ../owned\ncat\n"})
    Path("bin/program").chmod(0o755)
    git("init", "--initial-branch", "main")
    git("add", ".")
    git("commit", "-m", "first")
    put({"one.rts": MISSION.replace("Look", "Gaze")})
    return place


PROGRAM = "../checkout/bin/program"


@pytest.mark.slow
@pytest.mark.parametrize(
    "settings",
    [
        {"core.fsmonitor": PROGRAM},
        {"core.hooksPath": "bin"},
        {"diff.external": PROGRAM},
        {"diff.x.command": PROGRAM},
        {"diff.x.textconv": PROGRAM},
        {"filter.x.clean": PROGRAM, "filter.x.smudge": PROGRAM, "filter.x.required": "true"},
        {"filter.x.process": PROGRAM},
        {"filter.x.y.z.clean": PROGRAM},
        {"core.pager": PROGRAM, "pager.diff": PROGRAM},
        {"core.sshCommand": PROGRAM, "credential.helper": PROGRAM, "core.askPass": PROGRAM},
        {"remote.x.url": "ext::sh -c touch%20../owned", "remote.x.promisor": "true", "extensions.partialClone": "x"},
        {"alias.diff": f"!{PROGRAM}", "alias.rev-parse": f"!{PROGRAM}"},
    ],
    ids=lambda each: next(iter(each)),
)
def test_no_program_of_the_checkout_is_started(here: Path, settings: dict[str, str]) -> None:
    put({".gitattributes": "*.rts diff=x filter=x\npolicy.rts filter=x.y.z\n"})
    if "remote.x.url" in settings:
        git("config", "core.repositoryFormatVersion", "1")
    for name, value in settings.items():
        git("config", name, value)
    for name in ("post-index-change", "reference-transaction"):
        Path("bin", name).symlink_to("program")
    os.utime("policy.rts", (1, 1))  # so that git looks at its contents
    for base in (None, "main"):
        found = changed_files([Path()], base)
        assert str(here / "one.rts") in found.files
    assert main(["lint", "--changed", "."]) == ExitCode.DIAGNOSTICS
    assert not (here.parent / "owned").exists()


def test_objects_that_are_missing_are_not_fetched(here: Path) -> None:
    git("config", "core.repositoryFormatVersion", "1")
    git("config", "remote.x.url", "ext::sh -c touch%20../owned")
    git("config", "protocol.ext.allow", "always")
    git("config", "remote.x.promisor", "true")
    git("config", "extensions.partialClone", "x")
    with pytest.raises(NoChanges):
        changed_files([Path()], "1234567890123456789012345678901234567890")
    tree = subprocess.run(
        ["git", "rev-parse", "HEAD^{tree}"], capture_output=True, text=True, check=True
    ).stdout.strip()
    Path(".git/objects", tree[:2], tree[2:]).unlink()
    with pytest.raises(NoChanges):
        changed_files([Path()])
    assert not (here.parent / "owned").exists()


@pytest.mark.parametrize(
    "name",
    ["GIT_EXTERNAL_DIFF", "GIT_SSH_COMMAND", "GIT_EXEC_PATH", "GIT_PAGER", "GIT_ASKPASS", "GIT_DIR", "GIT_TRACE"],
)
def test_the_environment_names_no_program_and_no_other_repository(
    here: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(name, str(here / "bin/program"))
    assert str(here / "one.rts") in changed_files([Path()]).files
    assert not (here.parent / "owned").exists()


def test_repository_of_another_user_is_not_read(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GIT_TEST_ASSUME_DIFFERENT_OWNER", "1")
    assert changed_files([Path()]).files  # not even this of git's environment counts
    if os.geteuid() == 0:
        monkeypatch.delenv("SUDO_UID", raising=False)
        os.chown(here, 12345, 12345)
        os.chown(here / ".git", 12345, 12345)
        with pytest.raises(NoChanges, match="of another user, which git refuses to read") as caught:
            changed_files([Path()])
        assert "safe.directory" in str(caught.value.help)


@pytest.mark.parametrize("name", ["index", "HEAD"])
def test_a_pipe_in_a_repository_is_not_waited_for(here: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(asking, "PATIENCE", 0.5)
    (here / ".git" / name).unlink()
    os.mkfifo(here / ".git" / name)
    with pytest.raises(NoChanges, match=r"git was silent about .* for 0\.5 s"):
        changed_files([here], None)
