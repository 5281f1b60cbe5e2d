"""Incremental parsing: a text is divided into pieces, one for each declaration, and only changed pieces are parsed.

At the beginning of a declaration the parser does not depend on earlier text. So parsing starts at the declaration with
the edit, and stops at the first unchanged declaration that began at this place before. All later pieces are only moved.
The result equals that of `parse.parse` on the whole text; a property test compares them. Pieces begin only at some
places (`ParsedPiece.firm`), because the explanation of a syntax error uses the text around it.
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
    """Return a copy of a node and all nodes below it, moved by `by` characters.

    It does not call constructors, because a long text has thousands of nodes.
    """
    made: N = node.__copy__()  # type: ignore[attr-defined]  # msgspec.Struct has it, but its stub does not
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
    """The fields of a kind of node that may hold nodes, or tuples of nodes."""
    return tuple(name for name, hint in get_type_hints(kind).items() if name != "span" and not _is_plain(hint))


def _is_plain(hint: Any) -> bool:
    if get_origin(hint) in (Union, UnionType):
        return all(map(_is_plain, get_args(hint)))
    return get_origin(hint) is Literal or (isinstance(hint, type) and not issubclass(hint, Node | tuple))


def moved_finding(found: Diagnostic, by: int, since: int = 0, file: str | None = None) -> Diagnostic:
    """Return a finding with all its spans at or after `since` moved; if `file` is given, only those in this file."""

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
    """Whether two nodes, or tuples of them, are equal except for spans, and for names at `edited` places of the old
    text.
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

_LIST = "<__file_star_"  # the grammar rule for the list of declarations


class ParsedPiece(NamedTuple):
    """The text from the end of one declaration to the end of the next, with its declarations and findings.

    `start` is the start of its last declaration. `firm` means that there is only white space and comments before it,
    white space after its first word, and no word adjacent to that: then parsing and errors do not cross its start.
    """

    start: int
    end: int
    firm: bool
    declarations: tuple[Node, ...]
    found: tuple[Diagnostic, ...]
    broken: frozenset[str]
    whole: bool


class ParsedText(NamedTuple):
    """A text in pieces; the last one is the text after the last declaration.

    `since` is the last edit, if it changed only comments and white space, not declarations or syntax errors. Then all
    earlier findings still hold, with moved spans.
    """

    source: Source
    pieces: tuple[ParsedPiece, ...]
    parsed: Parsed
    since: Edit | None = None


class _KnownPiece(NamedTuple):
    """The piece with index `at` of a text, which is moved by `by` characters in the new text."""

    text: ParsedText
    at: int
    by: int


def parse_text(source: Source) -> ParsedText:
    """Parse a text for the first time."""
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
    """Parse the new text of a file. `earlier` texts of the file supply pieces that `old` lost, for example while a
    comment was open.
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
    pieces = (*old.pieces[:first], *made, *_moved_rest(known))
    if sum(len(piece.found) for piece in pieces) >= MAX_FINDINGS:
        return parse_text(source)
    comparable = known is None or known.text is old
    replaced = old.pieces[first : None if known is None else known.at]
    return _joined(source, pieces)._replace(since=edit if comparable and _are_same(replaced, made) else None)


def _moved_rest(known: _KnownPiece | None) -> tuple[ParsedPiece, ...]:
    """The known piece and all later ones, at their places in the new text."""
    rest = () if known is None else known.text.pieces[known.at :]
    return tuple(_moved_piece(piece, known.by) for piece in rest) if known is not None and known.by else rest


def _parse_until_known(
    source: Source, old: ParsedText, first: int, later: Mapping[int, _KnownPiece]
) -> tuple[list[ParsedPiece], _KnownPiece | None]:
    """Parse the pieces from number `first` on, up to a known one, which is returned too. Raises `Enough`."""
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


def _are_same(old: Sequence[ParsedPiece], new: Sequence[ParsedPiece]) -> bool:
    return not any(piece.found for piece in (*old, *new)) and same(
        tuple(node for piece in old for node in piece.declarations),
        tuple(node for piece in new for node in piece.declarations),
    )


def _later(known: ParsedText, edit: Edit) -> dict[int, _KnownPiece]:
    """The pieces after an edit, by their start in the new text."""
    by = edit.length - (edit.end - edit.start)
    return {
        piece.start + by: _KnownPiece(known, at, by)
        for at, piece in enumerate(known.pieces)
        if piece.start >= edit.end and piece.firm
    }


class _MetKnownPiece(Exception):
    """The parser has reached an unchanged piece."""

    def __init__(self, known: _KnownPiece) -> None:
        super().__init__(known)
        self.known = known


class _PieceBuilder(Reader):
    """A reader that closes a piece after each declaration."""

    def __init__(self, source: Source, later: Mapping[int, _KnownPiece] | None = None, end: int | None = None) -> None:
        super().__init__(source)
        self.pieces: list[ParsedPiece] = []
        self._later = later or {}
        self._end = beginning(source) if end is None else end
        self._kept = self._noted = 0

    def declare(self, node: T, name: Name | None = None) -> None:
        """Keep a declaration and close its piece. Raises `_MetKnownPiece` if the next piece is known."""
        super().declare(node, name)
        text, (_, start, end) = self.source.text, node.span
        self.close(start, end, firm=_is_firm(text, start, self._end))
        self._end = end
        known = self._later.get(_behind(text, end))
        if known is not None and _is_firm(text, _behind(text, end), end):
            raise _MetKnownPiece(known)

    def close(self, start: int, end: int, *, firm: bool) -> None:
        """Close a piece."""
        kept, noted = tuple(self.declarations[self._kept :]), tuple(self.diagnostics[self._noted :])
        self._kept, self._noted = len(self.declarations), len(self.diagnostics)
        self.pieces.append(ParsedPiece(start, end, firm, kept, noted, frozenset(self.broken), self.whole))
        self.broken.clear()
        self.whole = True


def _behind(text: str, end: int) -> int:
    """The start of the next token."""
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
    """Whether a piece's first word, and the white space after it, are before an edit."""
    return piece.firm and edit.start > _word_end(old.source.text, piece.start)


def _begin_behind(automaton: Automaton) -> None:
    """Set the parser to its state after a declaration."""
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
