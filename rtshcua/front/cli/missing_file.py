"""What was probably meant by the name of a file that is not there."""

import os
from itertools import islice
from pathlib import Path
from typing import Final

from rtshcua.adapters.store.runs import LOG
from rtshcua.diagnostics.suggest import TYPO, likeness

#: so many names of a folder are looked at
MOST_NAMES: Final = 5_000


def missing(path: Path) -> tuple[str, str] | None:
    """A text and a help for a file that is missing: where a folder was given for a log, which lacks one, and where a
    file beside it is called almost alike. None where there is nothing to add.
    """
    if path.name == LOG and path.parent.is_dir():
        return f"there is no `{LOG}` in the folder `{path.parent}`", "name a file, or the folder of one run"
    try:
        with os.scandir(path.parent) as found:
            names = [each.name for each in islice(found, MOST_NAMES) if each.name != path.name]
    except OSError:
        return None
    near = max(names, key=lambda name: likeness(path.name, name), default="")
    if likeness(path.name, near) < TYPO:
        return None
    return f"no such file or directory: `{path}`", f"did you mean `{path.parent / near}`?"
