"""Files that are whole or not there."""

import errno
from collections.abc import Callable
from pathlib import Path

import pytest

from rtshcua.adapters.files import durable


def test_a_new_file_replaces_nothing(tmp_path: Path) -> None:
    durable.write_new(tmp_path / "a", b"one")
    with pytest.raises(FileExistsError):
        durable.write_new(tmp_path / "a", b"two")
    assert (tmp_path / "a").read_bytes() == b"one"


def test_a_file_that_could_not_be_written_is_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(handle: int, data: bytes) -> int:
        raise OSError("full")

    monkeypatch.setattr(durable.os, "write", full)
    with pytest.raises(OSError, match="full"):
        durable.write_new(tmp_path / "a", b"one")
    assert list(tmp_path.iterdir()) == []


def test_a_file_is_replaced_in_one_step(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    durable.replace(tmp_path / "a", b"one")
    durable.replace(tmp_path / "a", b"two", mode=durable.PRIVATE_FILE)
    assert (tmp_path / "a").read_bytes() == b"two"
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o600
    monkeypatch.setattr(durable, "write_all", lambda handle, data: (_ for _ in ()).throw(OSError("full")))
    with pytest.raises(OSError, match="full"):
        durable.replace(tmp_path / "a", b"three")
    assert (tmp_path / "a").read_bytes() == b"two"


def test_folders_are_made_as_far_as_they_are_missing(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir(mode=0o755)
    durable.make_folder(tmp_path / "a" / "b" / "c", mode=0o700)
    durable.make_folder(tmp_path / "a" / "b" / "c", mode=0o755)
    assert [(tmp_path / name).stat().st_mode & 0o777 for name in ("a", "a/b", "a/b/c")] == [0o755, 0o700, 0o700]


def test_nothing_stays_open_when_the_folder_cannot_be_synced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    closed: list[int] = []
    monkeypatch.setattr(durable, "sync_folder", lambda folder: (_ for _ in ()).throw(OSError("no sync")))
    real = durable.os.close
    monkeypatch.setattr(durable.os, "close", lambda handle: (closed.append(handle), real(handle))[1])
    with pytest.raises(OSError, match="no sync"):
        durable.open_new(tmp_path / "a", mode=0o644)
    assert len(closed) == 1


@pytest.mark.parametrize("write", [durable.write_new, durable.replace])
def test_an_error_of_writing_names_what_was_asked_for(
    write: Callable[..., None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(handle: int, data: bytes) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    def denied(path: Path, *_: int) -> int:
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    with monkeypatch.context() as patched:
        patched.setattr(durable.os, "write", full)
        with pytest.raises(OSError, match="No space") as caught:
            write(tmp_path / "a", b"one")
        assert caught.value.filename == str(tmp_path / "a")
    with monkeypatch.context() as patched:
        patched.setattr(durable.os, "open", denied)
        with pytest.raises(durable.NotWritten) as denial:
            write(tmp_path / "a", b"one")
        assert (denial.value.errno, denial.value.filename) == (errno.EACCES, str(tmp_path / "a"))
