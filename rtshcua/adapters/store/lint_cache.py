"""The cache of `lint` between runs: one file for each entry, in the user's cache folder, by the path of the checkout.
It may be deleted at any time. A checkout neither determines its place nor contains it, because strangers may write
there (a pull request, an archive). So entries are protected only by the system: if other users can write to the folder,
nothing is cached. An entry is written to a temporary file and renamed, so that concurrent runs read either the old or
the new one. An entry that cannot be read or written counts as missing: the cache never causes a failure. Below the
cache folder no link is followed.
"""

import os
import stat
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Final

from rtshcua.adapters.store.reading import opened_folder, read_regular
from rtshcua.adapters.store.writing import PRIVATE_FILE, PRIVATE_FOLDER, make_folder, replace, write_new

FOLDER: Final = "lint"
#: the version of the entries; others are ignored
_FORM: Final = "3"
_LARGEST: Final = 16 << 20
_TAG: Final = (
    "Signature: 8a477f597d28d172789f06886806bc55\n"
    "# This is a cache of `rtshcua lint`: see https://bford.info/cachedir/. It may be deleted at any time.\n"
)


class LintCache:
    """Entries by name, of one checkout, below the user's cache folder, which is made for the first one. A `fresh` cache
    returns only entries of this run.
    """

    def __init__(self, user: Path, checkout: Path, *, fresh: bool = False) -> None:
        self._root = user
        self._place = user / FOLDER / _FORM / sha256(os.fsencode(os.path.realpath(checkout))).hexdigest()[:40]
        self._works = user.is_absolute()  # XDG Base Directory Specification: relative paths are ignored
        self._fresh = fresh
        self._kept: dict[str, bytes] = {}
        self._ours: bool | None = None

    def get(self, name: str) -> bytes | None:
        """An entry, or None."""
        if name in self._kept:
            return self._kept[name]
        if self._fresh or not self._works:
            return None
        try:
            data = read_regular(self._place / name, _LARGEST, self._root)
            trusted = self._trusted()
        except OSError:
            return None
        digest, _, entry = data.partition(b"\n")  # entries are not synced, so a power failure may leave anything
        return entry if trusted and digest == _digest(entry) else None

    def put(self, name: str, entry: bytes) -> None:
        """Keep an entry if possible; after the first failure no further one is tried."""
        self._kept[name] = entry
        if not self._works or len(entry) + 65 > _LARGEST:
            return
        try:
            self._prepare()
            data = _digest(entry) + b"\n" + entry
            replace(self._place / name, data, mode=PRIVATE_FILE, synced=False, root=self._root)
        except OSError:
            self._works = False

    def _prepare(self) -> None:
        """Make the folder, with a tag for backup programs. Raises OSError for one that other users can write to."""
        if self._ours:
            return
        make_folder(self._root)
        make_folder(self._place, mode=PRIVATE_FOLDER, root=self._root)
        with suppress(FileExistsError):
            write_new(self._root / FOLDER / "CACHEDIR.TAG", _TAG.encode(), root=self._root)
        if not self._trusted():
            raise PermissionError("other users can write to the cache")

    def _trusted(self) -> bool:
        """Whether the folder of the checkout, and those above it up to the user's, belong to the user alone."""
        if self._ours is None:
            self._ours = all(map(self._is_ours, (self._root, *self._place.parents, self._place)))
        return self._ours

    def _is_ours(self, folder: Path) -> bool:
        if not folder.is_relative_to(self._root):
            return True
        with opened_folder(folder, self._root) as handle:
            state = os.fstat(handle)
        return state.st_uid == os.geteuid() and not state.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _digest(entry: bytes) -> bytes:
    return sha256(entry).hexdigest().encode()
