"""All rules over one program, and what several programs that share files agree on."""

from collections.abc import Collection, Iterable, Sequence
from typing import NamedTuple

from rtshcua.diagnostics.diagnostic import Diagnostic, has_errors
from rtshcua.diagnostics.span import Span
from rtshcua.ground.language.load import Program
from rtshcua.ground.lint import authority, imports, naming, numbers, unused
from rtshcua.ground.lint.subject import Subject

RULES = (unused, naming, authority, numbers, imports)


class Linted(NamedTuple):
    """The files of one program, and what was found in them."""

    files: frozenset[str]
    found: tuple[Diagnostic, ...]


def lint(program: Program, asked: Collection[str] | None = None) -> tuple[Diagnostic, ...]:
    """What is worth a second look in the files `asked` for (None: the first), by place.

    Nothing of a program that could not be read without errors, for what has an error may be what uses the rest.
    """
    if has_errors(program.diagnostics) or not program.units:
        return ()
    subject = Subject.of(program, {program.units[0].file} if asked is None else asked)
    return _by_place(found for rule in RULES for found in rule.check(subject))


def agreed(programs: Sequence[Linted]) -> tuple[Diagnostic, ...]:
    """What is found in a file by every program that it is part of: what one of them uses is used."""
    counts: dict[Diagnostic, int] = {}
    for program in programs:
        for found in program.found:
            counts[found] = counts.get(found, 0) + 1
    members: dict[str, int] = {}
    for program in programs:
        for file in program.files:
            members[file] = members.get(file, 0) + 1
    return tuple(found for found, count in counts.items() if count == members[_place(found).file])


def _by_place(found: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    return tuple(sorted(found, key=_place))


def _place(found: Diagnostic) -> Span:
    assert found.span is not None
    return found.span
