"""Loads files and everything they import. It reads no file itself: `read` and `listing` are given by the caller.

An import names a file relative to the importing one, or, as `lib:skills/goto.rts`, in the library that ships with the
compiler, or, as `acme:skills/spray.rts`, in a pack that is installed; so does a zone that is read from GeoJSON.
Declarations have no order, so files may import each other in a circle, which is worth a warning: each is read once.
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

NAMED = 12  # files of one circle; more are counted, so that many long circles cannot swamp a person


class ImportEdge(NamedTuple):
    """A file has `by`, which imports the file `to`."""

    by: Import
    to: str


def circles(files: Iterable[str], imports: Mapping[str, Sequence[ImportEdge]]) -> list[Diagnostic]:
    """A finding for each import that leads back to where a walk came from; the walk follows `imports` depth first, in
    the order in which they are written, and begins with each of `files` that it has not met.
    """
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
        f"this import closes a circle: `{' -> '.join(names)}`",
        last.by.span,
        "move what the files need of each other into one that imports none of them"
        if len(files) > 1
        else "a file sees its own declarations, so leave the import out",
        labels=tuple(Label(edge.by.span, "and this one leads there") for edge in taken[:NAMED]),
    )


#: how the names of sources end, and of files that zones are read from: nothing else is read for an import
_SOURCES, _DATA = (".rts",), (".geojson", ".json")

#: for so many files that are not there it is looked for the one that was meant
_SUGGESTED = 100

Read = Callable[[str], bytes]
Listing = Callable[[str], Iterable[str]]


@dataclass(frozen=True, slots=True)
class Program:
    """The import closure of what was asked for, in the order in which it was reached.

    A file is called by its path, relative to the working folder where it lies in it. `sources` has every file that was
    read, `broken` the names of declarations that have an error. `stable` gives each file a name that is the same on
    every machine, for what is signed: `lib:skills/goto.rts` in the library, likewise in a pack, else relative to the
    first file's folder.

    `data` has the bytes, UTF-8 and not looked at further, of the files that zones are read from, and `stable` their
    names too; `data_names` says which of them a source's `from "..."` means, by the source and the path as written. A
    file that could not be had has its finding already, and is in neither.

    `whole` is false where an import has a syntax error, so that a name may be declared in a file that was not read.
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
    """What `parse` makes of a text, which never changes: programs that share files parse them once."""
    return parse(source)


def no_packs(_name: str) -> str | None:
    """Nothing is installed but the library."""
    return None


def load(
    paths: Sequence[str],
    read: Read,
    library: str | None = None,
    listing: Listing | None = None,
    parse: Callable[[Source], Parsed] = remembered,
    packs: Packs = no_packs,
) -> Program:
    """Reads `paths` and all they import, each file once.

    `read(path)` gives a file's bytes or raises OSError; `library` is the folder that `lib:` stands for, and `packs`
    finds those of other packs; `listing(path)` gives the names in a folder, for suggestions, and may raise OSError;
    `parse` is `parse.parse`, or one that remembers it. Every fault of a file is a finding, never an exception; one of a
    file in `paths` itself has no span.
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
    folders: dict[str, str]  # of the packs that were asked for, by name
    listing: Listing | None
    parse: Callable[[Source], Parsed]
    queue: list[tuple[str, Import | None]] = field(default_factory=list)
    seen: set[str] = field(default_factory=set)
    units: list[Unit] = field(default_factory=list)
    imports: dict[str, list[ImportEdge]] = field(default_factory=dict)
    sources: dict[str, Source] = field(default_factory=dict)
    diagnostics: list[Diagnostic] = field(default_factory=list)
    broken: set[str] = field(default_factory=set)
    tried: set[str] = field(default_factory=set)  # of the files that zones are read from
    data: dict[str, bytes] = field(default_factory=dict)
    data_names: dict[tuple[str, str], str] = field(default_factory=dict)
    whole: bool = True
    suggested: int = 0

    def want(self, path: str, by: Import | None) -> str:
        """Queues a file, unless it was met before; gives its name."""
        name = shown(path)
        if name not in self.seen:
            self.seen.add(name)
            self.queue.append((name, by))
        return name

    def take(self, name: str, by: Import | None) -> None:
        """Reads and parses one file, and queues what it imports."""
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
        """The text of a file; None, with a finding, where there is none."""
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
        """The path that `by` means in the file `source`; None, with a finding, where it means none."""
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
        """What is in a file; None, with a finding, where it cannot be read."""
        try:
            return self.read(name)
        except (OSError, ValueError) as error:  # ValueError: a NUL in the path
            near = self._near(name) if is_missing(error) else None
            self.diagnostics.append(unreadable(name, by, error, near))
            return None

    def _near(self, name: str) -> str | None:
        """The name in the same folder that was probably meant."""
        if self.listing is None or self.suggested >= _SUGGESTED:
            return None
        self.suggested += 1
        try:
            own = posixpath.basename(name)
            return nearest(own, [each for each in self.listing(posixpath.dirname(name) or ".") if each != own])
        except OSError:
            return None
