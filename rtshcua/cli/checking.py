"""What is found in several programs, together."""

from collections.abc import Iterable
from typing import NamedTuple

from rtshcua.cli.earlier import Earlier
from rtshcua.cli.programs import Asked
from rtshcua.cli.sources import examine
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source
from rtshcua.ground.compiler.bounds import Bounds
from rtshcua.ground.versions.raised import Compared, compare


class Mission(NamedTuple):
    """What a mission takes at most, and the file that it stands in."""

    name: str
    file: str
    bounds: Bounds


class Found(NamedTuple):
    """Everything that was found, each thing once; of what is free of errors its bounds and versions."""

    diagnostics: tuple[Diagnostic, ...]
    sources: dict[str, Source]
    missions: tuple[Mission, ...]
    versions: tuple[Compared, ...]


def check_all(asked: Iterable[Asked], earlier: Earlier) -> Found:
    """Check programs, one after the other, and hold their policies against earlier ones."""
    found: dict[tuple[object, ...], Diagnostic] = {}
    sources: dict[str, Source] = {}
    missions: dict[tuple[str, str], Mission] = {}
    versions: dict[Compared, None] = {}
    for each in asked:
        program = each.reading.program
        checked = examine(each.reading)
        sources |= program.sources
        compared = compare(checked.policies, earlier.policies, earlier.name, program.sources)
        versions |= dict.fromkeys(compared)
        wrong = [*checked.diagnostics, *(one.finding for one in compared if one.finding is not None)]
        for diagnostic in wrong:  # a file that two programs share has its findings once
            found.setdefault((diagnostic.code, diagnostic.span, diagnostic.message), diagnostic)
        files = {mission.name.text: unit.file for unit in program.units for mission in unit.missions}
        for name, bounds in checked.bounds.items():
            missions.setdefault((files[name], name), Mission(name, files[name], bounds))
    return Found(tuple(found.values()), sources, tuple(missions.values()), tuple(versions))
