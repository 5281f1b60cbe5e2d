"""Files are written atomically, and never through a link."""

import errno
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from rtshcua.adapters.store.reading import NotRegular
from rtshcua.adapters.store.writing import (
    PRIVATE_FILE,
    NotWritten,
    append,
    lock,
    make_folder,
    open_new,
    publish,
    replace,
    replacing,
    write_all,
    write_new,
    write_out,
)

WRITERS: list[Callable[..., None]] = [write_new, replace, append, write_out]


def names(folder: Path) -> list[str]:
    return sorted(each.name for each in folder.iterdir())


def full(*_: object, **__: object) -> int:
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_new_file_replaces_nothing(tmp_path: Path) -> None:
    write_new(tmp_path / "a", b"one")
    with pytest.raises(FileExistsError, match=r"/a'$"):
        write_new(tmp_path / "a", b"two")
    assert (tmp_path / "a").read_bytes() == b"one"


@pytest.mark.parametrize("error", [OSError(errno.ENOSPC, "No space left on device"), KeyboardInterrupt()])
@pytest.mark.parametrize("at", ["write", "fsync", "replace"])
@pytest.mark.parametrize("write", [write_new, replace])
def test_failed_write_leaves_nothing_behind(
    write: Callable[..., None], at: str, error: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(os, at, fails)
    with suppress(OSError, KeyboardInterrupt):
        write(tmp_path / "a", b"one")
    assert names(tmp_path) == (["a"] if (write, at) == (write_new, "replace") else [])


def test_a_file_is_replaced_in_one_step(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    replace(tmp_path / "a", b"one")
    replace(tmp_path / "a", b"two", mode=PRIVATE_FILE)
    assert (tmp_path / "a").read_bytes() == b"two"
    assert (tmp_path / "a").stat().st_mode & 0o777 == 0o600
    with replacing(tmp_path / "a") as handle:
        write_all(handle, b"three")
        assert (tmp_path / "a").read_bytes() == b"two"
    monkeypatch.setattr(os, "write", full)
    with pytest.raises(OSError, match="No space"):
        replace(tmp_path / "a", b"four")
    assert (tmp_path / "a").read_bytes() == b"three"
    assert names(tmp_path) == ["a"]


def test_replace_leaves_neighbouring_files_alone(tmp_path: Path) -> None:
    (tmp_path / "a.new").write_bytes(b"mine")
    replace(tmp_path / "a", b"one")
    assert (tmp_path / "a.new").read_bytes() == b"mine"


@pytest.mark.parametrize("synced", [True, False])
def test_durable_file_is_synced_with_its_name(synced: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found: list[Path] = []
    monkeypatch.setattr(os, "fsync", lambda handle: found.append(Path(f"/proc/self/fd/{handle}").readlink()))
    replace(tmp_path / "a", b"one", synced=synced)
    assert [each.parent if each != tmp_path else each for each in found] == [tmp_path] * 2 * synced


def test_no_link_is_written_through(tmp_path: Path) -> None:
    (tmp_path / "victim").write_bytes(b"mine")
    for name in "abc":
        (tmp_path / name).symlink_to("victim")
    replace(tmp_path / "a", b"one")
    with pytest.raises(FileExistsError):
        write_new(tmp_path / "b", b"one")
    for write in (append, lambda path, _: os.close(lock(path))):
        with pytest.raises(NotRegular, match="symbolic links are not followed here") as refused:
            write(tmp_path / "c", b"one")
        assert refused.value.filename == str(tmp_path / "c")
    assert not (tmp_path / "a").is_symlink()
    assert (tmp_path / "victim").read_bytes() == b"mine"


@pytest.mark.parametrize("write", [write_new, replace, append])
def test_below_a_root_no_folder_that_is_a_link_is_written_into(write: Callable[..., None], tmp_path: Path) -> None:
    (tmp_path / "root").mkdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "root/a").symlink_to(tmp_path / "elsewhere")
    for path in ("root/a/b", "root/../elsewhere/b"):
        with pytest.raises(OSError, match=f"{path}'$"):
            write(tmp_path / path, b"one", root=tmp_path / "root")
    with pytest.raises(OSError, match="Not a directory"):
        make_folder(tmp_path / "root/a/b", root=tmp_path / "root")
    assert names(tmp_path / "elsewhere") == []
    make_folder(tmp_path / "root/c/d", root=tmp_path / "root")
    write(tmp_path / "root/c/d/b", b"one", root=tmp_path / "root")
    assert (tmp_path / "root/c/d/b").read_bytes() == b"one"


def test_append_refuses_special_files(tmp_path: Path) -> None:
    append(tmp_path / "a", b"one")
    append(tmp_path / "a", b"two")
    assert (tmp_path / "a").read_bytes() == b"onetwo"
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="pipe"):  # the pipe has no reader
        append(tmp_path / "pipe", b"one")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    with pytest.raises(NotRegular):
        append(tmp_path / "pipe", b"one")
    os.close(reader)


def test_write_out_follows_links(tmp_path: Path) -> None:
    (tmp_path / "real").write_bytes(b"before")
    (tmp_path / "link").symlink_to("real")
    write_out(tmp_path / "link", b"one")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_bytes() == b"one"
    write_out(Path(os.devnull), b"one")
    assert Path(os.devnull).is_char_device()


def test_a_finished_file_gets_its_name(tmp_path: Path) -> None:
    (tmp_path / "fresh").write_bytes(b"one")
    (tmp_path / "place").write_bytes(b"before")
    publish(tmp_path / "fresh", tmp_path / "place")
    assert names(tmp_path) == ["place"]
    assert (tmp_path / "place").read_bytes() == b"one"


def test_folders_are_made_as_far_as_they_are_missing(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir(mode=0o755)
    make_folder(tmp_path / "a" / "b" / "c", mode=0o700)
    make_folder(tmp_path / "a" / "b" / "c", mode=0o755)
    assert [(tmp_path / name).stat().st_mode & 0o777 for name in ("a", "a/b", "a/b/c")] == [0o755, 0o700, 0o700]


def test_failed_folder_sync_leaves_no_open_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    open_ = len(list(Path("/proc/self/fd").iterdir()))
    with monkeypatch.context() as patched:
        patched.setattr(os, "fsync", full)
        with pytest.raises(OSError, match="No space"):
            open_new(tmp_path / "a")
    assert len(list(Path("/proc/self/fd").iterdir())) == open_


@pytest.mark.parametrize("write", WRITERS)
def test_an_error_of_writing_names_what_was_asked_for(
    write: Callable[..., None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = os.open

    def denied(path: Any, flags: int, *rest: Any, **more: Any) -> int:
        if flags & os.O_CREAT:
            raise PermissionError(errno.EACCES, "Permission denied", str(path))
        return opened(path, flags, *rest, **more)

    with monkeypatch.context() as patched:
        patched.setattr(os, "write", full)
        with pytest.raises(OSError, match="No space") as caught:
            write(tmp_path / "a", b"one")
        assert caught.value.filename == str(tmp_path / "a")
    with monkeypatch.context() as patched:
        patched.setattr(os, "open", denied)
        with pytest.raises(NotWritten) as denial:
            write(tmp_path / "a", b"one")
        assert (denial.value.errno, denial.value.filename) == (errno.EACCES, str(tmp_path / "a"))
    with pytest.raises(FileNotFoundError) as missing:
        write(tmp_path / "no" / "a", b"one")
    assert missing.value.filename == str(tmp_path / "no" / "a")
