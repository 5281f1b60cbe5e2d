"""The files of the server: their URIs and names, and reading them from the disk. Nothing is written."""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from urllib.parse import quote, unquote, urlsplit

from rtshcua.adapters.store.reading import walk
from rtshcua.adapters.store.source_access import ReadableSources
from rtshcua.ground.editor.workspace import Workspace
from rtshcua.ground.language.paths import shown

SOURCE = ".rts"
MOST = 2_000
"""The most sources of a workspace that are searched for references."""
_DRIVE = re.compile(r"/[A-Za-z]:(?=/|\Z)")


def desk(library: str, readable: ReadableSources) -> Workspace:
    """An empty workspace over the readable files of the disk."""
    return Workspace(readable.read, library, readable.listing, readable.pack)


def sources(folders: Iterable[str]) -> Iterator[str]:
    """The sources below folders except hidden ones, `MOST` at most."""
    found = 0
    for top in folders:
        for place, below, files in walk(top):
            below[:] = sorted(name for name in below if not name.startswith(".") and name != "node_modules")
            for name in sorted(files):
                if name.endswith(SOURCE) and not name.startswith("."):
                    found += 1
                    if found > MOST:
                        return
                    yield str(Path(place, name))


def name_of(uri: str) -> str:
    """The name of a text, as from `shown`. Another URI gets a name in the working folder made of the URI."""
    return shown(path_of(uri) or re.sub(r"[\\/\0]+", "_", unquote(uri)))


def path_of(uri: str) -> str | None:
    """The path of a `file:` URI, also of Windows (`file:///c%3A/x.rts`); None for any other."""
    try:
        scheme, host, path, _, _ = urlsplit(uri)
    except ValueError:
        return None
    if scheme != "file" or "\0" in unquote(path):
        return None
    path = unquote(path)
    if _DRIVE.match(path):
        return path[1].lower() + path[2:]
    return f"//{host}{path}" if host and host != "localhost" else path


def uri_of(name: str) -> str:
    """The URI of a file by its name."""
    return "file://" + quote(Path(name).absolute().as_posix())
