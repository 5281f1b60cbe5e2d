"""Which files may be read as sources: the inputs, their project, the library, packs, and folders that the user allows.

A checkout may be a stranger's: a pull request, an unpacked archive. A link that leads out of it is not followed, so
that no file of ours is read or written under a name of theirs. An import that names a file outside is not opened, and
the refusal does not tell whether the file exists.
"""

import os
from collections.abc import Iterable
from errno import EACCES, ENXIO
from pathlib import Path
from typing import Final

from rtshcua.adapters.store.reading import NotRegular, read_regular
from rtshcua.ground.language.size_limits import MAX_SIZE

#: what the folder of a project has in it
PROJECT: Final = ("rtshcua.toml", "pyproject.toml")
REPOSITORY: Final = ".git"


class OutsideCheckout(PermissionError):
    """A path that leads, by itself or by links, to where it has no business."""


def checkout_of(path: str | Path) -> str | None:
    """The folder of the repository that a path lies in as it is written; else of the nearest project; else None."""
    project = None
    for folder in _above(path):
        if os.path.lexists(os.path.join(folder, REPOSITORY)):  # noqa: PTH118  for each source of a run
            return folder
        if project is None and any(os.path.lexists(os.path.join(folder, name)) for name in PROJECT):  # noqa: PTH118
            project = folder
    return project


def expect_inside(path: Path) -> tuple[Path, Path | None]:
    """Where a file is to be written, free of links, and the folder below which that is. Who writes opens it from there
    without following links: one may be put in its way after this was asked.

    Raises `OutsideCheckout` where links lead out of its project, or, if it lies in none, out of the working folder:
    what is named otherwise is its writer's own business (None).
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
        raise OutsideCheckout(EACCES, f"symbolic links lead out of `{edge}`; name the place itself", str(path))
    return Path(real), Path(root)


def lies_in(real: str, folder: str) -> bool:
    """Whether a path is a folder or lies below it; both are absolute, and free of links."""
    return real == folder or real.startswith(folder.rstrip(os.sep) + os.sep)


def _above(path: str | Path) -> list[str]:
    place = os.path.abspath(path)  # noqa: PTH100  without following links
    folder = place if os.path.isdir(place) and not os.path.islink(place) else os.path.dirname(place)  # noqa: PTH112, PTH114, PTH120
    found = [folder]
    while (folder := os.path.dirname(folder)) != found[-1]:  # noqa: PTH120
        found.append(folder)
    return found


#: folders that imports may lead to besides, parted as in PATH: the user's to say, and no checkout's
ALLOWED: Final = "RTSHCUA_IMPORTS"
_WHY: Final = f"it lies outside of the project (`{ALLOWED}` names further folders)"


class ReadableSources:
    """Folders, that of the `library` first, and files that were asked for themselves; `folders` may change."""

    def __init__(self, library: str, asked: Iterable[str | Path] = ()) -> None:
        allowed = [each for each in os.environ.get(ALLOWED, "").split(os.pathsep) if os.path.isabs(each)]  # noqa: PTH117
        self._always = {os.path.realpath(each): None for each in (library, *allowed)}
        self.folders: list[str] = []
        self._edges: dict[str, str | None] = {}
        self._asked: set[str] = set()
        self._packs: dict[str, str | None] = {"lib": library}
        for path in asked:
            self.ask(path)

    def ask(self, path: str | Path) -> None:
        """A file that somebody names on the command line, or opens: what is in its project may be read too; where it is
        in none, what is in the working folder, or else in its own.
        """
        folder = os.path.dirname(os.path.abspath(path))  # noqa: PTH100, PTH120  without following links
        if folder not in self._edges:
            self._edges[folder] = checkout_of(path)
        edge = self._edges[folder]
        if edge is None:
            self._asked.add(os.path.realpath(path))
            here = os.getcwd()  # noqa: PTH109
            edge = here if lies_in(folder, here) else folder
        self._always.setdefault(os.path.realpath(edge))

    @property
    def edges(self) -> tuple[str, ...]:
        """All folders that may be read from."""
        return (*self._always, *self.folders)

    def read(self, name: str) -> bytes:
        """At most one octet more than the parser takes, so that it is the parser who says that a file is too large.

        Raises `OutsideCheckout`, and OSError as `read_regular`.
        """
        real, edge = self._placed(name)
        try:
            return read_regular(real, MAX_SIZE, edge)
        except FileNotFoundError:
            if edge is None and Path(name).exists():  # a pipe by `/dev/stdin`, which leads to no path
                raise NotRegular(ENXIO, "no regular file", name) from None
            raise

    def listing(self, name: str) -> list[str]:
        """The names in a folder, for suggestions. Raises OSError."""
        return os.listdir(self._placed(name or ".")[0])  # noqa: PTH208

    def pack(self, name: str) -> str | None:
        """The folder of an installed pack, from which may be read from then on; None where there is none."""
        if name not in self._packs:
            from rtshcua.adapters.packs import folder  # noqa: PLC0415  slow, and few sources ask for a pack

            found = self._packs[name] = folder(name)
            if found is not None:
                self._always.setdefault(os.path.realpath(found))
        return self._packs[name]

    def _placed(self, name: str) -> tuple[Path, Path | None]:
        """Where a name leads, free of links, and the folder below which it stays."""
        real = os.path.realpath(name)
        if real in self._asked:
            return Path(real), None
        for edge in self.edges:
            if lies_in(real, edge):
                return Path(real), Path(edge)
        raise OutsideCheckout(EACCES, _WHY, name)
