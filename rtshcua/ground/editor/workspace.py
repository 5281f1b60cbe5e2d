"""The workspace of an editor: the open texts over the files on disk, and the programs that they make."""

import posixpath
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain

from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.checker.symbols import Symbols, collect
from rtshcua.ground.editor.incremental_parse import ParsedText, parse_edited, parse_text
from rtshcua.ground.editor.occurrences import Occurrence, occurrences
from rtshcua.ground.language.load import Listing, Program, Read, load
from rtshcua.ground.language.parse import Parsed
from rtshcua.ground.language.paths import SHELVES, Packs, shown
from rtshcua.ground.pipeline.closure import Imports
from rtshcua.model.ir.program import Unit

REMEMBERED = 1_000
"""Files on disk whose parse is kept."""
LOST, KEPT = 8, 2
"""An edit that takes more declarations than that from a text, as one that opens a comment, is likely to be followed by
one that brings them back: so many texts from before such edits are kept.
"""


@dataclass(slots=True)
class ProgramView:
    """One program as it is just now: a file and all that it imports."""

    name: str
    program: Program
    symbols: Symbols
    imports: Imports
    _units: dict[str, Unit] = field(default_factory=dict)
    _found: dict[str, tuple[Occurrence, ...]] = field(default_factory=dict)

    @property
    def units(self) -> dict[str, Unit]:
        """The files by name."""
        if not self._units:
            self._units = {unit.file: unit for unit in self.program.units}
        return self._units

    def text(self, file: str) -> str:
        """The text of a file of the program; empty where there is none."""
        source = self.program.sources.get(file)
        return "" if source is None else source.text

    def slice(self, span: Span) -> str:
        """The text under a span."""
        return self.text(span.file)[span.start : span.end]

    def occurrences(self, file: str) -> tuple[Occurrence, ...]:
        """Every place of a file that means something by name."""
        if file not in self._found:
            unit = self.units.get(file)
            self._found[file] = () if unit is None else occurrences(self.symbols, unit)
        return self._found[file]


class Workspace:
    """Open texts by the names of their files, as `shown` gives them. Nothing here reads a file but `read`, which may
    raise OSError; what it read is kept until `forget`.
    """

    def __init__(
        self, read: Read, library: str | None = None, listing: Listing | None = None, packs: Packs | None = None
    ) -> None:
        self._read = read
        self._library = library
        self._listing = listing
        self._packs: Packs = packs or (lambda _: None)
        self._open: dict[str, ParsedText] = {}
        self._earlier: dict[str, tuple[ParsedText, ...]] = {}
        self._files: dict[str, ParsedText] = {}
        self._bytes: dict[str, bytes] = {}
        self._views: dict[str, ProgramView] = {}

    @property
    def open(self) -> Mapping[str, ParsedText]:
        """What is open."""
        return self._open

    def put(self, name: str, text: str) -> ParsedText:
        """Opens a text, or changes it."""
        old = self._open.get(name)
        earlier = self._earlier.get(name, ())
        self._open[name] = now = parse_text(Source(name, text)) if old is None else parse_edited(old, text, earlier)
        if old is not None and len(now.pieces) + LOST < len(old.pieces):
            self._earlier[name] = (*earlier, old)[-KEPT:]
        self._views.clear()
        return now

    def close(self, name: str) -> None:
        """From now on the file on disk counts."""
        self._open.pop(name, None)
        self._earlier.pop(name, None)
        self.forget()

    def forget(self) -> None:
        """Files on disk may have changed."""
        self._bytes.clear()
        self._views.clear()

    def view(self, name: str) -> ProgramView:
        """The program of a file."""
        found = self._views.get(name)
        if found is None:
            program = load([name], self.read, self._library, self._listing, self._parse, self._packs)
            imports = Imports(program.units, program.stable)
            found = self._views[name] = ProgramView(name, program, collect(program.units, program.broken), imports)
        return found

    def with_texts(self, texts: Mapping[str, str]) -> "Workspace":
        """Another workspace, with these texts open besides; what is on disk was read already, and is not read again."""
        other = Workspace(self._read, self._library, self._listing, self._packs)
        other._open, other._files, other._bytes = dict(self._open), dict(self._files), dict(self._bytes)
        for name, text in texts.items():
            other.put(name, text)
        return other

    def text(self, name: str) -> str | None:
        """The text of a file as the programs see it; None where it cannot be had."""
        if name in self._open:
            return self._open[name].source.text
        try:
            return self.read(name).decode("utf-8-sig")
        except (OSError, ValueError):
            return None

    def views(self, names: Iterable[str]) -> Iterator[ProgramView]:
        """The programs of several files, and of all that are open."""
        seen: set[str] = set()
        for name in chain(tuple(self._open), names):
            if name not in seen:
                seen.add(name)
                yield self.view(name)

    def cut(self, name: str) -> ParsedText | None:
        """A text in pieces, open or not; None where it cannot be had."""
        if name in self._open:
            return self._open[name]
        text = self.text(name)
        return None if text is None else self._cut(Source(name, text))

    def learn(self, other: "Workspace") -> None:
        """Keeps what another workspace has parsed of files on disk; each is held against its text before it counts."""
        self._files.update(other._files)

    def read(self, path: str) -> bytes:
        """What is open counts, and else what is on the disk. Raises what `read` raises."""
        name = shown(path)
        if name in self._open:
            return self._open[name].source.text.encode("utf-8", "surrogatepass")
        if path not in self._bytes:
            self._bytes[path] = self._read(path)
        return self._bytes[path]

    def is_shipped(self, name: str) -> bool:
        """Whether a file belongs to the library, which is not the author's to change."""
        shelves = () if self._library is None else (posixpath.join(self._library, shelf) for shelf in SHELVES)
        return any(shown(name).startswith(f"{shown(shelf)}/") for shelf in shelves)

    def folder(self, pack: str) -> str | None:
        """The folder that a pack's name stands for."""
        return self._library if pack == "lib" else self._packs(pack)

    def names_in(self, folder: str) -> tuple[str, ...]:
        """What is in a folder; nothing where it cannot be read."""
        try:
            return tuple(sorted(self._listing(folder))) if self._listing is not None else ()
        except OSError:
            return ()

    def _parse(self, source: Source) -> Parsed:
        return self._cut(source).parsed

    def _cut(self, source: Source) -> ParsedText:
        own = self._open.get(source.file)
        if own is not None and own.source.text == source.text:
            return own
        known = self._files.get(source.file)
        if known is None or known.source.text != source.text:
            if len(self._files) >= REMEMBERED:
                self._files.clear()
            known = self._files[source.file] = parse_text(source)
        return known
