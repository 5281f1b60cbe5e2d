"""Which programs a change is about."""

import os
from collections.abc import Sequence

from rtshcua import library
from rtshcua.adapters.store.git import GitChanges
from rtshcua.front.cli.linting.examined import Examined


def touched(programs: Sequence[Examined], changed: GitChanges) -> list[Examined]:
    """The programs that read a file that has changed, or one of which no repository that was asked can tell; what was
    installed, such as the library, counts as unchanged.
    """
    known: dict[str, bool | None] = {}

    def touches(name: str, installed: tuple[str, ...]) -> bool:
        if name not in known:
            known[name] = changed.touch(name)
        return known[name] is not False and (known[name] is True or not os.path.realpath(name).startswith(installed))

    found = []
    for program in programs:
        packs = [each for each in program.packs.values() if each is not None]
        installed = tuple(f"{os.path.realpath(each)}{os.sep}" for each in (str(library.root()), *packs))
        if any(touches(name, installed) for name in program.reads):
            found.append(program)
    return found
