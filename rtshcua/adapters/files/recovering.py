"""The steps of a recovery, each on the disk when it returns, and each to be taken again if it was broken off."""

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import suppress
from hashlib import sha256
from itertools import count
from pathlib import Path

from rtshcua.adapters.files.port import Disk, LogFile
from rtshcua.adapters.store.reading import open_regular

_CHUNK = 1 << 20


def plan_of(path: Path) -> Path:
    """Where the end of a log lies until it is written."""
    return path.with_suffix(".recovering")


def digest(path: Path, start: int, size: int) -> bytes:
    """SHA-256 of so many octets of a file, or of as many as there are."""
    hasher = sha256()
    for chunk in _chunks(path, start, size):
        hasher.update(chunk)
    return hasher.digest()


def keep(path: Path, kept: int, disk: Disk, *, besides: Path | None = None) -> Path:
    """Copies what stands behind the first `kept` octets; where that is now. A copy that was begun is written anew, but
    nothing that is another, nor what is kept in `besides`.
    """
    size = path.stat().st_size - kept
    for place in places(path):
        if place == besides:
            continue
        try:
            found = place.lstat()
        except FileNotFoundError:
            file = disk.create(place)
            break
        there = found.st_size
        if not _own(found):
            continue
        if there <= size and digest(place, 0, there) == digest(path, kept, there):
            file = disk.reopen(place)  # ours, whole or torn
            break
    try:
        file.truncate(0)
        for chunk in _chunks(path, kept, size):
            _write_all(file, chunk)
        file.sync()
    finally:
        file.close()
    return place


def places(path: Path) -> Iterator[Path]:
    """Where what is discarded of a log may lie, the first place first."""
    first = path.with_suffix(".discarded")
    yield first
    for number in count(2):
        yield first.with_name(f"{first.name}.{number}")


def write(path: Path, data: bytes, disk: Disk) -> None:
    """The file with this content, on the disk once this returns; until then it may hold anything."""
    if path.is_symlink():
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(path))
    if path.exists() and not _own(path.lstat()):
        raise OSError(errno.EEXIST, "something else lies there", str(path))
    file = disk.reopen(path) if path.exists() else disk.create(path)
    try:
        file.truncate(0)
        _write_all(file, data)
        file.sync()
    finally:
        file.close()


def end(path: Path, kept: int, tail: bytes, disk: Disk) -> None:
    """Cuts the log off after so many octets, and appends its end."""
    file = disk.reopen(path)
    try:
        file.truncate(kept)
        file.sync()  # else the power could leave what was cut behind what is appended
        _write_all(file, tail)
        file.sync()
    finally:
        file.close()
    forget(path, disk)


def forget(path: Path, disk: Disk) -> None:
    """What was begun is done. If this fails, who comes next finds the log closed, and tries again."""
    with suppress(OSError):
        plan_of(path).unlink()
        disk.sync_folder(path.parent)


def _own(found: os.stat_result) -> bool:
    """Whether it is a file that has no other name: another's content is not written over."""
    return stat.S_ISREG(found.st_mode) and found.st_nlink == 1


def _write_all(file: LogFile, data: bytes) -> None:
    view = memoryview(data)
    while view:
        view = view[file.write(view) :]


def _chunks(path: Path, start: int, size: int) -> Iterator[bytes]:
    with open_regular(path) as file:
        file.seek(start)
        while size > 0 and (chunk := file.read(min(size, _CHUNK))):
            size -= len(chunk)
            yield chunk
