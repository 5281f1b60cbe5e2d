"""How files are called: one name for each, one that means the same on every machine, and what an import means."""

import posixpath
import re
from collections.abc import Callable, Mapping
from os import getcwd, sep
from os.path import join, normpath
from pathlib import Path

LIBRARY = "lib:"
#: A pack of skills by its name, as in `acme:skills/spray.rts`. One letter would be a drive.
_PACK = re.compile(r"([a-z][a-z0-9_-]+):(?!//)", re.ASCII)

Packs = Callable[[str], str | None]
"""The folder that a pack's name stands for; None where no such pack is installed."""
#: the folders of the library that sources come from; in a checkout it has others beside them
SHELVES = ("skills", "policies", "missions")


def shown(path: str) -> str:
    """The file's name for people: absolute, or relative to the working folder where it lies in it."""
    here = getcwd()  # noqa: PTH109  # thousands of times in a run: a Path costs ten times as much
    place = normpath(join(here, path))  # noqa: PTH118
    if place == here:
        return "."
    below = here if here.endswith(sep) else here + sep
    return place.removeprefix(below).replace(sep, "/")


def from_here(path: str) -> str:
    """The file's name as seen from the working folder, whether it lies in it or not: never an absolute one."""
    return posixpath.relpath(path.replace(sep, "/"), getcwd().replace(sep, "/"))  # noqa: PTH109  # as in `shown`


def stable(path: str, folders: Mapping[str, str], first: str) -> str:
    """The file's name for what is signed: in a pack (`folders` by name), or else relative to the file `first`."""
    place = _absolute(path)
    for name, folder in folders.items():
        if place.is_relative_to(_absolute(folder)):
            return f"{name}:{place.relative_to(_absolute(folder)).as_posix()}"
    return posixpath.relpath(place.as_posix(), _absolute(first).parent.as_posix())


def imported(written: str, importer: str, packs: Packs) -> str | None:
    """The path of an import that is `written` in the file `importer`; None where it means nothing elsewhere.

    What stands after the name of a pack (`lib:` is the one that ships) never leaves it, and takes no detour.
    """
    pack = pack_of(written)
    if pack is not None:
        inside = written.removeprefix(f"{pack}:")
        folder = packs(pack) if is_direct(inside) else None
        return None if folder is None else posixpath.join(folder, inside)
    if not written or "\\" in written or ":" in written or written.startswith(("/", "~")):
        return None
    return posixpath.join(posixpath.dirname(importer), written)


def pack_of(written: str) -> str | None:
    """The name of the pack that a path as written, or a stable name, begins with."""
    match = _PACK.match(written)
    return None if match is None else match[1]


def is_direct(inside: str) -> bool:
    """Whether a path after the name of a pack leads straight down."""
    return all(part not in ("", ".", "..") for part in inside.split("/")) and "\\" not in inside and ":" not in inside


def on_a_shelf(written: str) -> bool:
    """Whether an import names a file that ships: what an agent proposes may import no other, for in a checkout the
    library has folders beside its shelves, in which the agent may have written something.
    """
    shelf, _, rest = written.removeprefix(LIBRARY).partition("/")
    return written.startswith(LIBRARY) and shelf in SHELVES and is_direct(rest)


def _absolute(path: str) -> Path:
    return Path(normpath(Path(path).absolute()))
