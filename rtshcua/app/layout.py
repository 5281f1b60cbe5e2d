"""One file at a time: read, laid out, replaced where it changed."""

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
    """What a file called `name` held before, and holds after; `after` is None where that was refused, and the
    diagnostics say why. `unreadable` where it could not be had at all, `error` where it could not be written.
    """

    name: str
    before: bytes
    after: bytes | None
    diagnostics: tuple[Diagnostic, ...] = ()
    unreadable: bool = False
    error: OSError | None = None

    @property
    def changed(self) -> bool:
        """Whether it was not in the one style."""
        return self.after is not None and self.after != self.before

    @property
    def source(self) -> Source:
        """What it held, as text."""
        return Source(self.name, self.before.decode("utf-8", errors="replace"))


def of_file(path: Path, width: int, *, write: bool) -> Laid:
    """Lays a file out, and replaces it if that is asked for and it changes."""
    try:
        data = ReadableSources(str(library.root()), [path]).read(str(path))
    except OSError as error:
        from rtshcua.ground.language.file_findings import (
            unreadable,  # with the model, for which the usual case has no need
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
    """Lays out what a file holds."""
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
    from rtshcua.ground.format.format import formatted  # with the parser, which says why

    told = formatted(Source(name, text), width).diagnostics
    return Laid(name, data, None, told, unreadable=any(each.code is TOO_LARGE for each in told))
