"""Several sources at once: which files are meant, and which programs they make."""

import os
from collections.abc import Iterable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from rtshcua.cli.sources import Reading, read_sources
from rtshcua.diagnostics.exits import ExitCode
from rtshcua.ground.language.parse import parse
from rtshcua.ground.language.paths import shown

SOURCE, SPECIFICATION = ".rts", ".json"


class Unusable(NamedTuple):
    """Why a command ends before it begins, as `Findings.refuse` takes it."""

    code: ExitCode
    slug: str
    message: str
    help: str | None = None


class Asked(NamedTuple):
    """One program, the name of its first file, and all files that were asked for."""

    name: str
    reading: Reading
    asked: frozenset[str]


def unfolded(paths: Sequence[Path]) -> tuple[Path, ...] | Unusable:
    """The files that are meant, once each: of a folder all sources below it, but for hidden ones, in order."""
    files: dict[str, Path] = {}
    for path in paths:
        below = sorted(_below(path)) if path.is_dir() else [path]
        if not below:
            return Unusable(ExitCode.INPUT, "no-source", f"there is no source ({SOURCE}) in `{path}`, nor below it")
        for each in below:
            files.setdefault(shown(str(each)), each)
    specifications = [path for path in files.values() if path.suffix.lower() == SPECIFICATION]
    if len(specifications) > 1 or (specifications and specifications[0] != paths[0]):
        help = "write it first; the sources after it are its policy's"
        return Unusable(ExitCode.USAGE, "usage", "one specification (.json) is checked at a time", help)
    return tuple(files.values())


def programs(files: Sequence[Path], further: Sequence[Path] = ()) -> tuple[Asked, ...]:
    """The programs that files make: each by itself, with what it imports and what `further` brings.

    So two missions under one policy do not clash, whatever they call their parts. A file that another of them imports
    is checked in that one's program, and makes none of its own. After a specification all are part of its program.
    """
    names = [shown(str(path)) for path in files]
    asked = frozenset(names)
    if files[0].suffix.lower() == SPECIFICATION:
        return (Asked(names[0], read_sources([*files, *further]), asked),)
    remembering = lru_cache(maxsize=None)(parse)
    made = [
        Asked(name, read_sources([path, *further], remembering), asked) for name, path in zip(names, files, strict=True)
    ]
    members = [frozenset(unit.file for unit in each.reading.program.units) for each in made]
    holders: dict[str, list[int]] = {}
    for number, member in enumerate(members):
        for file in member:
            holders.setdefault(file, []).append(number)

    def is_part(number: int) -> bool:
        """Whether another program has it; of those that import each other the first stays."""
        others = (other for other in holders.get(names[number], ()) if other != number)
        return any(other < number or names[other] not in members[number] for other in others)

    return tuple(each for number, each in enumerate(made) if not is_part(number))


def _below(folder: Path) -> Iterable[Path]:
    for place, folders, files in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".")]
        yield from (Path(place, name) for name in files if name.endswith(SOURCE) and not name.startswith("."))
