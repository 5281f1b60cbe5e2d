"""Which files the paths on a command line mean, which of them make programs, which are never written over, and what a
missing name probably meant. It imports no parser.
"""

import os
from collections.abc import Collection, Iterable, Sequence
from itertools import islice
from pathlib import Path
from typing import Final

from rtshcua.adapters.store.checkout import checkout_of, lies_in
from rtshcua.adapters.store.reading import walk
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.suggest import TYPO, likeness
from rtshcua.ground.language.paths import shown

SOURCE, SPECIFICATION = ".rts", ".json"


def source_files(paths: Sequence[Path]) -> tuple[Path, ...] | Refusal:
    """The files that are meant, once each: of a folder all sources below it, but for hidden ones, in order. Raises
    OSError for a folder that cannot be read, lest it is taken to hold none.
    """
    files: dict[str, Path] = {}
    for path in paths:
        below = sorted(_below(path)) if path.is_dir() else [path]
        outside = next((each for each in below if each != path and each.is_symlink() and not _inside(each, path)), None)
        if outside is not None:
            message = f"`{outside}` is a symbolic link that leads out of `{path}` and its checkout"
            return Refusal("outside", message, "name what it leads to, if you know what that is")
        if not below:
            return Refusal("no-source", f"there is no source ({SOURCE}) in `{path}`, nor below it")
        for each in below:
            files.setdefault(shown(str(each)), each)
    specifications = [path for path in files.values() if path.suffix.lower() == SPECIFICATION]
    if len(specifications) > 1 or (specifications and specifications[0] != paths[0]):
        help = "write it first; the sources after it are its policy's"
        return Refusal("usage", "one specification (.json) is checked at a time", help)
    return tuple(files.values())


def _inside(link: Path, folder: Path) -> bool:
    edges = (str(folder), checkout_of(link) or str(folder))
    return any(lies_in(os.path.realpath(link), os.path.realpath(edge)) for edge in edges)


def root_programs(names: Sequence[str], members: Sequence[Collection[str]]) -> tuple[int, ...]:
    """The numbers of the files that make programs of their own: those that no other's program has among its members; of
    those that import each other the first.
    """
    holders: dict[str, list[int]] = {}
    for number, member in enumerate(members):
        for file in member:
            holders.setdefault(file, []).append(number)

    def is_part(number: int) -> bool:
        others = (other for other in holders.get(names[number], ()) if other != number)
        return any(other < number or names[other] not in members[number] for other in others)

    return tuple(number for number in range(len(names)) if not is_part(number))


def _below(folder: Path) -> Iterable[Path]:
    for place, folders, files in walk(folder, every=True):
        folders[:] = [name for name in folders if not name.startswith(".")]
        yield from (Path(place, name) for name in files if name.endswith(SOURCE) and not name.startswith("."))


def overwriting_a_source(target: Path, read: Iterable[str | Path], what: str) -> Refusal | None:
    """Why `what` (a page, a report) cannot be written to a file: it is one of those that are read, by this name or, as
    links are, by another; None where it is not.
    """
    if not target.is_file() or not any(_same(target, Path(each)) for each in read):
        return None
    help = "name a file that nothing is read from"
    return Refusal("output", f"`{target}` is one of the sources, and is not replaced by {what}", help)


def _same(target: Path, other: Path) -> bool:
    try:
        return target.samefile(other)
    except (OSError, ValueError):  # a name that is no path, such as that of a text in memory
        return False


#: so many names of a folder are looked at
MOST_NAMES: Final = 5_000


def missing(path: Path) -> tuple[str, str] | None:
    """A text and a help for a file that is missing: where a folder was given for a log, which lacks one, and where a
    file beside it is called almost alike. None where there is nothing to add.
    """
    from rtshcua.adapters.store.runs import LOG  # its writers take longer to load than files to lint

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
