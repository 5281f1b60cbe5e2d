"""The findings about files that are asked for and cannot be had as they must be."""

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

_SOURCES = "sources are plain text, in files that end in `.rts`"
_A_FILE = "a source must be a file, because imports are found beside it: write it to one that ends in `.rts`"
Wanted = Import | GeoJson  # what names a file: its `path` as written, and the `span` of all that it is written with


def not_portable(by: Wanted) -> Diagnostic:
    """A path that means nothing on another machine, or in a pack that is not there."""
    pack = pack_of(by.path)
    if pack is not None:
        where = "the library" if pack == "lib" else f"the pack `{pack}`"
        if not is_direct(by.path.removeprefix(f"{pack}:")):
            message = f"`{by.path}` does not lead straight into {where}"
            return Diagnostic(IMPORT_PATH, message, by.span, "write it without `..`, as in `lib:skills/goto.rts`")
        message = f"`{by.path}` is in {where}, and there is none here"
        help = None if pack == "lib" else f"a Python package brings it, by an entry point `{pack}` of `rtshcua.skills`"
        return Diagnostic(IMPORT_PATH, message, by.span, help)
    what, example = ("importing file", "../skills/goto.rts") if isinstance(by, Import) else ("source", "bridge.geojson")
    library = f"{LIBRARY}{example.removeprefix('../')}"
    return Diagnostic(
        IMPORT_PATH,
        f"`{by.path}` is not a path relative to the {what}",
        by.span,
        f"write it with `/`, as in `{example}` or `{library}`",
    )


def no_source(by: Wanted) -> Diagnostic:
    """A path to what is no source, or no GeoJSON, by its name: it is not read, and so nothing of it is shown."""
    if isinstance(by, Import):
        return Diagnostic(IMPORT_PATH, f"`{by.path}` is not a source, by its name", by.span, "sources end in `.rts`")
    help = "accepted: names that end in `.geojson` or `.json`"
    return Diagnostic(IMPORT_PATH, f"`{by.path}` is not GeoJSON, by its name", by.span, help)


def unreadable(name: str, by: Wanted | None, error: OSError | ValueError, near: str | None) -> Diagnostic:
    """A file that cannot be read; `near` is the name beside it that was probably meant."""
    written = name if by is None else by.path
    strerror = error.strerror if isinstance(error, OSError) else str(error)
    why = "there is no such file" if is_missing(error) else _lowered(strerror or "it is unreadable")
    looked = None if written == name else f"looked for it at `{name}`"
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
    """Whether the standard input is meant, or what is there is a pipe, a device or a socket."""
    return (name == "-" and is_missing(error)) or (isinstance(error, OSError) and error.errno == ENXIO)


def is_missing(error: OSError | ValueError) -> bool:
    """Whether there is no such file, rather than one that cannot be read."""
    return isinstance(error, FileNotFoundError | NotADirectoryError)


def too_large(file: str, size: int, by: GeoJson | None = None) -> Diagnostic:
    """A file of `size` bytes or characters, which is not looked at."""
    limit = MAX_SIZE >> 20
    message = f"`{file}` is {-(-size >> 20)} MiB large; at most {limit} MiB are read"
    if by is None:
        return Diagnostic(TOO_LARGE, message, None, "split it into several files, and import them")
    return Diagnostic(TOO_LARGE, message, by.span, "keep only the areas that are needed in it")


def too_long(file: str) -> Diagnostic:
    """A file of more words and marks than are read, which is not looked at."""
    message = f"`{file}` has more than {MAX_TOKENS:,} words and marks; no more are read"
    return Diagnostic(TOO_LARGE, message, None, "split it into several files, and import them")


def too_many_comments(file: str) -> Diagnostic:
    """A file of more comments than are laid out."""
    message = f"`{file}` has more than {MAX_TOKENS:,} comments; no more are laid out"
    return Diagnostic(TOO_LARGE, message, None, "split it into several files, and import them")


def too_many_files(by: Import) -> Diagnostic:
    """An import that, with those before it, names more files than a program may have."""
    message = f"the program has more than {MAX_FILES:,} files; this import and what comes after it are not looked at"
    return Diagnostic(TOO_LARGE, message, by.span, "import only what is used")


def not_a_source(file: str, kind: FileKind) -> Diagnostic:
    """A file of another kind."""
    return Diagnostic(NOT_A_SOURCE, f"this is {kind.name}, and no source", Span(file, 0, 0), kind.help or _SOURCES)


def not_text(source: Source, data: bytes, start: int) -> Diagnostic:
    """A source that is no UTF-8 from byte `start` on; `source` has what could be made of it."""
    kind = foreign(data, source.file)
    if kind is not None:
        return not_a_source(source.file, kind)
    at = len(data[:start].decode("utf-8", errors="replace"))
    return Diagnostic(
        NOT_TEXT,
        f"byte {start} (0x{data[start]:02x}) is not UTF-8, so the file is not text",
        Span(source.file, at, at + 1),
        "save it as UTF-8; if it is a compiled bundle, `rtshcua show` prints it",
    )


def data_not_text(name: str, by: GeoJson, data: bytes, start: int) -> Diagnostic:
    """A GeoJSON file that is no UTF-8 from byte `start` on."""
    message = f"byte {start} (0x{data[start]:02x}) of `{name}` is not UTF-8, so the file is not text"
    return Diagnostic(NOT_TEXT, message, by.span, "save it as UTF-8")


def _fix(by: Wanted, meant: str) -> Fix:
    if isinstance(by, Import):
        return Fix(by.span, f'import "{meant}"', f"import `{meant}`")
    feature = "" if by.feature is None else by.feature.replace("\\", "\\\\").replace('"', '\\"')
    return Fix(by.span, f'from "{meant}"' + (f' feature "{feature}"' if feature else ""), f"read `{meant}`")
