"""Lint the programs of files. Results come from the cache where possible; new results are stored in it.

This module does not import the parser. `examine` does, and is imported only if a file is not in the cache.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

from rtshcua import library
from rtshcua.adapters.store.lint_cache import LintCache
from rtshcua.adapters.store.source_access import ReadableSources
from rtshcua.app.files import SPECIFICATION, root_programs
from rtshcua.app.lint.cache import LintedProgram, decoded, encoded, mark
from rtshcua.diagnostics.span import Source
from rtshcua.ground.language.paths import shown

if TYPE_CHECKING:
    from rtshcua.app.lint.examine import Examiner


class LintSession:
    """The files of a run. Each is read once; `put` replaces the content of a file for this run."""

    def __init__(self, asked: Iterable[Path] = ()) -> None:
        self._readable = ReadableSources(str(library.root()), asked)
        self._data: dict[str, bytes | OSError | ValueError] = {}
        self._digests: dict[str, str | None] = {}
        self._sources: dict[str, Source] = {}
        self._mark: str | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """The files that were read so far."""
        return tuple(self._data)

    def read(self, name: str) -> bytes:
        """Return a file's bytes, at most one more than the parser's limit.

        Raises the OSError or ValueError of the first attempt to read the file.
        """
        found = self._data.get(name)
        if found is None:
            try:
                found = self._readable.read(name)
            except (OSError, ValueError) as error:
                found = error
            self._data[name] = found
        if isinstance(found, bytes):
            return found
        raise found

    def put(self, name: str, data: bytes) -> None:
        """Replace the content of a file for the rest of this run, in memory only."""
        self._data[name] = data
        self._digests.pop(name, None)
        self._sources.pop(name, None)

    def digest(self, name: str) -> str | None:
        """Return the digest of a file's bytes, or None if it cannot be read."""
        if name not in self._digests:
            try:
                self._digests[name] = sha256(self.read(name)).hexdigest()
            except (OSError, ValueError):
                self._digests[name] = None
        return self._digests[name]

    def folder(self, pack: str) -> str | None:
        """Return the folder of an installed pack, or None."""
        return self._readable.pack(pack)

    def listing(self, name: str) -> list[str]:
        """Return the names in a folder, for suggestions. Raises OSError."""
        return self._readable.listing(name)

    def sources(self, names: Sequence[str]) -> dict[str, Source]:
        """Return the texts of files. Unreadable files are omitted, and invalid UTF-8 is replaced."""
        return {name: source for name in names if (source := self._source(name)) is not None}

    def _source(self, name: str) -> Source | None:
        if name not in self._sources:
            try:
                text = self.read(name).decode("utf-8-sig", errors="replace")
            except (OSError, ValueError):
                return None
            self._sources[name] = Source(name, text)
        return self._sources[name]

    def _length(self, name: str) -> int | None:
        source = self._source(name)
        return None if source is None else len(source.text)

    def examine(
        self,
        files: Sequence[Path],
        further: Mapping[Path, Sequence[Path]],
        caches: Mapping[Path, LintCache | None],
        widths: Mapping[Path, int],
    ) -> list[LintedProgram]:
        """Lint the programs of files, in order (`files.root_programs`).

        Each file has further sources, a cache or None, and a line width if its layout is checked.
        """
        names = [shown(str(path)) for path in files]
        asked = {name: widths.get(path) for name, path in zip(names, files, strict=True)}
        if files[0].suffix.lower() == SPECIFICATION:
            from rtshcua.app.lint.examine import examine_specification

            return [examine_specification(self, files, further[files[0]], asked)]
        examiner = cache(partial(_examiner, self, asked))  # imported and created only if a program is not cached
        every: list[LintedProgram] = []
        new: dict[int, LintedProgram] = {}
        for number, path in enumerate(files):
            found = self._known(caches[path], _entry(names[number], further[path]), asked)
            if found is None:
                found = new[number] = examiner().loaded(path, further[path])
            every.append(found)
        chosen = root_programs(names, [each.members for each in every])
        waiting = [number for number in chosen if every[number].result is None]
        if waiting:
            results = examiner().examined([(files[number], further[files[number]]) for number in waiting])
            new |= dict(zip(waiting, results, strict=True))
        for number, each in new.items():
            every[number] = each
            self._store(caches[files[number]], _entry(names[number], further[files[number]]), each)
        return [every[number] for number in chosen]

    def _store(self, cache: LintCache | None, entry: str, program: LintedProgram) -> None:
        if cache is not None and program.lasting:
            cache.put(entry, encoded(program, self._marked(entry)))

    def _known(self, cache: LintCache | None, entry: str, asked: Mapping[str, int | None]) -> LintedProgram | None:
        data = None if cache is None else cache.get(entry)
        if data is None:
            return None
        return decoded(data, self._marked(entry), asked, self.digest, self.folder, self._length)

    def _marked(self, entry: str) -> str:
        """Return the mark of an entry. It contains the entry's name, so that a moved entry is not accepted."""
        if self._mark is None:
            self._mark = mark()
        return f"{self._mark} {entry}"


def _examiner(session: LintSession, asked: Mapping[str, int | None]) -> "Examiner":
    from rtshcua.app.lint.examine import Examiner

    return Examiner(session, asked)


def _entry(name: str, further: Sequence[Path]) -> str:
    """Return the cache key of a file's program. File names are relative to the working folder, so it is included."""
    about = [str(Path.cwd()), name, [shown(str(path)) for path in further]]
    return sha256(json.dumps(about).encode("utf-8", "surrogatepass")).hexdigest()[:40]
