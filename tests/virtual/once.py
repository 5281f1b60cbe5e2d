"""Share objects between the processes of a test run: the first one makes it, the others read it."""

import fcntl
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")

#: the variable with the shared folder of the run; without it each process makes its own objects
FOLDER = "RTSHCUA_TEST_ONCE"


def once(name: str, make: Callable[[], T]) -> T:
    """Return the result of `make`, which one process of the run calls; `name` identifies it and names a file."""
    top = os.environ.get(FOLDER)
    if top is None:
        return make()
    path = Path(top, name)
    with Path(top, f"{name}.lock").open("wb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # other processes wait, which is cheaper than making it again
        if not path.exists():
            path.write_bytes(pickle.dumps(make()))
    made: T = pickle.loads(path.read_bytes())
    return made
