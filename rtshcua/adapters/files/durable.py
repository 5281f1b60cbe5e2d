"""Writing so that a crash leaves either the old state or the new one, never half of one."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PRIVATE_FILE, PRIVATE_FOLDER = 0o600, 0o700
PUBLIC_FILE, PUBLIC_FOLDER = 0o644, 0o755

_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)

#: syncs a file's bytes, and of its metadata only what reading them back needs
sync_data = getattr(os, "fdatasync", os.fsync)


class NotWritten(PermissionError):
    """A file that may not be written where it was asked for."""


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """An error of writing names the file that was asked for, whatever the system was doing."""
    try:
        yield
    except FileExistsError:
        raise
    except PermissionError as error:
        raise NotWritten(error.errno, error.strerror, str(path)) from None
    except OSError as error:
        if error.errno is not None:
            error.filename = str(path)
        raise


def sync_folder(folder: Path) -> None:
    """Makes the names in `folder` survive a crash; where folders cannot be opened (Windows) the system sees to it."""
    if os.name == "nt":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def open_new(path: Path, *, mode: int, append: bool = False) -> int:
    """A descriptor of a file that did not exist before; its name is synced. Raises FileExistsError."""
    handle = os.open(path, _NEW | (os.O_APPEND if append else 0), mode)
    try:
        sync_folder(path.parent)
    except OSError:
        os.close(handle)
        raise
    return handle


def write_all(handle: int, data: bytes) -> None:
    """Writes every byte, however often the system takes only some of them."""
    view = memoryview(data)
    while view:
        view = view[os.write(handle, view) :]


def write_new(path: Path, data: bytes, *, mode: int = PUBLIC_FILE) -> None:
    """Creates a file with its content, synced. Raises FileExistsError; leaves nothing behind when it fails."""
    with naming(path):
        handle = open_new(path, mode=mode)
        try:
            write_all(handle, data)
            os.fsync(handle)
        except OSError:
            os.close(handle)
            path.unlink()
            raise
        os.close(handle)


def replace(path: Path, data: bytes, *, mode: int = PUBLIC_FILE) -> None:
    """Puts a file with this content in place of whatever was there, in one step. One writer at a time."""
    fresh = path.with_name(path.name + ".new")
    with naming(path):
        fresh.unlink(missing_ok=True)
        write_new(fresh, data, mode=mode)
        fresh.replace(path)
        sync_folder(path.parent)


def make_folder(path: Path, *, mode: int = PUBLIC_FOLDER) -> None:
    """Makes a folder and those above it that are missing, each synced; one that is there stays as it is."""
    missing = [folder for folder in (path, *path.parents) if not folder.exists()]
    with naming(path):
        for folder in reversed(missing):
            folder.mkdir(mode=mode, exist_ok=True)
            sync_folder(folder.parent)
