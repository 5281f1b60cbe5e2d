"""Folders: opened without following links below a root, made, and synced."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from errno import EINVAL
from pathlib import Path
from typing import Final

from rtshcua.adapters.store.faults import naming

PRIVATE_FOLDER: Final = 0o700
PUBLIC_FOLDER: Final = 0o755

_FOLDER: Final = os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC


@contextmanager
def opened_folder(folder: Path, root: Path | None = None, *, make: int | None = None) -> Iterator[int]:
    """A descriptor of a folder. Below `root` no link is followed, whoever puts one there and whenever, and, where a
    mode is given to `make` them with, folders that are missing are made, each synced.

    Without a root, links are followed. Raises OSError.
    """
    handle = os.open(root or folder, _FOLDER)
    try:
        for part in folder.relative_to(root).parts if root else ():
            if part == "..":
                raise OSError(EINVAL, "`..` leads out of a folder", str(folder))
            if make is not None:
                with suppress(FileExistsError):
                    os.mkdir(part, make, dir_fd=handle)
                    os.fsync(handle)
            below = os.open(part, _FOLDER | os.O_NOFOLLOW, dir_fd=handle)
            os.close(handle)
            handle = below
        yield handle
    finally:
        os.close(handle)


def make_folder(folder: Path, *, mode: int = PUBLIC_FOLDER, root: Path | None = None) -> None:
    """Makes a folder and those above it that are missing, each synced; one that is there stays as it is."""
    with naming(folder):
        above = root or next(each for each in (folder, *folder.parents) if each.exists())
        with opened_folder(folder, above, make=mode):
            pass


def sync_folder(folder: Path) -> None:
    """Makes the names in a folder survive a crash."""
    with opened_folder(folder) as handle:
        os.fsync(handle)
