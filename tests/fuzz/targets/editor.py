"""Texts during editing: after every edit the editor's findings equal those of a full check, and no request at
any place fails.
"""

from collections.abc import Iterable
from random import Random
from zlib import crc32

from fuzz import corpus, world
from fuzz.mutation.sentences import mutated as mutated
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.ground.editor.code_actions import actions
from rtshcua.ground.editor.code_completion import complete, signature
from rtshcua.ground.editor.document_structure import folds, outline, semantic_tokens
from rtshcua.ground.editor.hover import hover
from rtshcua.ground.editor.incremental_parse import ParsedText, moved_finding
from rtshcua.ground.editor.navigation import definitions, imported_at, importers, references, targets
from rtshcua.ground.editor.positions import Encoding, LineIndex, TextChange, difference, edited
from rtshcua.ground.editor.rename import renamable, rename
from rtshcua.ground.editor.workspace import LOST, Workspace
from rtshcua.ground.language.parse import parse
from rtshcua.ground.pipeline.program import check_declared
from rtshcua.mavlink import dialect

MAX_LENGTH = 8_000
EDITS = 4
#: places of each text at which all requests are made
PLACES = 3

_PUT = (
    "", "", " ", "\n", "}", "{", "(", ")", "/*", "*/", "//", '"', ",", ".", "1", " %", "x", "=", "𝄞", "\r\n", "\r",
    "\0", "zone ", "\nzone a = circle(47.39 N, 8.54 E, 5 m)\n", '\nimport "lib:skills/goto.rts"\n', "import ", "when ",
    "\nskill f() {\n", "\npolicy p version 1 {\n", "permit any by any\n", "target inside ", '\ntest "t" { ', "signal ",
    "// rtshcua: ignore E1302", "\nenum e { a = 1 }\n",
)  # fmt: skip
_NAMES = ("pool", "a.b", "phase", "battery", "target", "1", "")
_read: dict[str, ParsedText] = {}  # of the library; what a file says is held against its text


def seeds() -> Iterable[bytes]:
    return corpus.sources()


def one(data: bytes) -> None:
    of = Random(crc32(data))
    lines = LineIndex(data.decode("utf-8", errors="replace").removeprefix("\ufeff"), of.choice(list(Encoding)))
    desk = _desk()
    desk.put(world.PROBE, lines.text)
    _asked(desk, of)
    before = [lines]
    for _ in range(EDITS):
        if of.random() < 0.15:
            lines = of.choice(before)  # undone
        else:
            at, end = _range(lines.text, of)
            change = TextChange(lines.place(at), lines.place(end), of.choice(_PUT))
            lines = edited(lines, [change])
            assert lines.place(len(lines.text)) == LineIndex(lines.text, lines.encoding).place(len(lines.text))
        last = before[-1].text
        found = check_declared(desk.view(world.PROBE).program, dialect.load())
        now = desk.put(world.PROBE, lines.text)
        before.append(lines)
        if now.since is not None and last != lines.text:
            assert now.since == difference(last, lines.text)
            by = now.since.length - (now.since.end - now.since.start)
            if "rtshcua:" not in last + lines.text:
                kept = {moved_finding(each, by, now.since.end, world.PROBE) for each in found}
                assert kept == set(check_declared(desk.view(world.PROBE).program, dialect.load()))
        _same_as_whole(desk, lines.text)
        _asked(desk, of)


def _desk() -> Workspace:
    desk = Workspace(world.reading({}), world.LIBRARY, world.listing)
    desk._files = _read
    return desk


def _range(text: str, of: Random) -> tuple[int, int]:
    at = of.randrange(len(text) + 1)
    return at, min(len(text), at + of.choice((0, 0, 0, 1, 1, 7, 40, 40 * LOST)))


def _same_as_whole(desk: Workspace, text: str) -> None:
    now = desk.open[world.PROBE]
    assert now.parsed == parse(now.source)
    other = _desk()
    other.put(world.PROBE, text)
    mine, whole = desk.view(world.PROBE).program, other.view(world.PROBE).program
    assert mine.units == whole.units
    found = check_declared(mine, dialect.load())
    assert found == check_declared(whole, dialect.load())
    world.hold(found, mine.sources)


def _asked(desk: Workspace, of: Random) -> None:
    """All requests of an editor for a text."""
    file, now = world.PROBE, desk.open[world.PROBE]
    text, view = now.source.text, desk.view(file)
    for kept in (outline(now), folds(now), semantic_tokens(view, file)):
        assert kept == tuple(dict.fromkeys(kept))
    found = check_declared(view.program, dialect.load())
    for _ in range(PLACES):
        at = of.randrange(len(text) + 1)
        told = hover(view, file, at, dialect.load())
        assert told is None or told.text
        places = [*definitions(view, file, at)]
        for target in targets(view, file, at):
            places += references([view], view, target)
        imported = imported_at(view, file, at)
        if imported is not None:
            places += importers([view], imported)
        assert all(0 <= each.start <= each.end <= len(view.text(each.file)) for each in places)
        for item in complete(desk, view, now, at, dialect.load()):
            assert item.text
            assert 0 <= item.start <= at
        signature(view, now, at)
        for action in actions(found, file, at, min(len(text), at + 50), text):
            assert all(0 <= fix.span.start <= fix.span.end <= len(text) for fix in action.fixes)
        if not isinstance(renamable(desk, view, file, at), Refusal):
            made = rename(desk, (), view, file, at, of.choice(_NAMES), dialect.load())
            assert isinstance(made, Refusal) or not made.places or made.applied(file, text)
