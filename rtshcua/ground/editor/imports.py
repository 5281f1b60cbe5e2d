"""The paths that an import may name, while it is written."""

import posixpath
from collections.abc import Iterator
from typing import NamedTuple

from rtshcua.ground.editor.desk import Desk, View
from rtshcua.ground.editor.syntax import Token, tokens
from rtshcua.ground.language.paths import LIBRARY, SHELVES, pack_of

_ENDINGS = {"import": (".rts",), "from": (".geojson", ".json")}


class Path(NamedTuple):
    """What is written of a path up to the cursor, where it begins, and which word stands before it."""

    text: str
    start: int
    word: str


def quoted(text: str, offset: int, since: int) -> Path | None:
    """The path that a place is in; None where it is in none."""
    last = ""
    for token in tokens(text, since, offset):
        if token.kind == "string" and token.start < offset and (offset < token.end or not _is_closed(token)):
            return Path(text[token.start + 1 : offset], token.start + 1, last) if last in _ENDINGS else None
        if token.kind != "comment":
            last = token.text
    return None


def _is_closed(token: Token) -> bool:
    return len(token.text) > 1 and token.text.endswith('"')


def import_paths(desk: Desk, view: View, path: Path, file: str) -> Iterator[str]:
    """Whole paths that go on from what is written: of the library's shelves, and of the files beside this one."""
    endings = _ENDINGS[path.word]
    folder, _, _ = path.text.rpartition("/")
    pack = pack_of(path.text)
    if pack is not None:
        place = desk.folder(pack)
        inside = folder.removeprefix(f"{pack}:")
        if place is not None and ".." not in inside.split("/"):
            known = desk.names_in(posixpath.join(place, inside))
            shelves = [each for each in known if inside or pack != "lib" or each in SHELVES]
            yield from _going_on(path.text[: len(path.text) - len(path.text.rpartition("/")[2])] if folder else
                                 f"{pack}:", shelves, endings)  # fmt: skip
        return
    if not folder and path.word == "import":
        yield from (f"{LIBRARY}{shelf}/" for shelf in SHELVES)
    written = f"{folder}/" if folder else ""
    names = desk.names_in(posixpath.join(posixpath.dirname(file) or ".", written) or ".")
    yield from _going_on(written, [each for each in names if each != posixpath.basename(file)], endings)
    if not folder:
        yield "../"


def _going_on(written: str, names: list[str], endings: tuple[str, ...]) -> Iterator[str]:
    for name in names:
        if name.endswith(endings):
            yield written + name
        elif "." not in name:
            yield f"{written}{name}/"
