"""Lay out the tokens of a text in lines, then align columns and comments of adjacent lines.

A line ends where its author ended it, or where it would be too long; `style` defines the possible places. Ranges are of
tokens, `[first, end)`; columns count from 0.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from rtshcua.ground.format.style import COLUMNS, INDENT, ITEMS, LEADS, PLACES, Style
from rtshcua.ground.format.token_sheet import BLANKS, BLOCK, GROUP, CommentRow, TokenSheet


@dataclass(slots=True)
class OutputLine:
    """One line: its pieces after the indentation, and the comment at its end.

    `width` includes the indentation, but not the comment. `kind` and `cuts` align the line with adjacent lines of the
    same kind: `cuts` are the offsets of its columns. `blank` requests an empty line before it. `own` marks a line with
    only a comment.
    """

    indent: int
    pieces: list[str] = field(default_factory=list)
    width: int = 0
    comment: str = ""
    blank: bool = False
    own: bool = False
    kind: str = ""
    cuts: tuple[tuple[int, int], ...] = ()

    def __post_init__(self) -> None:
        """Compute the initial width."""
        self.width = self.indent + sum(map(len, self.pieces))

    @property
    def text(self) -> str:
        """The text of the line, without indentation and comment."""
        return "".join(self.pieces)


@dataclass(slots=True)
class OutputPage:
    """Collects lines token by token; `line` is the current line."""

    sheet: TokenSheet
    line: OutputLine = field(default_factory=lambda: OutputLine(0))
    lines: list[OutputLine] = field(default_factory=list)

    @property
    def column(self) -> int:
        """The column of the next character, from 0."""
        return self.line.width

    @property
    def fresh(self) -> bool:
        """Whether the current line is empty."""
        return self.line.width == self.line.indent

    def add(self, text: str) -> None:
        """Append text to the current line."""
        self.line.pieces.append(text)
        self.line.width += len(text)

    def word(self, token: int) -> None:
        """Append the token without the gap before it."""
        self.add(self.sheet.written[2 * token + 1])

    def step(self, token: int, indent: int) -> None:
        """Append the gap before a token on the same line; a comment in it may still end the line."""
        if self.sheet.ends_before(token):
            self.new(token, indent)
        else:
            self.add(self.sheet.gaps[token])

    def new(self, token: int, indent: int, *, blank: bool = False, closing: bool = False) -> None:
        """End the line before `token`, with the comments of the gap; `blank` if an empty line may follow.

        Comments before a closing bracket are indented like the contents of the bracket. A held line is not ended.
        """
        gap = self.sheet.note(token)
        if token in self.sheet.held:
            self.add(self.sheet.gaps[token])
            return
        deeper = indent + INDENT if closing else indent
        before, comments = "", gap.comments
        if comments and not comments[0].first and self._trail(token, comments[0], deeper):
            comments = comments[1:]
        for number, comment in enumerate(comments, 1):
            if comment.last or "\n" in comment.text or number < len(comments):
                self._begin(OutputLine(deeper, [comment.text], blank=blank and comment.blank, own=True))
                blank = True
            else:  # code follows on its line
                before = comment.text + " "
                gap = gap._replace(blank=comment.blank)
        self._begin(OutputLine(indent, [before], blank=blank and gap.blank and not closing))

    def _trail(self, token: int, comment: CommentRow, indent: int) -> bool:
        """Write a comment after the code of the current line; False if code follows the comment after a bracket."""
        opens = not comment.last and token > 0 and self.sheet.read.symbols[token - 1] in ("{", "(", ",")
        if not opens:
            self.line.comment = comment.text
        elif "\n" in comment.text:  # a comment of several lines must not follow an opening bracket
            self._begin(OutputLine(indent, [comment.text], blank=False, own=True))
        else:
            return False
        return True

    def _begin(self, line: OutputLine) -> None:
        if not self.fresh or self.line.comment or self.lines:
            self.lines.append(self.line)
        self.line = line


_PLAIN = Style()
_CELLS = 1000  # more than a row of a table has; its cells are columns too, before those that a style names


def layout(sheet: TokenSheet, width: int) -> list[OutputLine]:
    """Return the lines of a text, before alignment."""
    made = _Layout(sheet, width)
    count = len(sheet.read.words)
    made.items(0, count, 0, "")
    made.page.new(count, 0, blank=count > 0)
    return made.page.lines


class _Layout:
    """Walks the tokens and writes lines to `page`."""

    def __init__(self, sheet: TokenSheet, width: int) -> None:
        self.sheet, self.limit, self.page = sheet, width, OutputPage(sheet)
        self.symbols = sheet.read.symbols

    def items(self, first: int, end: int, indent: int, owner: str) -> None:
        """Write declarations or the items of a block, each on lines of its own."""
        known, at = self.sheet.read.items, first
        while at < end:
            item = known.get(at)
            if item is not None:
                action, after = item
            else:  # what no rule of ours knows
                action, after = "", next((token for token in range(at + 1, end) if token in known), end)
            self.page.new(at, indent, blank=at > first)
            self.item(at, after, indent, action, owner)
            at = after

    def item(self, first: int, end: int, indent: int, action: str, owner: str) -> None:
        """Write one item at the current position."""
        sheet, page = self.sheet, self.page
        style = ITEMS.get(action, _PLAIN)
        begun, fresh = page.line, page.fresh
        room = COLUMNS.get(owner, 0) if style.aligned and fresh else 0
        page.word(first)
        if end > first + 1:
            padding = " " * (room - len(sheet.read.words[first]))
            plain = sheet.lines[end - 1] == sheet.lines[first] and not sheet.ends_within(first, end)
            width = len(padding) + sheet.width(first, end) - len(sheet.read.words[first])
            if plain and page.column + width <= self.limit:
                page.add(padding + sheet.gaps[first + 1] + sheet.flat(first + 1, end))
            else:
                column = indent + (room + 1 if room else INDENT)
                if not sheet.ends_before(first + 1):
                    page.add(padding)
                page.step(first + 1, column)
                self.clauses(first + 1, end, indent, column, style, action)
        if page.line is begun and fresh and style.cuts:
            self.cut(first, end, style, action)

    def cut(self, first: int, end: int, style: Style, action: str) -> None:
        """Record the columns of an item on one line, if they are in order."""
        sheet, found = self.sheet, list[tuple[int, int]]()
        for at in self.level(first + 1, end):
            number = -1
            if self.symbols[at] in style.cuts:
                number = _CELLS + style.cuts.index(self.symbols[at])
            elif action == "row" and self.separates(at - 1):
                number = found[-1][0] + 1 if found else 0
            if number >= 0:
                found.append((number, sheet.places[2 * at] + len(sheet.gaps[at]) - sheet.places[2 * first + 1]))
        if found == sorted(dict(found).items()) and self.page.column - self.page.line.indent == sheet.width(first, end):
            self.page.line.kind, self.page.line.cuts = action, tuple(found)

    def level(self, first: int, end: int) -> Iterator[int]:
        """The tokens of a range outside of inner brackets, with the opening brackets."""
        at = first
        while at < end:
            yield at
            at = self.sheet.pairs.get(at, at) + 1

    def separates(self, token: int, *, named: bool = False) -> bool:
        """Whether a token is a comma between two parts of a list. In a list of `named` parts, as of parameters,
        `a: one of x, y` is one part.
        """
        if self.symbols[token] != "," or self.symbols[token - 1] in PLACES:
            return False
        return not named or self.symbols[token + 2 : token + 3] == [":"]

    def clauses(self, first: int, end: int, indent: int, column: int, style: Style, action: str) -> None:
        """Write the rest of an item. Lines end where the author ended them or where they are too wide: before the words
        of its style, before inner items, and after the commas of a list.
        """
        sheet, page = self.sheet, self.page
        breaks = [
            at
            for at in self.level(first, end)
            if at > first
            and (self.symbols[at] in style.breaks or at in sheet.read.items or self.separates(at - 1))
            and self.symbols[at] != "}"
        ]
        broken = False  # whether the clause before is a condition that took several lines
        for begin, after in zip([first, *breaks], [*breaks, end], strict=True):
            if begin > first:
                closed = page.line.pieces == ["", ")"]
                gap = " " if closed and sheet.gaps[begin] == "  " else sheet.gaps[begin]
                wide = page.column + len(gap) + self.first_line(begin, after) > self.limit
                if wide or (broken and not closed) or sheet.author_ended(begin) or sheet.ends_before(begin):
                    page.new(begin, column)
                else:
                    page.add(gap)
            line = page.line
            self.clause(begin, after, indent, column, action)
            broken = line is not page.line

    def first_line(self, first: int, end: int) -> int:
        """The width of the first line that these tokens need."""
        sheet = self.sheet
        if not sheet.ends_within(first, end):
            return sheet.width(first, end)
        return sheet.width(first, next(at for at in range(first + 1, end) if sheet.ends_before(at)))

    def clause(self, first: int, end: int, indent: int, column: int, action: str, *, inner: bool = False) -> None:
        """Write a condition or a part of one on one line, or broken at its `or`s, at its `and`s, or in brackets."""
        sheet, page = self.sheet, self.page
        if not sheet.ends_within(first, end) and page.column + sheet.width(first, end) <= self.limit:
            page.add(sheet.flat(first, end))
            return
        if self.symbols[first] in LEADS and end > first + 1:
            page.word(first)
            page.step(first + 1, page.column + 1)
            first += 1
        level = [at for at in self.level(first, end) if at > first and self.symbols[at] in ("and", "or")]
        weakest = [at for at in level if self.symbols[at] == "or"] or level
        if not weakest:
            self.brackets(first, end, indent, column, action)
            return
        left = page.column + (INDENT if inner else 0)
        begin = first
        for at in [*weakest, end]:
            self.clause(begin, at, indent, column, action, inner=len(weakest) < len(level))
            if at < end:
                page.new(at, left)
                page.word(at)
                page.step(at + 1, left + INDENT)
                begin = at + 1

    def brackets(self, first: int, end: int, indent: int, column: int, action: str) -> None:
        """Write tokens with brackets that need several lines."""
        sheet, page = self.sheet, self.page
        for at in self.level(first, end):
            if at > first:
                page.step(at, column)
            close = sheet.pairs.get(at)
            if close is None:
                page.word(at)
                continue
            kind = sheet.kinds[at]
            fits = page.column + sheet.width(at, self.reach(close, end)) <= self.limit
            if not sheet.ends_within(at, close + 1) and (fits or close == at + 1):
                page.add(sheet.flat(at, close + 1))
            elif kind is GROUP:
                page.word(at)
                page.step(at + 1, page.column)
                self.clause(at + 1, close, indent, page.column, action)
                page.step(close, column)
                page.word(close)
            elif kind is BLOCK:
                page.word(at)
                self.items(at + 1, close, indent + INDENT, action)
                page.new(close, indent, closing=True)
                page.word(close)
            else:
                self.listed(at, close, action)

    def reach(self, close: int, end: int) -> int:
        """The end of a line after a closing bracket: after the next opening bracket, or at a line end."""
        at = close + 1
        while at < end and not self.sheet.ends_before(at):
            if at in self.sheet.pairs:
                return at + 1
            at += 1
        return at

    def listed(self, opening: int, close: int, action: str) -> None:
        """Write a list with one part per line; the last part has a comma too."""
        sheet, page = self.sheet, self.page
        indent = page.line.indent
        page.word(opening)
        last = close - 1 if not sheet.read.words[close - 1] or not sheet.written[2 * close - 1] else close
        named = self.symbols[opening + 2] == ":"
        ends = [at + 1 for at in self.level(opening + 1, last) if self.separates(at, named=named)]
        begin = opening + 1
        for end in [*(each for each in ends if each < last), last]:
            if begin == end:
                break
            page.new(begin, indent + INDENT, blank=begin > opening + 1)
            line = page.line
            fresh = page.fresh
            self.clause(begin, end, indent + INDENT, indent + 2 * INDENT, action)
            if end == last and self.symbols[end - 1] != ",":
                page.add(",")
            if line is page.line and fresh:
                self.cut_part(begin, line, named=named, action=action)
            begin = end
        page.new(close, indent, closing=True)
        page.word(close)

    def cut_part(self, first: int, line: OutputLine, *, named: bool, action: str) -> None:
        """Record the column after the colon of a parameter, or in an enumerator."""
        at = first + 2 if named else first + 1
        if named or action == "enum":
            sheet = self.sheet
            place = sheet.places[2 * at] - sheet.places[2 * first + 1] + (len(sheet.gaps[at]) if named else 0)
            line.kind, line.cuts = ("part", ((0, place),))


ROW = "row"
_APART = 2  # blanks before a comment


def align(lines: list[OutputLine], width: int) -> str:
    """Return the text of the lines with aligned columns."""
    for run in _runs(lines, lambda line, last: line.kind not in ("", ROW) and line.kind == last.kind):
        _columns(run, width)
    for run in _tables(lines):
        _columns(run, width)
    for run in _runs(lines, lambda line, last: not line.own and not last.own and "\n" not in last.comment):
        _comments(run, width)
    made = []
    for line in lines:
        if line.blank:
            made.append("")
        made.append(f"{' ' * line.indent}{line.text}{line.comment}".rstrip(BLANKS))
    return "\n".join(made) + "\n" if made else ""


def _runs(lines: list[OutputLine], belongs: Callable[[OutputLine, OutputLine], bool]) -> Iterator[list[OutputLine]]:
    """Groups of adjacent lines of the same indentation."""
    run = lines[:1]
    for line in lines[1:]:
        if run[-1].indent == line.indent and not line.blank and belongs(line, run[-1]):
            run.append(line)
        else:
            yield run
            run = [line]
    yield run


def _tables(lines: list[OutputLine]) -> Iterator[list[OutputLine]]:
    """The rows of each table, with other lines between them ignored."""
    run: list[OutputLine] = []
    for line in lines:
        if run and line.indent < run[0].indent:
            yield run
            run = []
        if line.kind == ROW:
            run.append(line)
    if run:
        yield run


def _columns(run: list[OutputLine], width: int) -> None:
    """Align as many columns, from the left, as possible without making a line too wide."""
    cuts = [dict(line.cuts) for line in run]
    room = [max(width - line.width, 0) for line in run]
    pads: list[list[tuple[int, int]]] = [[] for _ in run]
    shifts = [0] * len(run)
    for column in sorted({number for each in cuts for number in each}):
        here = [number for number, each in enumerate(cuts) if column in each]
        target = max(cuts[number][column] + shifts[number] for number in here)
        missing = {number: target - cuts[number][column] - shifts[number] for number in here}
        if any(shifts[number] + pad > room[number] for number, pad in missing.items()):
            break
        for number, pad in missing.items():
            shifts[number] += pad
            pads[number].append((cuts[number][column], pad))
    for line, padded, shift in zip(run, pads, shifts, strict=True):
        if shift:
            text, pieces, at = line.text, [], 0
            for place, pad in padded:
                pieces += [text[at:place], " " * pad]
                at = place
            line.pieces = [*pieces, text[at:]]
            line.width += shift


def _comments(run: list[OutputLine], width: int) -> None:
    """Align the comments of a run, if that does not make a line too wide."""
    commented = [line for line in run if line.comment]
    column = max((line.width for line in commented), default=0) + _APART
    fits = all(column + len(line.comment) <= max(width, line.width + _APART + len(line.comment)) for line in commented)
    for line in commented:
        line.comment = " " * (column - line.width if fits else _APART) + line.comment
