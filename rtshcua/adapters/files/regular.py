"""Opening what somebody else put there: a regular file or nothing, for a pipe would be waited for."""

import errno
import os
import stat
from io import BufferedReader
from pathlib import Path
from typing import Final

_FLAGS: Final = os.O_RDONLY | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_NONBLOCK", 0)


def open_regular(path: Path) -> BufferedReader:
    """A regular file, or a link to one, opened to be read. Raises OSError, also for everything else."""
    handle = os.open(path, _FLAGS)
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise OSError(errno.ENXIO, "no regular file", str(path))
    return os.fdopen(handle, "rb")
