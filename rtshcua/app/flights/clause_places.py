"""The line of a clause in its source, if that is at hand: the bundle has only its name, its digest and an offset."""

from collections.abc import Sequence
from contextlib import suppress
from copy import copy
from hashlib import sha256
from pathlib import Path
from typing import Final

from rtshcua import library
from rtshcua.adapters.store.reading import read_regular
from rtshcua.ground.language.paths import LIBRARY
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy

#: a larger file is no source
_MOST: Final = 1 << 20


class ClausePlaces:
    """The sources of a policy and a mission, by their number in `Clause.source`, sought in the library and below these
    folders. A file with another digest is not the source.
    """

    def __init__(self, policy: Policy, mission: Mission, folders: Sequence[Path]) -> None:
        self._folders = folders
        self._policy = _sources(policy.sources, policy.source_digests, folders)
        self._mission = _sources(mission.sources, mission.source_digests, folders)

    def of_mission(self, names: Sequence[str], digests: Sequence[bytes]) -> "ClausePlaces":
        """The same policy, with the sources of another mission."""
        other = copy(self)
        other._mission = _sources(names, digests, self._folders)
        return other

    def place(self, source: int, start: int) -> str:
        """Where a clause stands: the file, and the line or else the offset in characters; empty if that is unknown."""
        sources = (*self._policy, *self._mission)
        if not 0 <= source < len(sources):
            return ""
        name, text = sources[source]
        if text is None:
            return f"{name}, from character {start}"
        return f"{name}:{text.count(chr(10), 0, max(start, 0)) + 1}"


def _sources(names: Sequence[str], digests: Sequence[bytes], folders: Sequence[Path]) -> list[tuple[str, str | None]]:
    """The names of sources with their texts, which are None if they are not at hand."""
    return [(name, _text(name, digest, folders)) for name, digest in zip(names, digests, strict=False)]


def _text(name: str, digest: bytes, folders: Sequence[Path]) -> str | None:
    if name.startswith(LIBRARY):
        places = [library.root() / name.removeprefix(LIBRARY)]
    else:
        places = [folder / part for folder in folders for part in (name, Path(name).name)]
    for place in places:
        with suppress(OSError, UnicodeDecodeError):
            data = read_regular(place, _MOST)
            if sha256(data).digest() == digest:
                return data.decode("utf-8")
    return None
