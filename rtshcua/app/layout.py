"""Format one file, and write it if it changed."""

from dataclasses import dataclass, replace
from pathlib import Path

from rtshcua import library
from rtshcua.adapters.store.source_access import ReadableSources
from rtshcua.adapters.store.writing import rewrite
from rtshcua.diagnostics.codes import TOO_LARGE
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source
from rtshcua.ground.format.format_text import format_text
from rtshcua.ground.language.paths import shown
from rtshcua.ground.language.size_limits import MAX_SIZE


@dataclass(frozen=True, slots=True)
class Laid:
    """The octets of a file before and after formatting. `after` is None if the file was not formatted, by the
    diagnostics. `unreadable`: it could not be read. `error`: it could not be written.
    """

    name: str
    before: bytes
    after: bytes | None
    diagnostics: tuple[Diagnostic, ...] = ()
    unreadable: bool = False
    error: OSError | None = None

    @property
    def changed(self) -> bool:
        """Whether formatting changed the file."""
        return self.after is not None and self.after != self.before

    @property
    def source(self) -> Source:
        """The text before formatting."""
        return Source(self.name, self.before.decode("utf-8", errors="replace"))


def of_file(path: Path, width: int, *, write: bool) -> Laid:
    """Format a file, and with `write` replace it if it changed."""
    try:
        data = ReadableSources(str(library.root()), [path]).read(str(path))
    except OSError as error:
        from rtshcua.ground.language.file_findings import (
            unreadable,  # imported late, because it loads the model
        )

        return Laid(shown(str(path)), b"", None, (unreadable(shown(str(path)), None, error, None),), unreadable=True)
    laid = of_text(path, data, width)
    if write and laid.changed and laid.after is not None:
        try:
            rewrite(path, data, laid.after)
        except OSError as error:
            return replace(laid, error=error)
    return laid


def of_text(path: Path, data: bytes, width: int) -> Laid:
    """Format the octets of a file."""
    name = shown(str(path))
    if len(data) > MAX_SIZE:
        from rtshcua.ground.language.file_findings import too_large

        return Laid(name, data, None, (too_large(name, len(data)),), unreadable=True)
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        from rtshcua.ground.language.file_findings import not_text

        source = Source(name, data.decode("utf-8", errors="replace"))
        return Laid(name, data, None, (not_text(source, data, error.start),))
    made = format_text(text, width)
    if isinstance(made, str):
        return Laid(name, data, made.encode())
    from rtshcua.ground.format.format import formatted  # imported late, because it loads the parser

    diagnostics = formatted(Source(name, text), width).diagnostics
    return Laid(name, data, None, diagnostics, unreadable=any(each.code is TOO_LARGE for each in diagnostics))
