"""The mark of everything that findings depend on besides the sources: this program itself.

It is of the contents of all modules that check, so that a cache can travel between machines, and outlives nothing of
what it was made by.
"""

import os
import sys
from functools import cache
from hashlib import sha256
from pathlib import Path

from rtshcua import __version__

#: the parts of the package that findings come from
_PARTS = ("front/cli/linting", "decision", "diagnostics", "ground", "mavlink", "model", "wire")


@cache
def mark() -> str:
    """The mark: a digest. What runs is what was there when it was first asked for."""
    package = Path(__file__).resolve().parents[3]
    whole = sha256(f"{__version__} {sys.version_info[:3]}".encode())
    for part in _PARTS:
        for file in sorted(_files(str(package / part))):
            with open(file, "rb") as opened:  # noqa: PTH123  a Path costs more than the file
                whole.update(f"{file.removeprefix(str(package))}\0".encode())
                whole.update(sha256(opened.read()).digest())
    return whole.hexdigest()


def _files(folder: str) -> list[str]:
    found: list[str] = []
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir():
                found += _files(entry.path) if entry.name != "__pycache__" else []
            elif entry.name.endswith((".py", ".json")):
                found.append(entry.path)
    return found
