"""What `lint` remembers from run to run: one file an entry, in a folder that may be deleted at any time.

The folder lies in a checkout, where others may write too, so each entry bears a code (HMAC-SHA256, RFC 2104) over its
name and its content. One that was cut, moved, half written, or made by anybody else is no entry. It is written beside
its place and moved there, so that runs at the same time read either the old one or the new one. Whatever cannot be read
or written is as if it were not there: a cache is never a reason to fail. Nothing is followed or written through a link,
and a folder that is there and is no cache is left alone.

The codes are made with a secret of this user: 32 random octets that are kept outside of any checkout. Whoever may write
to a checkout (a pull request, an archive, another user) may write to the cache in it; without the secret nothing that
they write there is believed. It guards nothing else, so one that was lost is made anew: the cache is cold for one run.
"""

import hmac
import os
from contextlib import suppress
from pathlib import Path
from typing import Final

from rtshcua.adapters.store.reading import exposed, open_regular, opened_folder, read_regular
from rtshcua.adapters.store.writing import PRIVATE_FILE, PRIVATE_FOLDER, make_folder, replace, write_new

FOLDER: Final = ".rtshcua_cache"
SECRET: Final = "lint.secret"
#: of the form of entries; what has another is not looked at
_FORM: Final = "2"
_LARGEST: Final = 16 << 20
_SECRET_BYTES: Final = 32
_TAG: Final = (
    "Signature: 8a477f597d28d172789f06886806bc55\n"
    "# This is a cache of `rtshcua lint`: see https://bford.info/cachedir/. It may be deleted at any time.\n"
)
_SAID: Final = {".gitignore": "*\n", "CACHEDIR.TAG": _TAG}
#: all that stands in the folder: entries of earlier forms too
_OURS: Final = frozenset({*_SAID, "1", _FORM})


class LintCache:
    """Entries by name, in a folder below `root` that is made when the first one is kept; none without a `secret`.

    A `fresh` one gives nothing but what was kept in it during this run.
    """

    def __init__(self, root: Path, folder: str, secret: bytes | None, *, fresh: bool = False) -> None:
        self._root = root
        self._folder = root / folder
        self._place = self._folder / _FORM
        self._secret = secret
        self._works = secret is not None
        self._reads = self._works and not fresh
        self._kept: dict[str, bytes] = {}
        self._prepared = False

    def get(self, name: str) -> bytes | None:
        """An entry as it was kept, or None."""
        if name in self._kept:
            return self._kept[name]
        if not self._reads:
            return None
        try:
            data = read_regular(self._place / name, _LARGEST, self._root)
        except OSError:
            return None
        code, _, entry = data.partition(b"\n")
        return entry if hmac.compare_digest(code, self._code(name, entry)) else None

    def put(self, name: str, entry: bytes) -> None:
        """Keep an entry, if the system lets us; after the first that it does not, no further one is tried."""
        self._kept[name] = entry
        if not self._works or len(entry) + 65 > _LARGEST:
            return
        try:
            self._prepare()
            data = self._code(name, entry) + b"\n" + entry
            replace(self._place / name, data, mode=PRIVATE_FILE, synced=False, root=self._root)
        except OSError:
            self._works = False

    def _code(self, name: str, entry: bytes) -> bytes:
        assert self._secret is not None
        return hmac.digest(self._secret, name.encode() + b"\n" + entry, "sha256").hex().encode()

    def _prepare(self) -> None:
        """Make the folder, and say in it what it is, for git and for backups. Raises OSError for one that has other
        things in it: that is none of ours.
        """
        if self._prepared:
            return
        with suppress(FileNotFoundError), opened_folder(self._folder, self._root) as folder:
            if not _OURS.issuperset(os.listdir(folder)):  # noqa: PTH208  a descriptor, not a path
                raise OSError("no cache")
        make_folder(self._place, root=self._root)
        for name, text in _SAID.items():
            with suppress(FileExistsError):
                write_new(self._folder / name, text.encode(), root=self._root)
        self._prepared = True


def lint_secret(folder: Path) -> bytes | None:
    """The secret that is kept in a folder, made if there is none that its owner alone may read; None where the system
    does not let us.
    """
    place = folder / SECRET
    try:
        found = _read_secret(place)
        if found is None:
            make_folder(folder, mode=PRIVATE_FOLDER)
            replace(place, os.urandom(_SECRET_BYTES), mode=PRIVATE_FILE, synced=False)
            found = _read_secret(place)  # of two that make one at the same time the later
    except OSError:
        return None
    return found


def _read_secret(place: Path) -> bytes | None:
    """The secret; None where it is not there, is no file of ours, may be read by others, or has another length."""
    try:
        with open_regular(place, place.parent) as file:
            foreign = exposed(file) or os.fstat(file.fileno()).st_uid != os.geteuid()
            data = file.read(_SECRET_BYTES + 1)
    except OSError:
        return None
    return data if len(data) == _SECRET_BYTES and not foreign else None
