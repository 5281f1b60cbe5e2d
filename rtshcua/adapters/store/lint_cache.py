"""What `lint` remembers from run to run: one file an entry, in the user's cache folder, by the path of the checkout.

It may be deleted at any time. No checkout says where it lies, and nothing is kept in one: strangers may write there (a
pull request, an archive). So nothing but the system guards the entries: where others than the user could write to
the folder, nothing is remembered. An entry is written beside its place and moved there, so that runs at the same
time read either the old one or the new one. Whatever cannot be read or written is as if it were not there: a cache is
never a reason to fail. Below the cache folder no link is followed.
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
#: of the form of entries; what has another is not looked at
_FORM: Final = "3"
_LARGEST: Final = 16 << 20
_TAG: Final = (
    "Signature: 8a477f597d28d172789f06886806bc55\n"
    "# This is a cache of `rtshcua lint`: see https://bford.info/cachedir/. It may be deleted at any time.\n"
)


class LintCache:
    """Entries by name, of one checkout, below the user's cache folder, which is made when the first one is kept.

    A `fresh` one gives nothing but what was kept in it during this run.
    """

    def __init__(self, user: Path, checkout: Path, *, fresh: bool = False) -> None:
        self._root = user
        self._place = user / FOLDER / _FORM / sha256(os.fsencode(os.path.realpath(checkout))).hexdigest()[:40]
        self._works = user.is_absolute()  # XDG Base Directory Specification: others are ignored
        self._fresh = fresh
        self._kept: dict[str, bytes] = {}
        self._ours: bool | None = None

    def get(self, name: str) -> bytes | None:
        """An entry as it was kept, or None."""
        if name in self._kept:
            return self._kept[name]
        if self._fresh or not self._works:
            return None
        try:
            data = read_regular(self._place / name, _LARGEST, self._root)
            trusted = self._trusted()
        except OSError:
            return None
        digest, _, entry = data.partition(b"\n")  # a loss of power may leave anything: none is synced
        return entry if trusted and digest == _digest(entry) else None

    def put(self, name: str, entry: bytes) -> None:
        """Keep an entry, if the system lets us; after the first that it does not, no further one is tried."""
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
        """Make the folder, and say in it what it is, for backups. Raises OSError for one that others may write to."""
        if self._ours:
            return
        make_folder(self._root)
        make_folder(self._place, mode=PRIVATE_FOLDER, root=self._root)
        with suppress(FileExistsError):
            write_new(self._root / FOLDER / "CACHEDIR.TAG", _TAG.encode(), root=self._root)
        if not self._trusted():
            raise PermissionError("other users can write to the cache")

    def _trusted(self) -> bool:
        """Whether the folder of the checkout, and those above it up to the user's, are the user's own."""
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
