"""Findings about input files: missing, unreadable, too large, or of the wrong kind."""

import posixpath
from errno import ENXIO

from rtshcua.diagnostics.codes import IMPORT_PATH, NO_SUCH_FILE, NOT_A_SOURCE, NOT_TEXT, TOO_LARGE
from rtshcua.diagnostics.diagnostic import Diagnostic, Fix
from rtshcua.diagnostics.kinds import FileKind, foreign
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.language.paths import LIBRARY, is_direct, pack_of
from rtshcua.ground.language.size_limits import MAX_FILES as MAX_FILES
from rtshcua.ground.language.size_limits import MAX_SIZE as MAX_SIZE
from rtshcua.ground.language.size_limits import MAX_TOKENS
from rtshcua.model.ir.places import GeoJson
from rtshcua.model.ir.program import Import

_SOURCES = "a source is a plain text file that ends in `.rts`"
_A_FILE = "save the source as a file that ends in `.rts`: its imports are relative to that file"
_SPLIT = "split it into several files and import them"
Wanted = Import | GeoJson  # a declaration that names a file by its `path`


def not_portable(by: Wanted) -> Diagnostic:
    """A path that is not portable, or that names a pack which is not installed."""
    pack = pack_of(by.path)
    if pack is not None:
        where = "the library" if pack == "lib" else f"the pack `{pack}`"
        if not is_direct(by.path.removeprefix(f"{pack}:")):
            message = f"`{by.path}` is not a direct path into {where}"
            return Diagnostic(IMPORT_PATH, message, by.span, "write it without `..`, as in `lib:skills/goto.rts`")
        message = f"`{by.path}` is in {where}, which is not installed"
        help = None if pack == "lib" else f"install the package with the entry point `{pack}` of `rtshcua.skills`"
        return Diagnostic(IMPORT_PATH, message, by.span, help)
    what, example = ("importing file", "../skills/goto.rts") if isinstance(by, Import) else ("source", "bridge.geojson")
    library = f"{LIBRARY}{example.removeprefix('../')}"
    return Diagnostic(
        IMPORT_PATH,
        f"`{by.path}` is not a path relative to the {what}",
        by.span,
        f"write a path such as `{example}` or `{library}`",
    )


def no_source(by: Wanted) -> Diagnostic:
    """A path whose suffix is not that of a source or GeoJSON. The file is not read, so a message cannot leak it."""
    if isinstance(by, Import):
        help = "names of sources end in `.rts`"
        return Diagnostic(IMPORT_PATH, f"`{by.path}` is not the name of a source", by.span, help)
    help = "names of GeoJSON files end in `.geojson` or `.json`"
    return Diagnostic(IMPORT_PATH, f"`{by.path}` is not the name of a GeoJSON file", by.span, help)


def unreadable(name: str, by: Wanted | None, error: OSError | ValueError, near: str | None) -> Diagnostic:
    """A file that cannot be read; `near` is a similar name in the same folder."""
    written = name if by is None else by.path
    strerror = error.strerror if isinstance(error, OSError) else str(error)
    why = "no such file" if is_missing(error) else _lowered(strerror or "unreadable")
    looked = None if written == name else f"the file was expected at `{name}`"
    fixes: tuple[Fix, ...] = ()
    help = looked
    if near is not None:
        meant = posixpath.join(posixpath.dirname(written), near)
        help = f"did you mean `{meant}`?" if looked is None else f"{looked}; did you mean `{meant}`?"
        fixes = () if by is None else (_fix(by, meant),)
    elif by is None and is_no_file(name, error):
        help = _A_FILE
    span = None if by is None else by.span
    return Diagnostic(NO_SUCH_FILE, f"cannot read `{written}`: {why}", span, help, fixes=fixes)


def _lowered(text: str) -> str:
    return text[:1].lower() + text[1:]


def is_no_file(name: str, error: OSError | ValueError) -> bool:
    """Whether the path is the standard input, a pipe, a device or a socket."""
    return (name == "-" and is_missing(error)) or (isinstance(error, OSError) and error.errno == ENXIO)


def is_missing(error: OSError | ValueError) -> bool:
    """Whether the file does not exist, rather than being unreadable."""
    return isinstance(error, FileNotFoundError | NotADirectoryError)


def too_large(file: str, size: int, by: GeoJson | None = None) -> Diagnostic:
    """A file of `size` bytes or characters, above the limit."""
    message = f"`{file}` is {-(-size >> 20)} MiB; the limit is {MAX_SIZE >> 20} MiB"
    if by is None:
        return Diagnostic(TOO_LARGE, message, None, _SPLIT)
    return Diagnostic(TOO_LARGE, message, by.span, "keep only the areas that are needed")


def too_long(file: str) -> Diagnostic:
    """A source with too many tokens."""
    return Diagnostic(TOO_LARGE, f"`{file}` has more than {MAX_TOKENS:,} tokens, the limit", None, _SPLIT)


def too_many_comments(file: str) -> Diagnostic:
    """A source with too many comments to format."""
    return Diagnostic(TOO_LARGE, f"`{file}` has more than {MAX_TOKENS:,} comments, the limit", None, _SPLIT)


def too_many_files(by: Import) -> Diagnostic:
    """The import that exceeds the number of files of a program."""
    message = f"the program has more than {MAX_FILES:,} files; this import and all later ones were skipped"
    return Diagnostic(TOO_LARGE, message, by.span, "import only what is used")


def not_a_source(file: str, kind: FileKind) -> Diagnostic:
    """A file of another kind than a source."""
    return Diagnostic(NOT_A_SOURCE, f"this is {kind.name}, not a source", Span(file, 0, 0), kind.help or _SOURCES)


def not_text(source: Source, data: bytes, start: int) -> Diagnostic:
    """A source with invalid UTF-8 at byte `start`; `source` has the text with replacement characters."""
    kind = foreign(data, source.file)
    if kind is not None:
        return not_a_source(source.file, kind)
    at = len(data[:start].decode("utf-8", errors="replace"))
    return Diagnostic(
        NOT_TEXT,
        f"byte {start} (0x{data[start]:02x}) is not UTF-8",
        Span(source.file, at, at + 1),
        "save the file as UTF-8; if it is a compiled bundle, `rtshcua show` prints it",
    )


def data_not_text(name: str, by: GeoJson, data: bytes, start: int) -> Diagnostic:
    """A GeoJSON file with invalid UTF-8 at byte `start`."""
    message = f"byte {start} (0x{data[start]:02x}) of `{name}` is not UTF-8"
    return Diagnostic(NOT_TEXT, message, by.span, "save the file as UTF-8")


def _fix(by: Wanted, meant: str) -> Fix:
    if isinstance(by, Import):
        return Fix(by.span, f'import "{meant}"', f"import `{meant}`")
    feature = "" if by.feature is None else by.feature.replace("\\", "\\\\").replace('"', '\\"')
    return Fix(by.span, f'from "{meant}"' + (f' feature "{feature}"' if feature else ""), f"read `{meant}`")
