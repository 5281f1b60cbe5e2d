"""What all processes of a test run have in common: the first that asks for it makes it, the others read it."""

import fcntl
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")

#: names the folder that the run keeps these things in; without one each process makes its own
FOLDER = "RTSHCUA_TEST_ONCE"


def once(name: str, make: Callable[[], T]) -> T:
    """What `make` gives. One process of the run calls it; `name` says what it is, and names a file."""
    top = os.environ.get(FOLDER)
    if top is None:
        return make()
    path = Path(top, name)
    with Path(top, f"{name}.lock").open("wb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # whoever comes second waits, which costs less than making it again
        if not path.exists():
            path.write_bytes(pickle.dumps(make()))
    made: T = pickle.loads(path.read_bytes())
    return made
