"""A set of files is written completely or not at all, whatever exists and wherever the disk fails."""

import errno
import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from rtshcua.adapters.store.laying import Taken, appearing, lay

FILES = {"a.rts": b"new a", "sub/b.rts": b"new b", "sub/deep/.c": b"new c"}


def tree(folder: Path) -> dict[str, bytes | None]:
    """Everything below a folder: the contents of files, and None for folders."""
    return {str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


def test_files_are_laid_into_a_folder_that_is_not_there_yet(tmp_path: Path) -> None:
    assert lay(FILES, tmp_path / "x/y") is None
    assert {name: (tmp_path / "x/y" / name).read_bytes() for name in FILES} == FILES
    assert sorted(tree(tmp_path / "x/y")) == ["a.rts", "sub", "sub/b.rts", "sub/deep", "sub/deep/.c"]


def test_laying_files_keeps_existing_files(tmp_path: Path) -> None:
    (tmp_path / "mine").write_bytes(b"mine")
    assert lay(FILES, tmp_path) is None
    assert (tmp_path / "mine").read_bytes() == b"mine"


def test_a_name_that_is_taken_refuses_all(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub/b.rts").symlink_to("nowhere")
    before = sorted(os.walk(tmp_path))
    assert lay(FILES, tmp_path) == Taken((tmp_path / "sub/b.rts",), replaceable=True)
    assert sorted(os.walk(tmp_path)) == before


def test_files_of_the_same_names_are_replaced_when_asked(tmp_path: Path) -> None:
    (tmp_path / "a.rts").write_bytes(b"old")
    (tmp_path / "mine").write_bytes(b"mine")
    assert lay(FILES, tmp_path, replace=True) is None
    assert tree(tmp_path) == FILES | {"sub": None, "sub/deep": None, "mine": b"mine"}


@pytest.mark.parametrize("replace", [False, True])
@pytest.mark.parametrize("in_the_way", ["sub", "sub/deep/.c/x"])
def test_a_file_or_folder_in_the_way_is_never_replaced(tmp_path: Path, in_the_way: str, replace: bool) -> None:
    (tmp_path / in_the_way).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / in_the_way).write_bytes(b"mine")
    before = tree(tmp_path)
    taken = lay(FILES, tmp_path, replace=replace)
    assert taken is not None
    assert not taken.replaceable
    assert tree(tmp_path) == before


def failing_at(number: int, real: Callable[..., Any], left: list[int]) -> Callable[..., Any]:
    """A system call that fails once, on its `number`th call."""
    left.append(number)

    def call(*arguments: Any, **more: Any) -> Any:
        left[0] -= 1
        if left[0] == 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return real(*arguments, **more)

    return call


@pytest.mark.parametrize("name", ["write", "rename", "replace", "mkdir"])
def test_disk_failure_at_any_point_changes_nothing(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "made").mkdir()
    (tmp_path / "made/a.rts").write_bytes(b"old a")
    before = tree(tmp_path)
    for folder in ("made", "new/x"):
        for number in range(1, 50):
            left: list[int] = []
            with monkeypatch.context() as patch:
                patch.setattr(os, name, failing_at(number, getattr(os, name), left))
                with suppress(OSError):
                    assert lay(FILES, tmp_path / folder, replace=True) is None
            if left[0] > 0:
                assert number > 1 or (name, folder) == ("rename", "new/x")  # no file is moved aside there
                break
            assert tree(tmp_path) == before
        else:
            pytest.fail("it never ends")
        before = tree(tmp_path)


def test_folder_appears_complete_or_not_at_all(tmp_path: Path) -> None:
    with suppress(KeyboardInterrupt), appearing(tmp_path / "x") as folder:
        (folder / "a").write_bytes(b"a")
        raise KeyboardInterrupt
    assert tree(tmp_path) == {}
    with appearing(tmp_path / "x") as folder:
        (folder / "a").write_bytes(b"a")
        assert not (tmp_path / "x").exists()
    assert tree(tmp_path) == {"x": None, "x/a": b"a"}
    assert (tmp_path / "x").stat().st_mode & 0o777 == 0o700
