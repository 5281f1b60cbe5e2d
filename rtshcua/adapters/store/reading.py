"""Open files that others may have placed there: only regular files, and without waiting for them."""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from errno import EINVAL, ELOOP, ENXIO
from io import BufferedReader
from pathlib import Path
from typing import BinaryIO, Final

#: without O_NONBLOCK opening a pipe without a writer would block; with O_NOCTTY no terminal becomes the controlling one
UNAWAITED: Final = os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC
_FOLDER: Final = os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC


#: the user who may read everything
ROOT = 0


class NotRegular(OSError):
    """Not a regular file: a pipe, a device, a socket or a folder; or a link where none is followed."""


def open_regular(path: str | Path, root: Path | None = None) -> BufferedReader:
    """Open a regular file, or a link to one, for reading. Below `root`, if given, no link is followed. Raises
    `NotRegular` for anything else, and OSError as the system does.
    """
    try:
        if root is None:
            handle = os.open(path, os.O_RDONLY | UNAWAITED)
        else:
            with unfollowed(path), opened_folder(Path(path).parent, root) as folder:
                handle = os.open(Path(path).name, os.O_RDONLY | os.O_NOFOLLOW | UNAWAITED, dir_fd=folder)
    except OSError as error:
        if error.errno == ENXIO:  # a socket
            raise NotRegular(ENXIO, "not a regular file", str(path)) from None
        error.filename = str(path)
        raise
    expect_regular(handle, path)
    return os.fdopen(handle, "rb")


@contextmanager
def unfollowed(path: str | Path) -> Iterator[None]:
    """Opening files in this block without following links raises `NotRegular` for a link."""
    try:
        yield
    except OSError as error:
        if error.errno == ELOOP:
            raise NotRegular(ELOOP, "symbolic links are not followed here", str(path)) from None
        raise


def read_regular(path: str | Path, most: int, root: Path | None = None) -> bytes:
    """The content of a regular file, at most one octet more than `most`: that many octets show that it is too large.
    Raises as `open_regular`.
    """
    with open_regular(path, root) as file:
        return file.read(most + 1)


def read_if_there(path: Path, most: int) -> bytes | None:
    """The result of `read_regular`; None without a file."""
    try:
        return read_regular(path, most)
    except FileNotFoundError:
        return None


def expect_regular(handle: int, path: str | Path) -> None:
    """Close a descriptor that is not of a regular file, and raise `NotRegular`."""
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise NotRegular(ENXIO, "not a regular file", str(path))


def exposed(file: BinaryIO) -> str | None:
    """Why other users may read, write or run an open file, in words: its mode or its owner; None where only this user
    (and root) may.
    """
    found = os.fstat(file.fileno())
    mode = stat.S_IMODE(found.st_mode)
    if mode & 0o077:
        return f"its mode is {mode:04o}"
    if found.st_uid not in (os.geteuid(), ROOT):
        return f"it belongs to user {found.st_uid}"
    return None


@contextmanager
def opened_folder(folder: Path, root: Path | None = None, *, make: int | None = None) -> Iterator[int]:
    """A descriptor of a folder. Below `root` no link is followed, whenever it was placed there, and with a mode for
    `make` missing folders are made and synced. Without a root, links are followed. Raises OSError.
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


def walk(folder: str | Path, *, every: bool = False) -> Iterator[tuple[str, list[str], list[str]]]:
    """Each folder from this one down, with the names of its folders and other entries, like `os.walk`: names removed
    from the first list, links and unreadable folders are skipped. It is not recursive, because a stranger's folders may
    be nested deeply. With `every`, raises OSError for an existing folder that cannot be read.
    """
    passed_over = FileNotFoundError if every else OSError  # one that was removed in the meantime
    waiting = [os.fspath(folder)]
    while waiting:
        place = waiting.pop()
        folders, files = list[str](), list[str]()
        with suppress(passed_over), os.scandir(place) as entries:
            for entry in entries:
                (folders if _is_folder(entry) else files).append(entry.name)
        yield place, folders, files
        below = [os.path.join(place, name) for name in folders]  # noqa: PTH118  of each folder of a run
        waiting += [each for each in reversed(below) if not os.path.islink(each)]  # noqa: PTH114


def _is_folder(entry: "os.DirEntry[str]") -> bool:
    with suppress(OSError):  # a link to itself
        return entry.is_dir()
    return False
