"""Several sources at once: which programs they make."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from rtshcua.front.cli.asked import SPECIFICATION as SPECIFICATION
from rtshcua.front.cli.asked import roots
from rtshcua.front.cli.asked import unfolded as unfolded
from rtshcua.front.cli.sources import Reading, read_sources
from rtshcua.ground.language.paths import shown


class Asked(NamedTuple):
    """One program, the name of its first file, and all files that were asked for."""

    name: str
    reading: Reading
    asked: frozenset[str]


def programs(files: Sequence[Path], further: Sequence[Path] = ()) -> tuple[Asked, ...]:
    """The programs that files make: each by itself, with what it imports and what `further` brings.

    So two missions under one policy do not clash, whatever they call their parts. A file that another of them imports
    is checked in that one's program, and makes none of its own. After a specification all are part of its program.
    """
    names = [shown(str(path)) for path in files]
    asked = frozenset(names)
    if files[0].suffix.lower() == SPECIFICATION:
        return (Asked(names[0], read_sources([*files, *further]), asked),)
    made = [Asked(name, read_sources([path, *further]), asked) for name, path in zip(names, files, strict=True)]
    members = [frozenset(unit.file for unit in each.reading.program.units) for each in made]
    return tuple(made[number] for number in roots(names, members))
