"""Load files and their imports. This module reads no files: the caller passes `read` and `listing`.

An import names a file relative to the importing one, in the library that ships with the compiler
(`lib:skills/goto.rts`), or in an installed pack (`acme:skills/spray.rts`); so does a zone read from GeoJSON.
Declarations have no order and each file is read once, so an import cycle is only a warning.
"""

import posixpath
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

from rtshcua.diagnostics.codes import IMPORT_CYCLE
from rtshcua.diagnostics.diagnostic import Diagnostic, Label
from rtshcua.diagnostics.span import Source
from rtshcua.diagnostics.suggest import nearest
from rtshcua.ground.language.file_findings import (
    MAX_FILES,
    MAX_SIZE,
    Wanted,
    data_not_text,
    is_missing,
    no_source,
    not_portable,
    not_text,
    too_large,
    too_many_files,
    unreadable,
)
from rtshcua.ground.language.parse import Parsed, parse
from rtshcua.ground.language.paths import LIBRARY, Packs, imported, shown, stable
from rtshcua.model.ir.places import GeoJson
from rtshcua.model.ir.program import Import, Unit

NAMED = 12  # the most files of a cycle that a message names


class ImportEdge(NamedTuple):
    """An import of the file `to` by the declaration `by`."""

    by: Import
    to: str


def circles(files: Iterable[str], imports: Mapping[str, Sequence[ImportEdge]]) -> list[Diagnostic]:
    """Return a finding for each import that closes a cycle, in a depth-first walk in source order."""
    found: list[Diagnostic] = []
    done: set[str] = set()
    for file in files:
        if file not in done:
            _walk(file, imports, done, found)
    return found


def _walk(first: str, imports: Mapping[str, Sequence[ImportEdge]], done: set[str], found: list[Diagnostic]) -> None:
    path = [first]
    places = {first: 0}  # in `path`
    taken: list[ImportEdge] = []  # from each file of `path` to the next
    waiting = [iter(imports.get(first, ()))]
    while waiting:
        edge = next(waiting[-1], None)
        if edge is None:
            waiting.pop()
            done.add(path[-1])
            del places[path.pop()], taken[-1:]
        elif edge.to in places:
            start = places[edge.to]
            found.append(_circle(path[start:], taken[start:], edge))
        elif edge.to not in done:
            places[edge.to] = len(path)
            path.append(edge.to)
            taken.append(edge)
            waiting.append(iter(imports.get(edge.to, ())))


def _circle(files: list[str], taken: list[ImportEdge], last: ImportEdge) -> Diagnostic:
    names = [*files, last.to]
    if len(names) > NAMED:
        half = NAMED // 2
        names[half:-half] = [f"({len(names) - NAMED} more)"]
    return Diagnostic(
        IMPORT_CYCLE,
        f"import cycle: `{' -> '.join(names)}`",
        last.by.span,
        "move the shared declarations into a file that imports none of these"
        if len(files) > 1
        else "remove the import: a file sees its own declarations",
        labels=tuple(Label(edge.by.span, "part of the cycle") for edge in taken[:NAMED]),
    )


#: the suffixes of sources and of zone files; an import reads no other files
_SOURCES, _DATA = (".rts",), (".geojson", ".json")

#: the most missing files for which a similar name is suggested
_SUGGESTED = 100

Read = Callable[[str], bytes]
Listing = Callable[[str], Iterable[str]]


@dataclass(frozen=True, slots=True)
class Program:
    """The loaded files and their imports, in the order in which they were reached.

    The name of a file is its path, relative to the working folder if it is inside. `sources` has every source that was
    read, `broken` the names of declarations with an error. `stable` gives each file the name that is signed, which is
    the same on every machine: `lib:skills/goto.rts` in the library, likewise in a pack, else relative to the folder of
    the first file.

    `data` has the bytes of the zone files, checked to be UTF-8 only; `stable` has their names too. `data_names` maps a
    source and the path of its `from "..."` to the name of the file. A file that could not be read has a finding and is
    in neither.

    `whole` is false if an import has a syntax error: a name may then be declared in a file that was not read.
    """

    units: tuple[Unit, ...]
    sources: dict[str, Source]
    diagnostics: tuple[Diagnostic, ...]
    broken: frozenset[str]
    stable: dict[str, str]
    data: dict[str, bytes] = field(default_factory=dict)
    data_names: dict[tuple[str, str], str] = field(default_factory=dict)
    whole: bool = True


@lru_cache(maxsize=1024)
def remembered(source: Source) -> Parsed:
    """Parse a text once for all programs that share it."""
    return parse(source)


def no_packs(_name: str) -> str | None:
    """Find no pack: only the library is installed."""
    return None


