"""Find the sources and programs for the paths on a command line, protect sources from being overwritten, and suggest
names for missing files. Imports no parser, to start fast.
"""

import os
from codecs import BOM_UTF8
from collections.abc import Collection, Iterable, Sequence
from itertools import islice
from pathlib import Path
from typing import Final

from rtshcua.adapters.store.checkout import checkout_of, lies_in
from rtshcua.adapters.store.reading import open_regular, walk
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.suggest import TYPO, likeness
from rtshcua.ground.language.paths import shown

SOURCE, SPECIFICATION = ".rts", ".json"


def source_files(paths: Sequence[Path]) -> tuple[Path, ...] | Refusal:
    """The files for the paths, each once. A folder stands for all sources below it except hidden ones, in order. Raises
    OSError for a folder that cannot be read.
    """
    files: dict[str, Path] = {}
    for path in paths:
        below = sorted(_below(path)) if path.is_dir() else [path]
        outside = next((each for each in below if each != path and each.is_symlink() and not _inside(each, path)), None)
        if outside is not None:
            message = f"`{outside}` is a symbolic link that leads out of `{path}` and its checkout"
            return Refusal("outside", message, "name the target of the link if you trust it")
        if not below:
            return Refusal("no-source", f"there is no source ({SOURCE}) in or below `{path}`")
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
    """The indexes of the files that are roots of programs: those that are not a member of another file's program. Of
    files that import each other only the first is a root.
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
    """The refusal if `target` is one of the files in `read`, also under another name through a link; else None. `what`
    is a page or a report.
    """
    if not target.is_file() or not any(_same(target, Path(each)) for each in read):
        return None
    help = "name a file that is not a source"
    return Refusal("output", f"`{target}` is one of the sources, and is not overwritten by {what}", help)


#: how the files begin that a page, or a picture, may replace, in lower case
PAGES: Final = (b"<!doctype html", b"<html")
PICTURES: Final = (b"<?xml", b"<svg")
_MOST_BLANK: Final = 256


def overwriting_another(target: Path, begins: tuple[bytes, ...], what: str) -> Refusal | None:
    """The refusal if `target` is a file that is neither empty nor of the kind to be written, by how it begins; else
    None, also for a symbolic link, which is replaced itself. Raises OSError.
    """
    if target.is_symlink() or not target.is_file():
        return None
    with open_regular(target) as file:
        head = file.read(_MOST_BLANK)
    if not head or head.removeprefix(BOM_UTF8).lstrip().lower().startswith(begins):
        return None
    return Refusal(
        "output", f"`{target}` is not {what}, and is not overwritten by one", "name another file, or move it"
    )


def _same(target: Path, other: Path) -> bool:
    try:
        return target.samefile(other)
    except (OSError, ValueError):  # not a path, such as the name of a text in memory
        return False


#: the most names of a folder that are compared
MOST_NAMES: Final = 5_000


def missing(path: Path) -> tuple[str, str] | None:
    """The text and the help for a missing file: a run folder without a log, or a similar name in the same folder. None
    if there is no suggestion.
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
