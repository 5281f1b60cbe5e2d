"""How commands read sources and compile them: the file system, the shipped library and the dialect, put together."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from rtshcua import library
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source
from rtshcua.ground.agent.specification import load_specification
from rtshcua.ground.compiler.program import Compiled, check_program, compile_program
from rtshcua.ground.language.load import Program, load
from rtshcua.ground.language.parse import MAX_SIZE
from rtshcua.mavlink import dialect


class Reading(NamedTuple):
    """A program, and how findings on it are shown to whoever wrote it."""

    program: Program
    pointed: Callable[[Iterable[Diagnostic]], tuple[Diagnostic, ...]]


def read_sources(paths: Sequence[Path]) -> Reading:
    """Sources and all that they import. The first may be a mission specification (.json), as an agent proposes it."""
    first, shipped = paths[0], str(library.root())
    rest = [str(path) for path in paths[1:]]
    if first.suffix.lower() == ".json":
        program, specification = load_specification(str(first), rest, _read, shipped, _listing)
        return Reading(program, specification.pointed)
    return Reading(load([str(first), *rest], _read, shipped, _listing), tuple)


def compile_sources(
    paths: Sequence[Path], *, mission: str | None, issued_at_us: int
) -> tuple[Compiled, Mapping[str, Source]]:
    """Compile the mission in the first of `paths`; gives the sources too, for showing what was found in them."""
    reading = read_sources(paths)
    compiled = compile_program(reading.program, dialect.load(), mission=mission, issued_at_us=issued_at_us)
    return replace(compiled, diagnostics=reading.pointed(compiled.diagnostics)), reading.program.sources


def check_sources(paths: Sequence[Path]) -> tuple[tuple[Diagnostic, ...], Mapping[str, Source]]:
    """Everything that is wrong with `paths` and what they import."""
    reading = read_sources(paths)
    return reading.pointed(check_program(reading.program, dialect.load())), reading.program.sources


def _read(path: str) -> bytes:
    """At most one byte more than the parser takes, so that it is the parser who says that a file is too large."""
    with Path(path).open("rb") as file:
        return file.read(MAX_SIZE + 1)


def _listing(path: str) -> Iterable[str]:
    return [each.name for each in Path(path or ".").iterdir()]
