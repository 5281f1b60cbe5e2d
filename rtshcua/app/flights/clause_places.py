"""The line of a clause in its source, if that is at hand: the bundle has only its name, its digest and an offset."""

from collections.abc import Sequence
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Final

from rtshcua import library
from rtshcua.adapters.store.reading import read_regular

#: a larger file is no source
_MOST: Final = 1 << 20
_LIBRARY: Final = "lib:"


class ClausePlaces:
    """The sources of a policy and a mission, by their number in `Clause.source`, sought in the library and below these
    folders. A file with another digest is not the source.
    """

    def __init__(self, names: Sequence[str], digests: Sequence[bytes], folders: Sequence[Path]) -> None:
        self._names = tuple(names)
        self._texts = tuple(map(lambda name, digest: _text(name, digest, folders), names, digests))

    def place(self, source: int, start: int) -> str:
        """Where a clause stands: the file, and the line or else the offset in characters."""
        if not 0 <= source < len(self._names):
            return ""
        text = self._texts[source]
        if text is None:
            return f"{self._names[source]}, from character {start}"
        return f"{self._names[source]}:{text.count(chr(10), 0, start) + 1}"


def _text(name: str, digest: bytes, folders: Sequence[Path]) -> str | None:
    if name.startswith(_LIBRARY):
        places = [library.root() / name.removeprefix(_LIBRARY)]
    else:
        places = [folder / part for folder in folders for part in (name, Path(name).name)]
    for place in places:
        with suppress(OSError, UnicodeDecodeError):
            data = read_regular(place, _MOST)
            if sha256(data).digest() == digest:
                return data.decode("utf-8")
    return None
