"""Loads files and everything they import. It reads no file itself: `read` and `listing` are given by the caller.

An import names a file relative to the importing one, or, as `lib:skills/goto.rts`, in the library that ships with the
compiler. Declarations have no order, so files may import each other in a circle: each is read once.
"""

import posixpath
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from rtshcua.diagnostics.codes import IMPORT_PATH, NO_SUCH_FILE, NOT_TEXT
from rtshcua.diagnostics.diagnostic import Diagnostic, Fix
from rtshcua.diagnostics.span import Source, Span
from rtshcua.diagnostics.suggest import nearest
from rtshcua.ground.language.parse import MAX_SIZE, parse, too_large
from rtshcua.ground.language.paths import LIBRARY, imported, shown, stable
from rtshcua.model.ir.program import Import, Unit

Read = Callable[[str], bytes]
Listing = Callable[[str], Iterable[str]]


@dataclass(frozen=True, slots=True)
class Program:
    """The import closure of what was asked for, in the order in which it was reached.

    A file is called by its path, relative to the working folder where it lies in it. `sources` has every file that was
    read, `broken` the names of declarations that have an error. `stable` gives each file a name that is the same on
    every machine, for what is signed: `lib:skills/goto.rts` in the library, else relative to the first file's folder.
    """

    units: tuple[Unit, ...]
    sources: dict[str, Source]
    diagnostics: tuple[Diagnostic, ...]
    broken: frozenset[str]
    stable: dict[str, str]


def load(paths: Sequence[str], read: Read, library: str | None = None, listing: Listing | None = None) -> Program:
    """Reads `paths` and all they import, each file once.

    `read(path)` gives a file's bytes or raises OSError; `library` is the folder that `lib:` stands for; `listing(path)`
    gives the names in a folder, for suggestions, and may raise OSError. Every fault of a file is a finding, never an
    exception; one of a file in `paths` itself has no span.
    """
    loader = _Loader(read, library, listing)
    for path in paths:
        loader.want(path, None)
    for name, by in loader.queue:
        loader.take(name, by)
    return Program(
        tuple(loader.units),
        loader.sources,
        tuple(loader.diagnostics),
        frozenset(loader.broken),
        {name: stable(name, library, paths[0]) for name in loader.sources},
    )


@dataclass(slots=True)
class _Loader:
    read: Read
    library: str | None
    listing: Listing | None
    queue: list[tuple[str, Import | None]] = field(default_factory=list)
    seen: set[str] = field(default_factory=set)
    units: list[Unit] = field(default_factory=list)
    sources: dict[str, Source] = field(default_factory=dict)
    diagnostics: list[Diagnostic] = field(default_factory=list)
    broken: set[str] = field(default_factory=set)

    def want(self, path: str, by: Import | None) -> None:
        """Queues a file, unless it was met before."""
        name = shown(path)
        if name not in self.seen:
            self.seen.add(name)
            self.queue.append((name, by))

    def take(self, name: str, by: Import | None) -> None:
        """Reads and parses one file, and queues what it imports."""
        source = self._source(name, by)
        if source is None:
            return
        parsed = parse(source)
        self.units.append(parsed.unit)
        self.diagnostics += parsed.diagnostics
        self.broken |= parsed.broken
        for each in parsed.unit.imports:
            path = imported(each.path, name, self.library)
            if path is not None:
                self.want(path, each)
            elif each.path.startswith(LIBRARY):
                message = f"`{each.path}` is in the library, and there is none here"
                self.diagnostics.append(Diagnostic(IMPORT_PATH, message, each.span))
            else:
                message = f"`{each.path}` is not a path relative to the importing file"
                help = "write it with `/`, as in `../skills/goto.rts` or `lib:skills/goto.rts`"
                self.diagnostics.append(Diagnostic(IMPORT_PATH, message, each.span, help))

    def _source(self, name: str, by: Import | None) -> Source | None:
        """The text of a file; None, with a finding, where there is none."""
        try:
            data = self.read(name)
        except (OSError, ValueError) as error:  # ValueError: a NUL in the path
            self.diagnostics.append(self._unreadable(name, by, error))
            return None
        if len(data) > MAX_SIZE:
            self.diagnostics.append(too_large(name, len(data)))
            return None
        try:
            source = self.sources[name] = Source(name, data.decode("utf-8-sig"))
        except UnicodeDecodeError as error:
            self.sources[name] = Source(name, data.decode("utf-8", errors="replace"))
            self.diagnostics.append(_not_text(self.sources[name], data, error.start))
            return None
        return source

    def _unreadable(self, name: str, by: Import | None, error: OSError | ValueError) -> Diagnostic:
        written = name if by is None else by.path
        missing = isinstance(error, FileNotFoundError | NotADirectoryError)
        strerror = error.strerror if isinstance(error, OSError) else str(error)
        why = "there is no such file" if missing else (strerror or "it is unreadable").lower()
        near = self._near(name) if missing else None
        looked = None if written == name else f"looked for it at `{name}`"
        fixes: tuple[Fix, ...] = ()
        help = looked
        if near is not None:
            meant = posixpath.join(posixpath.dirname(written), near)
            help = f"did you mean `{meant}`?" if looked is None else f"{looked}; did you mean `{meant}`?"
            if by is not None:
                fixes = (Fix(by.span, f'import "{meant}"', f"import `{meant}`"),)
        span = None if by is None else by.span
        return Diagnostic(NO_SUCH_FILE, f"cannot read `{written}`: {why}", span, help, fixes=fixes)

    def _near(self, name: str) -> str | None:
        """The name in the same folder that was probably meant."""
        if self.listing is None:
            return None
        try:
            return nearest(posixpath.basename(name), self.listing(posixpath.dirname(name) or "."))
        except OSError:
            return None


def _not_text(source: Source, data: bytes, start: int) -> Diagnostic:
    at = len(data[:start].decode("utf-8", errors="replace"))
    return Diagnostic(
        NOT_TEXT,
        f"byte {start} (0x{data[start]:02x}) is not UTF-8, so the file is not text",
        Span(source.file, at, at + 1),
        "save it as UTF-8; if it is a compiled bundle, `rtshcua show` prints it",
    )
