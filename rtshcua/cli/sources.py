"""How commands read sources and compile them: the file system, the shipped library and the dialect, put together."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from rtshcua import library
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source
from rtshcua.ground.compiler.program import Compiled, check_program, compile_program
from rtshcua.ground.language.load import Program, load
from rtshcua.ground.language.parse import MAX_SIZE
from rtshcua.mavlink import dialect


def read_program(paths: Sequence[Path]) -> Program:
    """Sources and all that they import."""
    return load([str(path) for path in paths], _read, str(library.root()), _listing)


def compile_sources(
    paths: Sequence[Path], *, mission: str | None, issued_at_us: int
) -> tuple[Compiled, Mapping[str, Source]]:
    """Compile the mission in the first of `paths`; gives the sources too, for showing what was found in them."""
    program = read_program(paths)
    return compile_program(program, dialect.load(), mission=mission, issued_at_us=issued_at_us), program.sources


def check_sources(paths: Sequence[Path]) -> tuple[tuple[Diagnostic, ...], Mapping[str, Source]]:
    """Everything that is wrong with `paths` and what they import."""
    program = read_program(paths)
    return check_program(program, dialect.load()), program.sources


def _read(path: str) -> bytes:
    """At most one byte more than the parser takes, so that it is the parser who says that a file is too large."""
    with Path(path).open("rb") as file:
        return file.read(MAX_SIZE + 1)


def _listing(path: str) -> Iterable[str]:
    return [each.name for each in Path(path or ".").iterdir()]
