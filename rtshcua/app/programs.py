"""Sources read, checked and compiled with the shipped library and dialect, and which programs several sources make."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Final, NamedTuple

from rtshcua import library
from rtshcua.adapters.store.reading import open_regular
from rtshcua.adapters.store.source_access import ReadableSources
from rtshcua.app.files import SPECIFICATION, root_programs
from rtshcua.diagnostics.codes import DUPLICATE_NAME
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.diagnostics.span import Source
from rtshcua.ground.elaborate.parameters import parse_settings
from rtshcua.ground.language.load import Program, load
from rtshcua.ground.language.paths import shown
from rtshcua.ground.pipeline.pins import PROPOSED, Pins, policies_of
from rtshcua.ground.pipeline.program import Checked, Compiled, compile_program, examine_program
from rtshcua.ground.prove.step_starts import FROM_HOME, MissionStart
from rtshcua.mavlink import dialect
from rtshcua.wire.names import BUNDLE

NO_TEXTS: Final[Mapping[str, bytes]] = MappingProxyType({})


class Reading(NamedTuple):
    """A program, and how findings on it are shown to whoever wrote it."""

    program: Program
    pointed: Callable[[Iterable[Diagnostic]], tuple[Diagnostic, ...]]


class SourceReader:
    """Reads sources and all that they import, from the disk and the shipped library.

    `asked` are the files that were named. With `once` each file is read once: what changes later does not count.
    """

    def __init__(self, asked: Sequence[Path], *, once: bool = False) -> None:
        self._library = str(library.root())
        self._readable = ReadableSources(self._library, asked)
        self._read = cache(self._readable.read) if once else self._readable.read

    def program(self, names: Sequence[str], texts: Mapping[str, bytes] = NO_TEXTS, pins: Pins = PROPOSED) -> Reading:
        """The program of files, of which the first may be a mission specification (.json), as an agent proposes it:
        what it claims beyond `pins` is a finding. `texts` stand in the place of files, by their shown names.
        """

        def read(name: str) -> bytes:
            text = texts.get(name)
            return self._read(name) if text is None else text

        readable = self._readable
        if Path(names[0]).suffix.lower() == SPECIFICATION:
            from rtshcua.ground.agent.specification import load_specification  # brings pydantic

            program, specification = load_specification(
                names[0], names[1:], read, self._library, readable.listing, readable.pack, pins
            )
            return Reading(program, specification.pointed)
        return Reading(load(names, read, self._library, readable.listing, packs=readable.pack), tuple)


def keep_once(found: dict[tuple[object, ...], Diagnostic], more: Iterable[Diagnostic]) -> None:
    """Add findings to those of other programs: a file that two programs share has its findings once."""
    for each in more:
        found.setdefault((each.code, each.span, each.message), each)


def read_sources(paths: Sequence[Path], pins: Pins = PROPOSED) -> Reading:
    """Sources and all that they import; see `SourceReader.program`."""
    return SourceReader(paths).program([str(path) for path in paths], pins=pins)


def read_text(name: str, text: str) -> Reading:
    """A source that is not written yet, as if it were in the file `name`, and all that it imports."""
    return SourceReader([Path(name)]).program([name], {shown(name): text.encode("utf-8")})


def compile_sources(
    paths: Sequence[Path],
    *,
    mission: str | None,
    issued_at_us: int,
    values: Sequence[str] = (),
    pins: Pins | None = None,
) -> tuple[Compiled, Mapping[str, Source]]:
    """Compile the mission in the first of `paths`; gives the sources too, for showing what was found in them.

    `values` are those of the mission's parameters, `name=value` each. With `pins` it is to be signed: what it claims
    beyond them is a finding; the source of a specification is `agent` where they do not name one, and its policy is one
    of those in the sources after the first.
    """
    given = pins
    if paths[0].suffix.lower() == ".json":
        given = PROPOSED if pins is None else pins._replace(source=pins.source or PROPOSED.source)
    reading = read_sources(paths, given or PROPOSED)
    if pins is not None and given is not None and given is not pins and pins.policies is None:
        named = frozenset(shown(str(path)) for path in paths[1:])
        given = given._replace(policies=policies_of(reading.program, named))
    compiled = compile_reading(reading, mission=mission, issued_at_us=issued_at_us, values=values, pins=given)
    return compiled, compiled.sources


def compile_reading(
    reading: Reading, *, mission: str | None, issued_at_us: int, values: Sequence[str] = (), pins: Pins | None = None,
    start: MissionStart = FROM_HOME,
) -> Compiled:  # fmt: skip
    """Compile a mission of the first file of a program that was read; see `compile_sources`, proved from `start`."""
    settings = parse_settings(values)
    compiled = compile_program(
        reading.program, dialect.load(), mission=mission, issued_at_us=issued_at_us, settings=settings, pins=pins,
        start=start,
    )  # fmt: skip
    return replace(compiled, diagnostics=reading.pointed(compiled.diagnostics))


def examine(reading: Reading, issued_at_us: int = 0) -> Checked:
    """Everything that is wrong with a program, and what its missions take at most."""
    checked = examine_program(reading.program, dialect.load(), issued_at_us)
    return replace(checked, diagnostics=reading.pointed(checked.diagnostics))


def meant(found: Iterable[Diagnostic], sources: Mapping[str, Source], given: Sequence[Path]) -> tuple[Diagnostic, ...]:
    """Findings of a mission with what was handed in beside it: where both declare one name, say which is meant how."""
    beside = {shown(str(path)): path for path in given[1:]}
    return tuple(_which(each, sources, beside, given[0]) for each in found)


def _which(found: Diagnostic, sources: Mapping[str, Source], beside: Mapping[str, Path], mission: Path) -> Diagnostic:
    files = [found.span.file if found.span else "", *(label.span.file for label in found.labels)]
    own = next((each for each in files if each in beside), None)
    other = next((each for each in files if each not in beside), None)
    if found.code is not DUPLICATE_NAME or own is None or not other:
        return found
    alike = other in sources and own in sources and sources[own].text == sources[other].text
    what = f"`{own}` is a copy of `{other}`" if alike else f"`{own}` is not what `{mission}` imports"
    help = f"{what}: leave out `--with {own}` if `{other}` is meant; else take that out of the imports of `{mission}`"
    return replace(found, help=help)


def no_source(path: Path) -> Refusal | None:
    """Why a path cannot be the source of a mission: it is a folder, or a compiled bundle, of whatever version. None
    where it may be one, and where it cannot be read, which is told of where it is read.
    """
    if path.is_dir():
        return Refusal("no-source", f"`{path}` is a folder, and no source", "name the file with the mission")
    try:
        with open_regular(path) as file:
            compiled = BUNDLE.name.encode() in file.read(2 * len(BUNDLE.name))
    except OSError:
        return None
    help = "give the source that it was compiled from (.rts), or the specification (.json)"
    return Refusal("usage", f"`{path}` is a bundle, and no source", help) if compiled else None


class RootProgram(NamedTuple):
    """One program, the name of its first file, and all files that were asked for."""

    name: str
    reading: Reading
    asked: frozenset[str]


def programs(files: Sequence[Path], further: Sequence[Path] = ()) -> tuple[RootProgram, ...]:
    """The programs that files make: each by itself, with what it imports and what `further` brings.

    So two missions under one policy do not clash, whatever they call their parts. A file that another of them imports
    is checked in that one's program, and makes none of its own. After a specification all are part of its program.
    """
    names = [shown(str(path)) for path in files]
    asked = frozenset(names)
    if files[0].suffix.lower() == SPECIFICATION:
        return (RootProgram(names[0], read_sources([*files, *further]), asked),)
    made = [RootProgram(name, read_sources([path, *further]), asked) for name, path in zip(names, files, strict=True)]
    members = [frozenset(unit.file for unit in each.reading.program.units) for each in made]
    return tuple(made[number] for number in root_programs(names, members))
