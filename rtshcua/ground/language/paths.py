"""How files are called: one name for each, one that means the same on every machine, and what an import means."""

import posixpath
from os.path import normpath
from pathlib import Path

LIBRARY = "lib:"


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
    """The path of an import that is `written` in the file `importer`; None where it means nothing elsewhere."""
    if written.startswith(LIBRARY):
        return None if library is None else posixpath.join(library, written.removeprefix(LIBRARY).lstrip("/"))
    if not written or "\\" in written or ":" in written or written.startswith(("/", "~")):
        return None
    return posixpath.join(posixpath.dirname(importer), written)


def _absolute(path: str) -> Path:
    return Path(normpath(Path(path).absolute()))
