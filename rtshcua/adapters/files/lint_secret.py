"""The secret that what `lint` remembers is authenticated with: 32 random octets of a user, outside of any checkout.

Whoever may write to a checkout (a pull request, an archive, another user) may write to the cache in it. Without the
secret nothing that they write there is believed. It guards nothing else, so one that was lost is made anew: the cache
is cold for one run.
"""

import os
from pathlib import Path
from typing import Final

from rtshcua.adapters.store.folders import PRIVATE_FOLDER, make_folder
from rtshcua.adapters.store.reading import exposed, open_regular
from rtshcua.adapters.store.writing import PRIVATE_FILE, replace

NAME: Final = "lint.secret"
_BYTES: Final = 32


def lint_secret(folder: Path) -> bytes | None:
    """The secret that is kept in a folder, made if there is none that its owner alone may read; None where the system
    does not let us.
    """
    place = folder / NAME
    try:
        found = _read(place)
        if found is None:
            make_folder(folder, mode=PRIVATE_FOLDER)
            replace(place, os.urandom(_BYTES), mode=PRIVATE_FILE, synced=False)
            found = _read(place)  # of two that make one at the same time the later
    except OSError:
        return None
    return found


def _read(place: Path) -> bytes | None:
    """The secret; None where it is not there, is no file of ours, may be read by others, or has another length."""
    try:
        with open_regular(place, place.parent) as file:
            foreign = exposed(file) or os.fstat(file.fileno()).st_uid != os.geteuid()
            data = file.read(_BYTES + 1)
    except OSError:
        return None
    return data if len(data) == _BYTES and not foreign else None
