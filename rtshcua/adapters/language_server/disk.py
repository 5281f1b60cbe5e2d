"""What the server reads of the disk: sources, folders, and which sources a workspace has. It writes nothing."""

import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from rtshcua.adapters.packs import folder
from rtshcua.adapters.store.reading import read_regular
from rtshcua.ground.editor.desk import Desk
from rtshcua.ground.language.faults import MAX_SIZE

SOURCE = ".rts"
MOST = 2_000
"""Sources of a workspace that are looked through for references."""


def desk(library: str) -> Desk:
    """An empty desk over the disk."""
    return Desk(read, library, listing, folder)


def read(path: str) -> bytes:
    """At most one byte more than the parser takes, so that it is the parser who says that a file is too large."""
    return read_regular(path, MAX_SIZE)


def listing(path: str) -> Iterable[str]:
    """The names in a folder."""
    return [each.name for each in Path(path or ".").iterdir()]


def sources(folders: Iterable[str]) -> Iterator[str]:
    """The sources below folders, but for hidden ones, as far as they are not too many."""
    found = 0
    for top in folders:
        for place, below, files in os.walk(top):
            below[:] = sorted(name for name in below if not name.startswith(".") and name != "node_modules")
            for name in sorted(files):
                if name.endswith(SOURCE) and not name.startswith("."):
                    found += 1
                    if found > MOST:
                        return
                    yield str(Path(place, name))
