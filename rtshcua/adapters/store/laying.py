"""Write sets of files completely or not at all."""

import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import mkdtemp
from typing import NamedTuple

from rtshcua.adapters.store.writing import PUBLIC_FOLDER, UNFINISHED, sync_folder
from rtshcua.adapters.store.writing import replace as put


class Taken(NamedTuple):
    """Why nothing was written: these names are taken, by files (`replaceable`) or by something that no file can
    replace.
    """

    paths: tuple[Path, ...]
    replaceable: bool


@contextmanager
def appearing(folder: Path) -> Iterator[Path]:
    """A folder that only its owner may look into; it takes its place once it is filled, and is removed on failure."""
    fresh = Path(mkdtemp(prefix=UNFINISHED, dir=folder.parent))  # mode 0700
    try:
        yield fresh
        sync_folder(fresh)
        fresh.rename(folder)
        sync_folder(folder.parent)
    finally:
        shutil.rmtree(fresh, ignore_errors=True)


def lay(files: Mapping[str, bytes], folder: Path, *, replace: bool = False) -> Taken | None:
    """Write `files`, by their paths below `folder`, which is made if missing. None: all of them are written.

    Existing files are left alone, unless `replace`, and then only files of the same names are replaced. On any failure,
    such as a full disk, written files are removed, replaced ones are restored, and OSError is raised.
    """
    targets = {folder / name: data for name, data in files.items()}
    blocked = _blocked(targets, folder)
    if blocked:
        return Taken(blocked, replaceable=False)
    taken = tuple(target for target in targets if os.path.lexists(target))
    if taken and not replace:
        return Taken(taken, replaceable=True)
    with ExitStack() as undo:  # also on Ctrl-C
        for target in targets:
            _make_folders(target.parent, undo)
        aside = Path(mkdtemp(prefix=UNFINISHED, dir=folder))
        undo.callback(shutil.rmtree, aside, ignore_errors=True)
        for number, (target, data) in enumerate(targets.items()):
            if target in taken:
                undo.callback(_put_back, aside / str(number), target)
                target.rename(aside / str(number))
            else:
                undo.callback(target.unlink, missing_ok=True)
            put(target, data, synced=False)
        undo.pop_all()
    shutil.rmtree(aside, ignore_errors=True)
    return None


def _blocked(targets: Mapping[Path, bytes], folder: Path) -> tuple[Path, ...]:
    """Files where a folder must be, and folders where a file must be."""
    above = {parent for target in targets for parent in target.parents}
    places = [place for place in above if os.path.lexists(place) and not place.is_dir()]
    return (*sorted(places), *(target for target in targets if target.is_dir() and not target.is_symlink()))


def _make_folders(folder: Path, undo: ExitStack) -> None:
    for each in (*reversed(folder.parents), folder):
        if not each.is_dir():
            each.mkdir(PUBLIC_FOLDER)
            undo.callback(_remove, each)


def _remove(folder: Path) -> None:
    with suppress(OSError):  # another program put something there
        folder.rmdir()


def _put_back(old: Path, target: Path) -> None:
    with suppress(FileNotFoundError):  # it was never moved away
        old.rename(target)
