"""How files are called: one name for each, one that means the same on every machine, and what an import means."""

import posixpath
from os.path import normpath
from pathlib import Path

LIBRARY = "lib:"
#: the folders of the library that sources come from; in a checkout it has others beside them
SHELVES = ("skills", "policies", "missions")


def shown(path: str) -> str:
    """The file's name for people: absolute, or relative to the working folder where it lies in it."""
    place = _absolute(path)
    here = _absolute(".")
    return (place.relative_to(here) if place.is_relative_to(here) else place).as_posix()


def stable(path: str, library: str | None, first: str) -> str:
    """The file's name for what is signed: in the library, or else relative to the folder of the file `first`."""
    place = _absolute(path)
    if library is not None and place.is_relative_to(_absolute(library)):
        return LIBRARY + place.relative_to(_absolute(library)).as_posix()
    return posixpath.relpath(place.as_posix(), _absolute(first).parent.as_posix())


def imported(written: str, importer: str, library: str | None) -> str | None:
    """The path of an import that is `written` in the file `importer`; None where it means nothing elsewhere.

    What stands after `lib:` never leaves the library, and takes no detour.
    """
    if written.startswith(LIBRARY):
        inside = written.removeprefix(LIBRARY)
        if library is None or not is_direct(inside):
            return None
        return posixpath.join(library, inside)
    if not written or "\\" in written or ":" in written or written.startswith(("/", "~")):
        return None
    return posixpath.join(posixpath.dirname(importer), written)


def is_direct(inside: str) -> bool:
    """Whether a path after `lib:` leads straight down."""
    return all(part not in ("", ".", "..") for part in inside.split("/")) and "\\" not in inside and ":" not in inside


def on_a_shelf(written: str) -> bool:
    """Whether an import names a file that ships: what an agent proposes may import no other, for in a checkout the
    library has folders beside its shelves, in which the agent may have written something.
    """
    shelf, _, rest = written.removeprefix(LIBRARY).partition("/")
    return written.startswith(LIBRARY) and shelf in SHELVES and is_direct(rest)


def _absolute(path: str) -> Path:
    return Path(normpath(Path(path).absolute()))
