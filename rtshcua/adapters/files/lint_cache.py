"""What `lint` remembers from run to run: one file an entry, in a folder that may be deleted at any time.

The folder lies in a checkout, where others may write too, so each entry bears a code (HMAC-SHA256, RFC 2104) over its
name and its content under a secret of this user (`lint_secret`). One that was cut, moved, half written, or made by
anybody else is no entry. It is written beside its place and moved there, so that runs at the same time read either the
old one or the new one. Whatever cannot be read or written is as if it were not there: a cache is never a reason to
fail. Nothing is followed or written through a link, and a folder that is there and is no cache is left alone.
"""

import hmac
import os
import stat
from contextlib import suppress
from pathlib import Path
from tempfile import mkstemp
from typing import Final

FOLDER: Final = ".rtshcua_cache"
#: of the form of entries; what has another is not looked at
_FORM: Final = "2"
_LARGEST: Final = 16 << 20
_TAG: Final = (
    "Signature: 8a477f597d28d172789f06886806bc55\n"
    "# This is a cache of `rtshcua lint`: see https://bford.info/cachedir/. It may be deleted at any time.\n"
)
_SAID: Final = {".gitignore": "*\n", "CACHEDIR.TAG": _TAG}
#: all that stands in the folder: entries of earlier forms too
_OURS: Final = frozenset({*_SAID, "1", _FORM})
_PLAIN: Final = getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
_READ: Final = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | _PLAIN
_NEW: Final = os.O_WRONLY | os.O_CREAT | os.O_EXCL | _PLAIN


class LintCache:
    """Entries by name, in a folder that is made when the first one is kept; none without a `secret`.

    A `fresh` one gives nothing but what was kept in it during this run.
    """

    def __init__(self, folder: Path, secret: bytes | None, *, fresh: bool = False) -> None:
        self._folder = folder
        self._place = folder / _FORM
        self._secret = secret
        self._works = secret is not None and not _is_link(folder) and not _is_link(self._place)
        self._reads = self._works and not fresh
        self._kept: dict[str, bytes] = {}
        self._prepared = False

    def get(self, name: str) -> bytes | None:
        """An entry as it was kept, or None."""
        if name in self._kept:
            return self._kept[name]
        data = _read(self._place / name) if self._reads else None
        if data is None:
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
            handle, made = mkstemp(dir=self._place, prefix=".")
        except OSError:
            self._works = False
            return
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(self._code(name, entry) + b"\n" + entry)
            Path(made).replace(self._place / name)
        except OSError:
            self._works = False
            with suppress(OSError):
                Path(made).unlink()

    def _code(self, name: str, entry: bytes) -> bytes:
        assert self._secret is not None
        return hmac.digest(self._secret, name.encode() + b"\n" + entry, "sha256").hex().encode()

    def _prepare(self) -> None:
        """Make the folder, and say in it what it is, for git and for backups. Raises OSError for one that has other
        things in it: that is none of ours.
        """
        if self._prepared:
            return
        with suppress(FileNotFoundError):
            if not _OURS.issuperset(each.name for each in self._folder.iterdir()):
                raise OSError("no cache")
        self._place.mkdir(parents=True, exist_ok=True)
        for name, text in _SAID.items():
            with suppress(FileExistsError):
                handle = os.open(self._folder / name, _NEW, 0o644)
                with os.fdopen(handle, "w", encoding="utf-8") as file:
                    file.write(text)
        self._prepared = True


def _is_link(path: Path) -> bool:
    """Whether a path is a link; also where nobody can tell."""
    try:
        return stat.S_ISLNK(os.lstat(path).st_mode)
    except FileNotFoundError:
        return False
    except (OSError, ValueError):
        return True


def _read(path: Path) -> bytes | None:
    """What a regular file holds, that is no link; None where it is none, or cannot be read."""
    try:
        handle = os.open(path, _READ)
    except (OSError, ValueError):
        return None
    try:
        known = os.fstat(handle)
        if not stat.S_ISREG(known.st_mode) or known.st_size > _LARGEST:
            return None
        with open(handle, "rb", buffering=0, closefd=False) as file:
            return file.read(_LARGEST)
    except OSError:
        return None
    finally:
        os.close(handle)
