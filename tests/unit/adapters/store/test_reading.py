"""Paths under the control of others are opened as regular files or refused at once."""

import os
import socket
from pathlib import Path

import pytest

from rtshcua.adapters.store import reading
from rtshcua.adapters.store.reading import NotRegular, exposed, open_regular, read_regular


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A folder with a file, and a file outside of it."""
    (tmp_path / "root/sub").mkdir(parents=True)
    (tmp_path / "root/sub/a").write_bytes(b"inside")
    (tmp_path / "secret").write_bytes(b"outside")
    return tmp_path / "root"


def test_no_more_is_read_than_is_asked_for(root: Path) -> None:
    file = root / "sub/a"
    assert [read_regular(file, most) for most in (0, 5, 6, 100)] == [b"i", b"inside", b"inside", b"inside"]
    assert read_regular(str(file), 6, root) == b"inside"


def test_pipe_or_device_is_refused_without_waiting(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(root)
    os.mkfifo("pipe")
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind("socket")
        before = len(list(Path("/proc/self/fd").iterdir()))
        for name in ("pipe", "socket", "sub", os.devnull):
            with pytest.raises(NotRegular, match=f"not a regular file: '{name}'"):
                open_regular(name)
        for name in ("pipe", "socket", "sub"):
            with pytest.raises(NotRegular, match="not a regular file"):
                open_regular(root / name, root)
        assert len(list(Path("/proc/self/fd").iterdir())) == before


def test_links_are_followed_but_not_below_a_root(root: Path) -> None:
    (root / "link").symlink_to(root.parent / "secret")
    (root / "folder").symlink_to(root.parent)
    assert read_regular(root / "link", 9) == read_regular(root / "folder/secret", 9) == b"outside"
    with pytest.raises(NotRegular, match="symbolic links are not followed here"):
        read_regular(root / "link", 9, root)
    for path in (root / "folder/secret", root / "../secret"):
        with pytest.raises(OSError, match=f"{path}'$"):
            read_regular(path, 9, root)
    (root.parent / "here").symlink_to(root)  # the root itself may be reached through a link
    assert read_regular(root.parent / "here/sub/a", 9, root.parent / "here") == b"inside"


def test_missing_file_is_named_in_full(root: Path) -> None:
    for below in (None, root):
        with pytest.raises(FileNotFoundError) as missing:
            open_regular(root / "sub/b", below)
        assert missing.value.filename == str(root / "sub/b")


@pytest.mark.parametrize(("mode", "told"), [(0o600, None), (0o400, None), (0o640, "0640"), (0o602, "0602")])
def test_file_readable_by_others_is_reported(mode: int, told: str | None, root: Path) -> None:
    (root / "sub/a").chmod(mode)
    with open_regular(root / "sub/a") as file:
        assert exposed(file) == (told and f"its mode is {told}")


def test_file_of_another_user_is_exposed(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (root / "sub/a").chmod(0o600)
    own = os.geteuid()
    monkeypatch.setattr(reading, "ROOT", -1)
    with open_regular(root / "sub/a") as file:
        assert exposed(file) is None
        monkeypatch.setattr(os, "geteuid", lambda: own + 1)
        assert exposed(file) == f"it belongs to user {own}"
        monkeypatch.setattr(reading, "ROOT", own)
        assert exposed(file) is None, "root may read it anyway"
