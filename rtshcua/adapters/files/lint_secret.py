"""The secret that what `lint` remembers is authenticated with: 32 random octets of a user, outside of any checkout.

Whoever may write to a checkout (a pull request, an archive, another user) may write to the cache in it. Without the
secret nothing that they write there is believed. It guards nothing else, so one that was lost is made anew: the cache
is cold for one run.
"""

import os
import stat
from contextlib import suppress
from pathlib import Path
from tempfile import mkstemp
from typing import Final

from rtshcua.adapters.files.durable import PRIVATE_FOLDER, make_folder, write_all

NAME: Final = "lint.secret"
_BYTES: Final = 32
_FLAGS: Final = os.O_RDONLY | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)


def lint_secret(folder: Path) -> bytes | None:
    """The secret that is kept in a folder, made if there is none that its owner alone may read; None where the system
    does not let us.
    """
    place = folder / NAME
    try:
        found = _read(place)
        if found is None:
            _make(place)
            found = _read(place)  # of two that make one at the same time the later
    except OSError:
        return None
    return found


def _read(place: Path) -> bytes | None:
    """The secret; None where it is not there, is no file of ours, may be read by others, or has another length."""
    try:
        handle = os.open(place, _FLAGS)
    except OSError:
        return None
    try:
        known = os.fstat(handle)
        if not stat.S_ISREG(known.st_mode):
            return None
        if os.name == "posix" and (known.st_mode & 0o077 or known.st_uid != os.geteuid()):
            return None
        data = os.read(handle, _BYTES + 1)
    finally:
        os.close(handle)
    return data if len(data) == _BYTES else None


def _make(place: Path) -> None:
    make_folder(place.parent, mode=PRIVATE_FOLDER)
    handle, made = mkstemp(dir=place.parent, prefix=f".{NAME}.")  # which its owner alone may read
    try:
        try:
            write_all(handle, os.urandom(_BYTES))
        finally:
            os.close(handle)
        Path(made).replace(place)
    except BaseException:
        with suppress(OSError):
            Path(made).unlink()
        raise
