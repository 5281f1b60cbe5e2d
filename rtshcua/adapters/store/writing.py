"""Write files so that a crash, Ctrl-C or a full disk leaves either the old file or the new one, and no other file.
Nothing is written through a link: a link in place of the file is replaced by the file.
"""

import errno
import fcntl
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

from rtshcua.adapters.store.checkout import expect_inside
from rtshcua.adapters.store.reading import (
    UNAWAITED,
    NotRegular,
    expect_regular,
    open_regular,
    opened_folder,
    read_regular,
    unfollowed,
)

#: modes of new files; the umask removes more, and without a umask no other user may write all the same
PRIVATE_FILE: Final = 0o600
PUBLIC_FILE: Final = 0o644
PRIVATE_FOLDER: Final = 0o700
PUBLIC_FOLDER: Final = 0o755
#: the prefix of unfinished files; a power failure may leave one
UNFINISHED: Final = ".rtshcua-"

_NEW: Final = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
_MORE: Final = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_NOFOLLOW | UNAWAITED

#: syncs a file's bytes, and only the metadata that reading them needs
sync_data = getattr(os, "fdatasync", os.fsync)


class NotWritten(PermissionError):
    """A file that may not be written in this place."""


class Changed(OSError):
    """The file was changed by another program in the meantime, so it is left alone."""


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Make an error of writing name the requested file, whatever system call failed."""
    try:
        yield
    except PermissionError as error:
        raise NotWritten(error.errno, error.strerror, str(path)) from None
    except OSError as error:
        if error.errno is not None:
            error.filename = str(path)
        raise


def write_all(handle: int, data: bytes) -> None:
    """Write every byte, in as many calls as the system needs."""
    view = memoryview(data)
    while view:
        view = view[os.write(handle, view) :]


@contextmanager
def replacing(path: Path, *, mode: int = PUBLIC_FILE, synced: bool = True, root: Path | None = None) -> Iterator[int]:
    """A descriptor of a new file that atomically replaces `path` when the block ends; with `synced` it is on the disk
    then. If the block raises, nothing changes. The `mode` is subject to the umask. Below `root`, if given, no link is
    followed. Raises OSError.
    """
    fresh = f"{UNFINISHED}{os.urandom(8).hex()}.new"
    with naming(path), opened_folder(path.parent, root) as folder:
        try:
            handle = os.open(fresh, _NEW, mode, dir_fd=folder)
            try:
                yield handle
                if synced:
                    os.fsync(handle)
            finally:
                os.close(handle)
            os.replace(fresh, path.name, src_dir_fd=folder, dst_dir_fd=folder)
        except BaseException:
            with suppress(OSError):
                os.unlink(fresh, dir_fd=folder)
            raise
        if synced:
            os.fsync(folder)


def replace(path: Path, data: bytes, *, mode: int = PUBLIC_FILE, synced: bool = True, root: Path | None = None) -> None:
    """Replace a file by this content: see `replacing`."""
    with replacing(path, mode=mode, synced=synced, root=root) as handle:
        write_all(handle, data)


def rewrite(path: Path, before: bytes, data: bytes) -> None:
    """Replace the content `before` by `data`. A symbolic link stays one, a hard link is separated from the others.
    Permissions stay, and owner and group if possible. Raises NotWritten where nobody may write to the file or its
    folder, or links lead out of its checkout, Changed where it no longer holds `before`, and OSError for other errors.
    """
    with naming(path):
        real, root = expect_inside(path)
        with open_regular(real, root) as file:
            known = os.fstat(file.fileno())
        if not known.st_mode & (stat.S_IWUSR | stat.S_IWGRP | stat.S_IWOTH) or not os.access(real, os.W_OK):
            raise PermissionError(errno.EACCES, "the file is read-only")
        with replacing(real, mode=PRIVATE_FILE, root=root) as handle:
            write_all(handle, data)
            with suppress(OSError):  # changing the owner is not permitted
                os.fchown(handle, known.st_uid, known.st_gid)
            os.fchmod(handle, stat.S_IMODE(known.st_mode))  # afterwards, because changing the owner clears set-id bits
            if read_regular(real, len(before), root) != before:
                raise Changed(errno.EBUSY, "it was changed in the meantime")


def write_out(path: Path, data: bytes, *, mode: int = PUBLIC_FILE) -> None:
    """Write to a file that the user named, atomically and through a link, unless it leads out of the checkout. Other
    kinds of files are written to: `/dev/stdout`, even where that leads to a file. A pipe without a reader is not waited
    for. Raises NotWritten, and OSError.
    """
    with naming(path):
        real, root = expect_inside(path)
        if path.exists() and (not path.is_file() or path.is_relative_to("/dev")):
            try:
                handle = os.open(path, os.O_WRONLY | os.O_TRUNC | UNAWAITED)
            except OSError as error:
                if error.errno != errno.ENXIO:
                    raise
                raise PermissionError(errno.EACCES, "no process reads this pipe") from None
            try:
                os.set_blocking(handle, True)
                write_all(handle, data)
            finally:
                os.close(handle)
        else:
            replace(real, data, mode=mode, root=root)


def replace_inside(path: Path, data: bytes) -> None:
    """Replace whatever is there, also a link, by a file, in a folder to which no link leads out of the user's checkout.
    Raises NotWritten, and OSError.
    """
    with naming(path):
        folder, root = expect_inside(path.parent)
        replace(folder / path.name, data, root=root)


def publish(fresh: Path, place: Path, root: Path | None = None) -> None:
    """Rename a finished file to its final name, synced, replacing whatever is there. Below `root`, if given, no link is
    followed. Raises OSError.
    """
    with naming(place), opened_folder(fresh.parent, root) as here, opened_folder(place.parent, root) as there:
        with open_regular(fresh, root) as file:
            os.fsync(file.fileno())
        os.replace(fresh.name, place.name, src_dir_fd=here, dst_dir_fd=there)
        os.fsync(there)


def open_new(path: Path, *, mode: int = PUBLIC_FILE) -> int:
    """Create a file for appending, its name synced, and return its descriptor. Raises FileExistsError and OSError."""
    with opened_folder(path.parent) as folder:
        handle = os.open(path.name, _NEW | os.O_APPEND, mode, dir_fd=folder)
        try:
            os.fsync(folder)
        except OSError:
            os.close(handle)
            raise
    return handle


def open_existing(path: Path) -> int:
    """Open an existing regular file, or a link to one, for appending. Raises OSError."""
    handle = os.open(path, os.O_RDWR | os.O_APPEND | UNAWAITED)
    expect_regular(handle, path)
    return handle


def write_new(path: Path, data: bytes, *, mode: int = PUBLIC_FILE, root: Path | None = None) -> None:
    """Create a file with its content, synced. Raises FileExistsError; leaves nothing behind on failure."""
    with naming(path), opened_folder(path.parent, root) as folder:
        handle = os.open(path.name, _NEW, mode, dir_fd=folder)
        try:
            try:
                write_all(handle, data)
                os.fsync(handle)
            finally:
                os.close(handle)
            os.fsync(folder)
        except BaseException:
            os.unlink(path.name, dir_fd=folder)
            raise


def create_whole(path: Path, data: bytes, *, mode: int = PUBLIC_FILE) -> None:
    """Create a file that has its content from the first moment on, synced. An existing one stays unchanged. Raises
    OSError.
    """
    fresh = f"{UNFINISHED}{os.urandom(8).hex()}.new"
    with naming(path), opened_folder(path.parent) as folder:
        if os.path.lexists(path):
            return
        try:
            handle = os.open(fresh, _NEW, mode, dir_fd=folder)
            try:
                write_all(handle, data)
                os.fsync(handle)
            finally:
                os.close(handle)
            with suppress(FileExistsError):  # another program was first
                os.link(fresh, path.name, src_dir_fd=folder, dst_dir_fd=folder, follow_symlinks=False)
        finally:
            with suppress(FileNotFoundError):
                os.unlink(fresh, dir_fd=folder)
        os.fsync(folder)


def append(path: Path, data: bytes, root: Path | None = None) -> None:
    """Append data to a regular file, synced; a missing file is created. No link is followed to it, nor below `root`,
    and a file with several names, any of which may be elsewhere, is left alone. Raises OSError.
    """
    with naming(path), unfollowed(path), opened_folder(path.parent, root) as folder:
        handle = os.open(path.name, _MORE, PUBLIC_FILE, dir_fd=folder)
        expect_regular(handle, path)
        try:
            if os.fstat(handle).st_nlink > 1:
                raise NotRegular(errno.ENXIO, "it is a hard link to another file")
            write_all(handle, data)
            sync_data(handle)
        finally:
            os.close(handle)
        os.fsync(folder)


def make_folder(folder: Path, *, mode: int = PUBLIC_FOLDER, root: Path | None = None) -> None:
    """Make a folder and its missing parents, each synced; an existing one is left unchanged."""
    with naming(folder):
        above = root or next(each for each in (folder, *folder.parents) if each.exists())
        with opened_folder(folder, above, make=mode):
            pass


def sync_folder(folder: Path) -> None:
    """Make the names in a folder survive a crash."""
    with opened_folder(folder) as handle:
        os.fsync(handle)


def lock(path: Path, *, mode: int = PRIVATE_FILE) -> int:
    """Lock a file, made if missing, until the returned descriptor is closed or the process dies. Raises BlockingIOError
    where it is locked, and OSError.
    """
    with unfollowed(path):
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | UNAWAITED, mode)
    expect_regular(handle, path)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        raise
    return handle
