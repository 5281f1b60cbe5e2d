"""Parses again only what an edit changed: the pieces of a text, one per declaration, and what was found in them.

What the parser does at the beginning of a declaration depends on nothing before it. So an edit is followed from the
declaration that it lies in to the first unchanged one that begins where one began before; from there on everything is
as it was, only moved. The result is that of `parse.parse` on the whole text, to the last span: a property test says so.
Where a piece may begin (`ParsedPiece.firm`) is narrow, because the explanation of an error looks around itself.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from types import UnionType
from typing import Any, Literal, NamedTuple, TypeVar, Union, get_args, get_origin, get_type_hints

from msgspec.structs import astuple, force_setattr

from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.editor.positions import Edit, difference
from rtshcua.ground.language.automaton import Automaton
from rtshcua.ground.language.build.reader import MAX_FINDINGS, Enough, Reader
from rtshcua.ground.language.parse import Parsed, beginning, parse, parsed, refused, run
from rtshcua.ground.language.recovery import shifts
from rtshcua.ground.language.table import table
from rtshcua.model.ir.expression import Reference
from rtshcua.model.ir.node import Name, Node
from rtshcua.model.ir.tests import Quoted

N = TypeVar("N", bound=Node)

_make = tuple.__new__  # a constructor is a function more: 9 % of moving a text of 2,000 lines (bench/editor.py)


def moved(node: N, by: int) -> N:
    """A node and all below it, `by` characters further on. It goes around the constructor: a long text has thousands of
    nodes, and a person waits.
    """
    made: N = node.__copy__()  # type: ignore[attr-defined]  # of msgspec.Struct, which does not tell
    file, start, end = node.span
    force_setattr(made, "span", _make(Span, (file, start + by, end + by)))
    for name in _inner_of(type(node)):
        value = getattr(node, name)
        if type(value) is tuple:
            if value:
                force_setattr(made, name, _all(value, by))
        elif isinstance(value, Node):
            force_setattr(made, name, moved(value, by))
    return made


@cache
def _inner_of(kind: type[Node]) -> tuple[str, ...]:
    """The parts of a kind of node that may be nodes, or tuples of them."""
    return tuple(name for name, hint in get_type_hints(kind).items() if name != "span" and not _is_plain(hint))


def _is_plain(hint: Any) -> bool:
    if get_origin(hint) in (Union, UnionType):
        return all(map(_is_plain, get_args(hint)))
    return get_origin(hint) is Literal or (isinstance(hint, type) and not issubclass(hint, Node | tuple))


def moved_finding(found: Diagnostic, by: int, since: int = 0, file: str | None = None) -> Diagnostic:
    """A finding with all its places at or behind `since` moved, those in `file` if it is given."""

    def place(span: Span) -> Span:
        where, start, end = span
        if file is not None and where != file:
            return span
        behind = start >= since
        return Span(where, start + by if behind else start, end + by if behind or end > since else end)

    return replace(
        found,
        span=None if found.span is None else place(found.span),
        labels=tuple(replace(label, span=place(label.span)) for label in found.labels),
        fixes=tuple(replace(fix, span=place(fix.span)) for fix in found.fixes),
    )


def same(old: Any, new: Any, edited: Mapping[str, Sequence[Span]] | None = None) -> bool:
    """Whether two nodes, or tuples of them, say the same, wherever they stand; but for names at places of the old text
    that were `edited`.
    """
    if type(old) is not type(new):
        return False
    if isinstance(old, Node):
        file, start, end = old.span
        free = bool(edited) and isinstance(old, Name | Reference | Quoted)
        free = free and any(start <= place.start and place.end <= end for place in (edited or {}).get(file, ()))
        return all(
            type(mine) is Span or (free and type(mine) is str) or same(mine, its, edited)
            for mine, its in zip(astuple(old), astuple(new), strict=True)
        )
    if type(old) is tuple:
        return len(old) == len(new) and all(same(mine, its, edited) for mine, its in zip(old, new, strict=True))
    return bool(old == new)


def _all(values: tuple[Any, ...], by: int) -> tuple[Any, ...]:
    return tuple([moved(each, by) if isinstance(each, Node) else _inner(each, by) for each in values])


def _inner(value: Any, by: int) -> Any:
    return _all(value, by) if type(value) is tuple else value


T = TypeVar("T", bound=Node)

_LIST = "<__file_star_"  # the rule for the declarations that were read


class ParsedPiece(NamedTuple):
    """From behind the declaration before to the end of one: what was declared and found there.

    `start` is where the last declaration of it begins. `firm` says that nothing but blanks and comments stands before
    it, that a blank stands behind its first word, and no word touches that: then neither side looks over the border.
    """

    start: int
    end: int
    firm: bool
    declarations: tuple[Node, ...]
    found: tuple[Diagnostic, ...]
    broken: frozenset[str]
    whole: bool


class ParsedText(NamedTuple):
    """A text in pieces; the last one is what stands behind the last declaration.

    `since` is the edit that made it of the text before, where that changed no declaration and no syntax error: only
    comments and blanks. Then all that was found before still holds, some of it further on.
    """

    source: Source
    pieces: tuple[ParsedPiece, ...]
    parsed: Parsed
    since: Edit | None = None


class _KnownPiece(NamedTuple):
    """The piece `at` of a cut, which stands `by` characters further on now."""

    text: ParsedText
    at: int
    by: int


def parse_text(source: Source) -> ParsedText:
    """A text that is parsed for the first time."""
    if refused(source) is not None:
        return ParsedText(source, (), parse(source))
    reader = _PieceBuilder(source)
    try:
        run(Automaton(reader), beginning(source))
    except Enough:
        return ParsedText(source, (), parse(source))
    reader.close(len(source.text), len(source.text), firm=False)
    return _joined(source, tuple(reader.pieces))


def parse_edited(old: ParsedText, text: str, earlier: Sequence[ParsedText] = ()) -> ParsedText:
    """The same file with another text. What `earlier` cuts of it have, and `old` lost, need not be parsed again: behind
    a comment that was opened and is closed again.
    """
    if text == old.source.text:
        return old
    before = next((each for each in earlier if each.source.text == text), None)
    if before is not None:
        return before._replace(since=None)
    source = Source(old.source.file, text)
    if not old.pieces or refused(source) is not None:
        return parse_text(source)
    edit = difference(old.source.text, text)
    first = max((at for at, piece in enumerate(old.pieces) if at and _is_before(old, piece, edit)), default=0)
    later: dict[int, _KnownPiece] = {}
    for each in (*earlier, old):
        later |= _later(each, difference(each.source.text, text))
    try:
        made, known = _parse_until_known(source, old, first, later)
    except Enough:
        return parse_text(source)
    replaced, rest = old.pieces[first:], tuple[ParsedPiece, ...]()
    if known is not None:
        replaced, rest = old.pieces[first : known.at], known.text.pieces[known.at :]
        rest = tuple(_moved_piece(piece, known.by) for piece in rest) if known.by else rest
    pieces = (*old.pieces[:first], *made, *rest)
    if sum(len(piece.found) for piece in pieces) >= MAX_FINDINGS:
        return parse_text(source)
    comparable = known is None or known.text is old
    return _joined(source, pieces)._replace(since=edit if comparable and _say_the_same(replaced, made) else None)


def _parse_until_known(
    source: Source, old: ParsedText, first: int, later: Mapping[int, _KnownPiece]
) -> tuple[list[ParsedPiece], _KnownPiece | None]:
    """The pieces from number `first` on, up to one that is known already; None where there is none. Raises Enough."""
    start = old.pieces[first].start if first else beginning(source)
    reader = _PieceBuilder(source, later, old.pieces[first - 1].end if first else start)
    automaton = Automaton(reader)
    if first:
        _begin_behind(automaton)
    try:
        run(automaton, start)
    except _MetKnownPiece as met:
        return reader.pieces, met.known
    reader.close(len(source.text), len(source.text), firm=False)
    return reader.pieces, None


def _say_the_same(old: Sequence[ParsedPiece], new: Sequence[ParsedPiece]) -> bool:
    return not any(piece.found for piece in (*old, *new)) and same(
        tuple(node for piece in old for node in piece.declarations),
        tuple(node for piece in new for node in piece.declarations),
    )


def _later(known: ParsedText, edit: Edit) -> dict[int, _KnownPiece]:
    """The pieces behind an edit by where they begin now."""
    by = edit.length - (edit.end - edit.start)
    return {
        piece.start + by: _KnownPiece(known, at, by)
        for at, piece in enumerate(known.pieces)
        if piece.start >= edit.end and piece.firm
    }


class _MetKnownPiece(Exception):
    """The parser has come to the beginning of an unchanged piece."""

    def __init__(self, known: _KnownPiece) -> None:
        super().__init__(known)
        self.known = known


class _PieceBuilder(Reader):
    """Notes after each declaration what has come since the one before."""

    def __init__(self, source: Source, later: Mapping[int, _KnownPiece] | None = None, end: int | None = None) -> None:
        super().__init__(source)
        self.pieces: list[ParsedPiece] = []
        self._later = later or {}
        self._end = beginning(source) if end is None else end
        self._kept = self._noted = 0

    def declare(self, node: T, name: Name | None = None) -> None:
        """Keeps a declaration, and closes its piece; raises _Met where what follows is known."""
        super().declare(node, name)
        text, (_, start, end) = self.source.text, node.span
        self.close(start, end, firm=_is_firm(text, start, self._end))
        self._end = end
        known = self._later.get(_behind(text, end))
        if known is not None and _is_firm(text, _behind(text, end), end):
            raise _MetKnownPiece(known)

    def close(self, start: int, end: int, *, firm: bool) -> None:
        """Ends a piece."""
        kept, noted = tuple(self.declarations[self._kept :]), tuple(self.diagnostics[self._noted :])
        self._kept, self._noted = len(self.declarations), len(self.diagnostics)
        self.pieces.append(ParsedPiece(start, end, firm, kept, noted, frozenset(self.broken), self.whole))
        self.broken.clear()
        self.whole = True


def _behind(text: str, end: int) -> int:
    """Where the next word begins."""
    return table().skipped(text, end)


def _is_firm(text: str, start: int, before: int) -> bool:
    """See `ParsedPiece.firm`; `before` is the end of the declaration before."""
    word_end = _word_end(text, start)
    touched = start > 0 and (text[start - 1].isalnum() or text[start - 1] in "_.")
    return _behind(text, before) == start and text[word_end : word_end + 1].isspace() and not touched


def _word_end(text: str, start: int) -> int:
    end = start
    while text[end : end + 1].isalpha():
        end += 1
    return end


def _is_before(old: ParsedText, piece: ParsedPiece, edit: Edit) -> bool:
    """Whether a piece's first word, and the blank behind it, stand before an edit."""
    return piece.firm and edit.start > _word_end(old.source.text, piece.start)


def _begin_behind(automaton: Automaton) -> None:
    """The parser as it is after a declaration."""
    row = automaton.table.rows[0]
    automaton.states.append(next(state for symbol, state in row.items() if symbol.startswith(_LIST)))
    assert shifts(automaton.table.rows[automaton.states[-1]], "import")
    automaton.values.append([None])
    automaton.starts.append(0)


def _moved_piece(piece: ParsedPiece, by: int) -> ParsedPiece:
    return piece._replace(
        start=piece.start + by,
        end=piece.end + by,
        declarations=tuple([moved(node, by) for node in piece.declarations]),
        found=tuple([moved_finding(found, by) for found in piece.found]),
    )


def _joined(source: Source, pieces: tuple[ParsedPiece, ...]) -> ParsedText:
    declarations = [node for piece in pieces for node in piece.declarations]
    found = [each for piece in pieces for each in piece.found]
    broken = frozenset[str]().union(*(piece.broken for piece in pieces))
    return ParsedText(
        source, pieces, parsed(source, declarations, found, broken, whole=all(piece.whole for piece in pieces))
    )
