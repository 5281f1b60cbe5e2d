"""Limit how far symbolic links may lead a path: to the edge of its checkout. A checkout may be from a stranger: a pull
request, an unpacked archive. A link that leads out of it is not followed, so that no file of the user is read or
written under a name in it.
"""

import os
from errno import EACCES
from pathlib import Path
from typing import Final

#: files that mark the folder of a project
PROJECT: Final = ("rtshcua.toml", "pyproject.toml")
REPOSITORY: Final = ".git"


class OutsideCheckout(PermissionError):
    """A path that leads out of its checkout, by itself or by links."""


def checkout_of(path: str | Path) -> str | None:
    """The folder of the repository that a path lies in as written; else of the nearest project; else None."""
    project = None
    for folder in _above(path):
        if os.path.lexists(os.path.join(folder, REPOSITORY)):  # noqa: PTH118  for each source of a run
            return folder
        if project is None and any(os.path.lexists(os.path.join(folder, name)) for name in PROJECT):  # noqa: PTH118
            project = folder
    return project


def expect_inside(path: Path) -> tuple[Path, Path | None]:
    """Where to write a file, with links resolved, and the folder that contains it. The writer opens the file below that
    folder without following links, because a link may be placed after this check.

    Raises `OutsideCheckout` where links lead out of the path's project or, outside of a project, out of the working
    folder. The folder is None for a path outside of both, which is the caller's own decision.
    """
    real = os.path.realpath(path)
    here = Path.cwd()
    marks = (*PROJECT, REPOSITORY)
    edge = next((each for each in _above(path) if any(os.path.lexists(f"{each}/{name}") for name in marks)), None)
    if edge is None and Path(os.path.abspath(path)).is_relative_to(here):  # noqa: PTH100  without following links
        edge = str(here)
    if edge is None:
        return Path(real), None
    root = os.path.realpath(edge)
    if not lies_in(real, root):
        raise OutsideCheckout(EACCES, f"symbolic links lead out of `{edge}`; use the resolved path", str(path))
    return Path(real), Path(root)


def lies_in(real: str, folder: str) -> bool:
    """Whether a path is a folder or lies below it; both are absolute and free of links."""
    return real == folder or real.startswith(folder.rstrip(os.sep) + os.sep)


def _above(path: str | Path) -> list[str]:
    place = os.path.abspath(path)  # noqa: PTH100  without following links
    folder = place if os.path.isdir(place) and not os.path.islink(place) else os.path.dirname(place)  # noqa: PTH112, PTH114, PTH120
    found = [folder]
    while (folder := os.path.dirname(folder)) != found[-1]:  # noqa: PTH120
        found.append(folder)
    return found
