"""Load, check, prove and lint programs. Importing this module imports the whole compiler."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Protocol

from rtshcua import library
from rtshcua.app.lint.cache import LintedProgram, ProgramFindings
from rtshcua.diagnostics.diagnostic import Diagnostic, has_errors
from rtshcua.ground.language.load import Program, load
from rtshcua.ground.lint.linter import lint
from rtshcua.ground.pipeline.program import examine_program
from rtshcua.mavlink import dialect


class SourceFiles(Protocol):
    """Access to sources and their digests: a `session.LintSession`."""

    def read(self, name: str) -> bytes:
        """Return the bytes of a source. Raises OSError, and ValueError for an invalid name."""
        ...

    def digest(self, name: str) -> str | None:
        """Return the digest of a source, or None if it cannot be read."""
        ...

    def folder(self, pack: str) -> str | None:
        """Return the folder of an installed pack, or None."""
        ...

    def listing(self, name: str) -> list[str]:
        """Return the names in a folder, for suggestions. Raises OSError."""
        ...


class Examiner:
    """Loads and checks the programs of one run, each file once."""

    def __init__(self, session: SourceFiles, asked: Mapping[str, int | None]) -> None:
        self._session = session
        self._asked = asked
        self._programs: dict[Path, tuple[Program, _Reads]] = {}

    def loaded(self, path: Path, further: Sequence[Path]) -> LintedProgram:
        """Load the program of a file without checking it."""
        program, reads = self._load(path, further)
        return reads.examined(program, self._asked, None)

    def examined(self, wanted: Sequence[tuple[Path, Sequence[Path]]]) -> list[LintedProgram]:
        """Load and check the programs of files."""
        done = []
        for path, further in wanted:
            program, reads = self._load(path, further)
            done.append(reads.examined(program, self._asked, find(program, self._asked)))
        return done

    def _load(self, path: Path, further: Sequence[Path]) -> "tuple[Program, _Reads]":
        found = self._programs.get(path)
        if found is None:
            reads = _Reads(self._session)
            names = [str(path), *map(str, further)]
            program = load(names, reads.read, str(library.root()), self._session.listing, packs=reads.folder)
            found = self._programs[path] = program, reads
        return found


class _Reads:
    """Records the files and packs that were read for one program."""

    def __init__(self, session: SourceFiles) -> None:
        self._session = session
        self._names: dict[str, str | None] = {}
        self._packs: dict[str, str | None] = {}

    def read(self, name: str) -> bytes:
        self._names[name] = self._session.digest(name)
        return self._session.read(name)

    def folder(self, pack: str) -> str | None:
        self._packs[pack] = self._session.folder(pack)
        return self._packs[pack]

    def examined(
        self, program: Program, asked: Mapping[str, int | None], result: ProgramFindings | None
    ) -> LintedProgram:
        members = tuple(unit.file for unit in program.units)
        mine = {name: asked[name] for name in members if name in asked}
        return LintedProgram(members, self._names, self._packs, mine, result)


def examine_specification(
    session: SourceFiles, files: Sequence[Path], further: Sequence[Path], asked: Mapping[str, int | None]
) -> LintedProgram:
    """Check a mission specification and the sources of its policy as one program."""
    from rtshcua.ground.agent.specification import load_specification

    reads = _Reads(session)
    rest = [str(path) for path in (*files[1:], *further)]
    program, read = load_specification(
        str(files[0]), rest, reads.read, str(library.root()), session.listing, reads.folder
    )
    return reads.examined(program, asked, find(program, asked, read.pointed))


def find(
    program: Program,
    asked: Mapping[str, int | None],
    pointed: Callable[[Iterable[Diagnostic]], tuple[Diagnostic, ...]] = tuple,
) -> ProgramFindings:
    """Return the findings of a program. If it has no errors, also lint the files in `asked`.

    The value of a file in `asked` is its line width if its layout is checked, else None.
    """
    checked = examine_program(program, dialect.load())
    found = pointed(checked.diagnostics)
    if has_errors(found):
        return ProgramFindings(found, ())
    return ProgramFindings(found, (*lint(program, asked, checked.grounds), *_layouts(program, asked)))


def _layouts(program: Program, asked: Mapping[str, int | None]) -> Iterator[Diagnostic]:
    """Yield a finding for each file whose layout is checked and differs from the formatter's output."""
    for unit in program.units:
        width = asked.get(unit.file)
        if width is not None:
            from rtshcua.ground.format.format import formatted
            from rtshcua.ground.format.format_text import not_formatted

            source = program.sources[unit.file]
            text = formatted(source, width).text
            found = None if text is None else not_formatted(source, text)
            if found is not None:
                yield found
