"""Names of files: the name for people, the stable name that is signed, and the path of an import."""

import posixpath
import re
from collections.abc import Callable, Mapping
from os import getcwd, sep
from os.path import join, normpath
from pathlib import Path

LIBRARY = "lib:"
#: The name of a pack of skills, as in `acme:skills/spray.rts`. A single letter would be a drive.
_PACK = re.compile(r"([a-z][a-z0-9_-]+):(?!//)", re.ASCII)

Packs = Callable[[str], str | None]
"""Returns the folder of a pack by its name; None if it is not installed."""
#: the folders of the library with sources; a checkout has other folders beside them
SHELVES = ("skills", "policies", "missions")


def shown(path: str) -> str:
    """The file's name for people: relative to the working folder if it is inside, else absolute."""
    here = getcwd()  # noqa: PTH109  # thousands of times in a run: a Path costs ten times as much
    place = normpath(join(here, path))  # noqa: PTH118
    if place == here:
        return "."
    below = here if here.endswith(sep) else here + sep
    return place.removeprefix(below).replace(sep, "/")


def from_here(path: str) -> str:
    """The file's name relative to the working folder, also if it is outside."""
    return posixpath.relpath(path.replace(sep, "/"), getcwd().replace(sep, "/"))  # noqa: PTH109  # as in `shown`


def stable(path: str, folders: Mapping[str, str], first: str) -> str:
    """The file's name as it is signed: in a pack (`folders` by name), or else relative to the file `first`."""
    place = _absolute(path)
    for name, folder in folders.items():
        if place.is_relative_to(_absolute(folder)):
            return f"{name}:{place.relative_to(_absolute(folder)).as_posix()}"
    return posixpath.relpath(place.as_posix(), _absolute(first).parent.as_posix())


def imported(written: str, importer: str, packs: Packs) -> str | None:
    """The path of an import `written` in the file `importer`; None if it is not portable.

    A path in a pack (`lib:` is the one that ships) never leaves the pack and has no `..`.
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
    """The name of the pack in a written path or a stable name, if any."""
    match = _PACK.match(written)
    return None if match is None else match[1]


def is_direct(inside: str) -> bool:
    """Whether a path in a pack has no empty, `.` or `..` part."""
    return all(part not in ("", ".", "..") for part in inside.split("/")) and "\\" not in inside and ":" not in inside


def on_a_shelf(written: str) -> bool:
    """Whether an import names a file that ships with the library.

    A proposal of an agent may import no other file: a checkout has folders in which the agent may have written.
    """
    shelf, _, rest = written.removeprefix(LIBRARY).partition("/")
    return written.startswith(LIBRARY) and shelf in SHELVES and is_direct(rest)


def _absolute(path: str) -> Path:
    return Path(normpath(Path(path).absolute()))
