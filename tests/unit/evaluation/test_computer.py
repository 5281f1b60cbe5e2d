"""The computer's description has what the report prints."""

import subprocess
from pathlib import Path

import pytest

from rtshcua.adapters.store.git import checkout_commit
from rtshcua.evaluation import computer
from rtshcua.evaluation.computer import this_computer


def test_this_computer_has_a_processor_and_versions() -> None:
    found = this_computer()
    assert found.cores >= 1
    assert all((found.processor, found.system, found.python, found.program))
    assert {"msgspec", "pymavlink"} <= set(found.versions)
    assert found.memory is None or found.memory > 1 << 28


def test_a_system_that_tells_nothing_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(*_: object) -> None:
        raise FileNotFoundError

    monkeypatch.setattr(computer, "open_regular", missing)
    monkeypatch.setattr(computer.platform, "freedesktop_os_release", missing)
    monkeypatch.setattr(computer, "LIBRARIES", ("no such library",))
    found = this_computer()
    assert found.versions == {}
    assert found.system.startswith(f"{computer.platform.system()} ")


@pytest.mark.slow
def test_commit_is_that_of_a_checkout_s_top(tmp_path: Path) -> None:
    def git(*words: str) -> str:
        identity = ("-c", "user.name=a", "-c", "user.email=a@b")
        done = subprocess.run(["git", *identity, *words], cwd=tmp_path, capture_output=True, check=True, text=True)
        return done.stdout.strip()

    assert checkout_commit(tmp_path) is None
    git("init", "-q")
    (tmp_path / "inner").mkdir()
    (tmp_path / "file").write_text("a")
    git("add", ".")
    git("commit", "-qm", "a")
    commit = git("rev-parse", "HEAD")
    assert checkout_commit(tmp_path) == commit
    assert checkout_commit(tmp_path / "inner") is None
    (tmp_path / "file").write_text("b")
    assert checkout_commit(tmp_path) == f"{commit}-dirty"
