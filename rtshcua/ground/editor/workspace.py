"""The workspace of an editor: the open texts, the files on disk, and the programs that they form."""

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
"""The most files on disk whose parse is kept."""
LOST, KEPT = 8, 2
"""An edit that removes more than `LOST` declarations, such as opening a comment, is often undone soon, so the last
`KEPT` texts before such edits are kept.
"""


@dataclass(slots=True)
class ProgramView:
    """The present state of a program: a file and all its imports."""

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
        """The text of a file of the program; empty if there is none."""
        source = self.program.sources.get(file)
        return "" if source is None else source.text

    def slice(self, span: Span) -> str:
        """The text under a span."""
        return self.text(span.file)[span.start : span.end]

    def occurrences(self, file: str) -> tuple[Occurrence, ...]:
        """All names in a file with their targets."""
        if file not in self._found:
            unit = self.units.get(file)
            self._found[file] = () if unit is None else occurrences(self.symbols, unit)
        return self._found[file]


class Workspace:
    """Open texts by the `shown` names of their files. Files are only read by `read`, which may raise OSError; their
    content is kept until `forget`.
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
        """The open texts by file name."""
        return self._open

    def put(self, name: str, text: str) -> ParsedText:
        """Open a text, or replace it."""
        old = self._open.get(name)
        earlier = self._earlier.get(name, ())
        self._open[name] = now = parse_text(Source(name, text)) if old is None else parse_edited(old, text, earlier)
        if old is not None and len(now.pieces) + LOST < len(old.pieces):
            self._earlier[name] = (*earlier, old)[-KEPT:]
        self._views.clear()
        return now

    def close(self, name: str) -> None:
        """Close a text; the file on disk is used from then on."""
        self._open.pop(name, None)
        self._earlier.pop(name, None)
        self.forget()

    def forget(self) -> None:
        """Forget the content of files on disk, which may have changed."""
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
        """Return a workspace in which these texts are open too. It shares the content of files that were read."""
        other = Workspace(self._read, self._library, self._listing, self._packs)
        other._open, other._files, other._bytes = dict(self._open), dict(self._files), dict(self._bytes)
        for name, text in texts.items():
            other.put(name, text)
        return other

    def text(self, name: str) -> str | None:
        """The open text of a file, or else its text on disk; None if it cannot be read."""
        if name in self._open:
            return self._open[name].source.text
        try:
            return self.read(name).decode("utf-8-sig")
        except (OSError, ValueError):
            return None

    def views(self, names: Iterable[str]) -> Iterator[ProgramView]:
        """Yield the programs of all open texts and of several files."""
        seen: set[str] = set()
        for name in chain(tuple(self._open), names):
            if name not in seen:
                seen.add(name)
                yield self.view(name)

    def cut(self, name: str) -> ParsedText | None:
        """The parsed text of a file, open or on disk; None if it cannot be read."""
        if name in self._open:
            return self._open[name]
        text = self.text(name)
        return None if text is None else self._cut(Source(name, text))

    def learn(self, other: "Workspace") -> None:
        """Take over the parsed files of another workspace. Each is compared with its text before use."""
        self._files.update(other._files)

    def read(self, path: str) -> bytes:
        """Return the bytes of an open text, or else of the file on disk. Raises what `read` raises."""
        name = shown(path)
        if name in self._open:
            return self._open[name].source.text.encode("utf-8", "surrogatepass")
        if path not in self._bytes:
            self._bytes[path] = self._read(path)
        return self._bytes[path]

    def is_shipped(self, name: str) -> bool:
        """Whether a file belongs to the shipped library, which the author cannot change."""
        shelves = () if self._library is None else (posixpath.join(self._library, shelf) for shelf in SHELVES)
        return any(shown(name).startswith(f"{shown(shelf)}/") for shelf in shelves)

    def folder(self, pack: str) -> str | None:
        """The folder of a pack."""
        return self._library if pack == "lib" else self._packs(pack)

    def names_in(self, folder: str) -> tuple[str, ...]:
        """The sorted names in a folder; empty if it cannot be read."""
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