def load(
    paths: Sequence[str],
    read: Read,
    library: str | None = None,
    listing: Listing | None = None,
    parse: Callable[[Source], Parsed] = remembered,
    packs: Packs = no_packs,
) -> Program:
    """Load `paths` and their imports, each file once.

    `read(path)` returns a file's bytes or raises OSError. `library` is the folder of `lib:`, and `packs` finds those of
    other packs. `listing(path)` returns the names in a folder, for suggestions, and may raise OSError. `parse` is
    `parse.parse` or a cached one. Every fault of a file is a finding, never an exception; a fault of a file in `paths`
    itself has no span.
    """
    folders = {} if library is None else {LIBRARY.removesuffix(":"): library}
    loader = _Loader(read, packs, folders, listing, parse)
    for path in paths:
        loader.want(path, None)
    for name, by in loader.queue:
        loader.take(name, by)
    loader.diagnostics += circles(loader.imports, loader.imports)
    return Program(
        tuple(loader.units),
        loader.sources,
        tuple(loader.diagnostics),
        frozenset(loader.broken),
        {name: stable(name, folders, paths[0]) for name in (*loader.sources, *loader.data)},
        loader.data,
        loader.data_names,
        loader.whole,
    )


@dataclass(slots=True)
class _Loader:
    read: Read
    packs: Packs
    folders: dict[str, str]  # of the packs used so far, by name
    listing: Listing | None
    parse: Callable[[Source], Parsed]
    queue: list[tuple[str, Import | None]] = field(default_factory=list)
    seen: set[str] = field(default_factory=set)
    units: list[Unit] = field(default_factory=list)
    imports: dict[str, list[ImportEdge]] = field(default_factory=dict)
    sources: dict[str, Source] = field(default_factory=dict)
    diagnostics: list[Diagnostic] = field(default_factory=list)
    broken: set[str] = field(default_factory=set)
    tried: set[str] = field(default_factory=set)  # zone files
    data: dict[str, bytes] = field(default_factory=dict)
    data_names: dict[tuple[str, str], str] = field(default_factory=dict)
    whole: bool = True
    suggested: int = 0

    def want(self, path: str, by: Import | None) -> str:
        """Queue a file unless it was queued before, and return its name."""
        name = shown(path)
        if name not in self.seen:
            self.seen.add(name)
            self.queue.append((name, by))
        return name

    def take(self, name: str, by: Import | None) -> None:
        """Read and parse one file, and queue its imports."""
        source = self._source(name, by)
        if source is None:
            return
        parsed = self.parse(source)
        self.units.append(parsed.unit)
        self.diagnostics += parsed.diagnostics
        self.broken |= parsed.broken
        self.whole = self.whole and parsed.whole
        self.imports[name] = []
        for each in parsed.unit.imports:
            if len(self.seen) >= MAX_FILES:
                self.whole = False
                self.diagnostics.append(too_many_files(each))
                break
            path = self._path(each, name)
            if path is not None:
                self.imports[name].append(ImportEdge(each, self.want(path, each)))
        for zone in parsed.unit.zones:
            if isinstance(zone.shape, GeoJson):
                self._take_data(zone.shape, name)

    def _take_data(self, by: GeoJson, source: str) -> None:
        path = self._path(by, source)
        name = None if path is None else shown(path)
        if name is not None and name not in self.tried:
            self.tried.add(name)
            data = self._bytes(name, by)
            if data is not None:
                self._keep(name, by, data)
        if name in self.data:
            self.data_names[source, by.path] = name

    def _keep(self, name: str, by: GeoJson, data: bytes) -> None:
        if len(data) > MAX_SIZE:
            self.diagnostics.append(too_large(name, len(data), by))
            return
        try:
            data.decode("utf-8")
        except UnicodeDecodeError as error:
            self.diagnostics.append(data_not_text(name, by, data, error.start))
        else:
            self.data[name] = data

    def _source(self, name: str, by: Import | None) -> Source | None:
        """The text of a file; None, with a finding, if it cannot be read."""
        data = self._bytes(name, by)
        if data is None:
            return None
        if len(data) > MAX_SIZE:
            self.diagnostics.append(too_large(name, len(data)))
            return None
        try:
            source = self.sources[name] = Source(name, data.decode("utf-8-sig"))
        except UnicodeDecodeError as error:
            self.sources[name] = Source(name, data.decode("utf-8", errors="replace"))
            self.diagnostics.append(not_text(self.sources[name], data, error.start))
            return None
        return source

    def _path(self, by: Wanted, source: str) -> str | None:
        """The path that `by` names in the file `source`; None, with a finding, if it is invalid."""
        path = imported(by.path, source, self._folder)
        if path is None:
            self.diagnostics.append(not_portable(by))
        elif not path.lower().endswith(_SOURCES if isinstance(by, Import) else _DATA):
            self.diagnostics.append(no_source(by))
            return None
        return path

    def _folder(self, pack: str) -> str | None:
        if pack not in self.folders and (folder := self.packs(pack)) is not None:
            self.folders[pack] = folder
        return self.folders.get(pack)

    def _bytes(self, name: str, by: Wanted | None) -> bytes | None:
        """The bytes of a file; None, with a finding, if it cannot be read."""
        try:
            return self.read(name)
        except (OSError, ValueError) as error:  # ValueError: a NUL in the path
            near = self._near(name) if is_missing(error) else None
            self.diagnostics.append(unreadable(name, by, error, near))
            return None

    def _near(self, name: str) -> str | None:
        """The most similar name in the same folder, if any."""
        if self.listing is None or self.suggested >= _SUGGESTED:
            return None
        self.suggested += 1
        try:
            own = posixpath.basename(name)
            return nearest(own, [each for each in self.listing(posixpath.dirname(name) or ".") if each != own])
        except OSError:
            return None
