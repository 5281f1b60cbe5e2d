"""A file is rewritten atomically and keeps its attributes."""

import errno
import os
import stat
from pathlib import Path

import pytest

from rtshcua.adapters.store.writing import Changed, NotWritten, rewrite


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "a.rts"
    path.write_bytes(b"old")
    return path


def names(folder: Path) -> list[str]:
    return sorted(each.name for each in folder.iterdir())


@pytest.mark.parametrize("mode", [0o644, 0o600, 0o664, 0o755, 0o200])
def test_permissions_stay(file: Path, mode: int) -> None:
    file.chmod(mode)
    rewrite(file, b"old", b"new")
    assert stat.S_IMODE(file.stat().st_mode) == mode
    file.chmod(0o644)
    assert file.read_bytes() == b"new"
    assert names(file.parent) == ["a.rts"]


def test_a_link_stays_a_link(file: Path, tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    link = tmp_path / "elsewhere" / "b.rts"
    link.symlink_to(Path("..") / "a.rts")
    rewrite(link, b"old", b"new")
    assert link.is_symlink()
    assert file.read_bytes() == b"new"
    assert names(link.parent) == ["b.rts"]


def test_neighbouring_file_is_left_alone(file: Path) -> None:
    file.with_name("a.rts.new").write_bytes(b"mine")
    rewrite(file, b"old", b"new")
    assert file.with_name("a.rts.new").read_bytes() == b"mine"


def test_read_only_is_respected(file: Path) -> None:
    file.chmod(0o444)
    with pytest.raises(NotWritten):
        rewrite(file, b"old", b"new")
    assert file.read_bytes() == b"old"


def test_rewrite_keeps_concurrent_change(file: Path) -> None:
    file.write_bytes(b"theirs")
    with pytest.raises(Changed):
        rewrite(file, b"old", b"new")
    assert file.read_bytes() == b"theirs"
    assert names(file.parent) == ["a.rts"]


@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "No space left on device"), KeyboardInterrupt()])
@pytest.mark.parametrize("at", ["write", "fsync", "replace"])
def test_failed_rewrite_keeps_the_old_file(
    file: Path, error: BaseException, at: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(os, at, fails)
    with pytest.raises(type(error)):
        rewrite(file, b"old", b"new")
    assert file.read_bytes() == b"old"
    assert names(file.parent) == ["a.rts"]
