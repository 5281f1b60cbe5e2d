"""Files that one process at a time may hold."""

import fcntl
import os
from pathlib import Path

from rtshcua.adapters.store.reading import UNAWAITED, expect_regular
from rtshcua.adapters.store.writing import PRIVATE_FILE


def lock(path: Path, *, mode: int = PRIVATE_FILE) -> int:
    """A descriptor that holds a file, made where it is missing, until it is closed or its holder dies.

    Raises BlockingIOError where somebody holds it, and OSError.
    """
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | UNAWAITED, mode)
    expect_regular(handle, path)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(handle)
        raise
    return handle
