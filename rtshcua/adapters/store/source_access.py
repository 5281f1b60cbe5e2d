"""Which files may be read as sources: the inputs, their project, the library, packs, and folders that the user allows.
An import may be a stranger's: files elsewhere are not opened, and the refusal does not reveal whether they exist.
"""

import os
from collections.abc import Iterable
from errno import EACCES, ENXIO
from pathlib import Path
from typing import Final

from rtshcua.adapters.store.checkout import OutsideCheckout, checkout_of, lies_in
from rtshcua.adapters.store.reading import NotRegular, read_regular
from rtshcua.ground.language.size_limits import MAX_SIZE

#: further folders for imports, separated as in PATH: set by the user, never by a checkout
ALLOWED: Final = "RTSHCUA_IMPORTS"
_WHY: Final = f"it is outside of the project (`{ALLOWED}` names further folders)"


class ReadableSources:
    """The readable folders, the `library` first, and files that were named themselves; `folders` may change."""

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
        """Allow a file that the user names or opens, and its project; outside of a project, the working folder or else
        the file's own folder.
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
        """All readable folders."""
        return (*self._always, *self.folders)

    def read(self, name: str) -> bytes:
        """The content, at most one octet more than the parser accepts, so that the parser reports files that are too
        large. Raises `OutsideCheckout`, and OSError as `read_regular`.
        """
        real, edge = self._placed(name)
        try:
            return read_regular(real, MAX_SIZE, edge)
        except FileNotFoundError:
            if edge is None and Path(name).exists():  # a pipe through `/dev/stdin`, which has no path
                raise NotRegular(ENXIO, "not a regular file", name) from None
            raise

    def listing(self, name: str) -> list[str]:
        """The names in a folder, for suggestions. Raises OSError."""
        return os.listdir(self._placed(name or ".")[0])  # noqa: PTH208

    def pack(self, name: str) -> str | None:
        """The folder of an installed pack, which becomes readable; None without such a pack."""
        if name not in self._packs:
            from rtshcua.adapters.packs import folder  # noqa: PLC0415  slow, and few sources ask for a pack

            found = self._packs[name] = folder(name)
            if found is not None:
                self._always.setdefault(os.path.realpath(found))
        return self._packs[name]

    def _placed(self, name: str) -> tuple[Path, Path | None]:
        """The path of a name with links resolved, and the folder that contains it."""
        real = os.path.realpath(name)
        if real in self._asked:
            return Path(real), None
        for edge in self.edges:
            if lies_in(real, edge):
                return Path(real), Path(edge)
        raise OutsideCheckout(EACCES, _WHY, name)
