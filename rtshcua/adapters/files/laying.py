"""Lays a set of files into a folder: all of them, or none."""

import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from tempfile import mkdtemp
from typing import NamedTuple


class Taken(NamedTuple):
    """Why nothing was laid: these names are taken, by files (`replaceable`), or by what no file can replace."""

    paths: tuple[Path, ...]
    replaceable: bool


def lay(files: Mapping[str, bytes], folder: Path, *, replace: bool = False) -> Taken | None:
    """Write `files`, by their paths below `folder`, which is made where it is missing. None: all of them are there.

    Nothing that is there already is touched, unless `replace`, and then only files of the same names. When anything
    fails, a full disk say, what was laid is taken away again, what was replaced is put back, and OSError rises.
    """
    targets = {folder / name: data for name, data in files.items()}
    blocked = _blocked(targets, folder)
    if blocked:
        return Taken(blocked, replaceable=False)
    taken = tuple(target for target in targets if os.path.lexists(target))
    if taken and not replace:
        return Taken(taken, replaceable=True)
    made: list[Path] = []
    try:
        _make_folders(folder, made)
        staging = Path(mkdtemp(prefix=".rtshcua-init-", dir=folder))
    except OSError:
        _remove_folders(made)
        raise
    try:
        _move_in(targets, folder, staging, made)
    finally:
        shutil.rmtree(staging, ignore_errors=True)
    return None


def _move_in(targets: Mapping[Path, bytes], folder: Path, staging: Path, made: list[Path]) -> None:
    """Writes everything beside its place, and moves it there when the disk has taken all of it."""
    laid: list[Path] = []
    kept: dict[Path, Path] = {}
    try:
        for number, data in enumerate(targets.values()):
            (staging / f"new{number}").write_bytes(data)
        for number, target in enumerate(targets):
            _make_folders(target.parent, made)
            if os.path.lexists(target):
                target.rename(staging / f"old{number}")
                kept[target] = staging / f"old{number}"
            (staging / f"new{number}").rename(target)
            laid.append(target)
    except BaseException:  # Ctrl-C too
        for target in laid:
            target.unlink(missing_ok=True)
        for target, old in kept.items():
            old.rename(target)
        shutil.rmtree(staging, ignore_errors=True)
        _remove_folders(made)
        raise


def _blocked(targets: Mapping[Path, bytes], folder: Path) -> tuple[Path, ...]:
    """What stands where a folder must be, or is a folder where a file must be."""
    above = {parent for target in targets for parent in target.parents}
    places = [place for place in above if os.path.lexists(place) and not place.is_dir()]
    return (*sorted(places), *(target for target in targets if target.is_dir() and not target.is_symlink()))


def _make_folders(folder: Path, made: list[Path]) -> None:
    for each in (*reversed(folder.parents), folder):
        if not each.is_dir():
            each.mkdir()
            made.append(each)


def _remove_folders(made: list[Path]) -> None:
    for each in reversed(made):
        try:
            each.rmdir()
        except OSError:
            return  # somebody put something there
