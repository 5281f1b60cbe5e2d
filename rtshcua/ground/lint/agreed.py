"""What several programs that share files agree on."""

from collections.abc import Sequence
from typing import NamedTuple

from rtshcua.diagnostics.diagnostic import Diagnostic


class Linted(NamedTuple):
    """The files of one program, and what was found in them."""

    files: frozenset[str]
    found: tuple[Diagnostic, ...]


def agreed(programs: Sequence[Linted]) -> tuple[Diagnostic, ...]:
    """What is found in a file by every program that it is part of: what one of them uses is used."""
    counts: dict[Diagnostic, int] = {}
    for program in programs:
        for found in program.found:
            counts[found] = counts.get(found, 0) + 1
    if not counts:
        return ()
    members: dict[str, int] = {}
    for program in programs:
        for file in program.files:
            members[file] = members.get(file, 0) + 1
    return tuple(
        found for found, count in counts.items() if found.span is not None and count == members[found.span.file]
    )
