"""Makes lines of a sheet: on one line what fits and was not ended by its author, and the rest by rule.

Ranges are of tokens, `[first, end)`; columns count from 0.
"""

from collections.abc import Iterator

from rtshcua.ground.format.page import Line, Page
from rtshcua.ground.format.sheet import BLOCK, GROUP, Sheet
from rtshcua.ground.format.style import COLUMNS, INDENT, ITEMS, LEADS, PLACES, Style

_PLAIN = Style()
_CELLS = 1000  # more than a row of a table has; its cells are columns too, before those that a style names


def layout(sheet: Sheet, width: int) -> list[Line]:
    """The lines of a text, before their columns are aligned."""
    made = _Layout(sheet, width)
    count = len(sheet.read.words)
    made.items(0, count, 0, "")
    made.page.new(count, 0, blank=count > 0)
    return made.page.lines


class _Layout:
    """Walks the tokens; `page` has what was written."""

    def __init__(self, sheet: Sheet, width: int) -> None:
        self.sheet, self.limit, self.page = sheet, width, Page(sheet)
        self.symbols = sheet.read.symbols

    def items(self, first: int, end: int, indent: int, owner: str) -> None:
        """Declarations, or the items of a block, each on lines of its own."""
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
        """One of them, from where the page stands."""
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
        """Notes where the columns of an item begin that took one line, if they stand in their order."""
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
        """The tokens that stand in no brackets of their own, and opening brackets."""
        at = first
        while at < end:
            yield at
            at = self.sheet.pairs.get(at, at) + 1

    def separates(self, token: int, *, named: bool = False) -> bool:
        """Whether a token is a comma between two parts of a list; of one whose parts are `named` as parameters are,
        one part is `a: one of x, y`.
        """
        if self.symbols[token] != "," or self.symbols[token - 1] in PLACES:
            return False
        return not named or self.symbols[token + 2 : token + 3] == [":"]

    def clauses(self, first: int, end: int, indent: int, column: int, style: Style, action: str) -> None:
        """An item's rest, broken where its author did or where it gets too wide, before what its style names, before
        items within, and after the commas of a list.
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
        """How wide the first of the lines is that these tokens surely take."""
        sheet = self.sheet
        if not sheet.ends_within(first, end):
            return sheet.width(first, end)
        return sheet.width(first, next(at for at in range(first + 1, end) if sheet.ends_before(at)))

    def clause(self, first: int, end: int, indent: int, column: int, action: str, *, inner: bool = False) -> None:
        """A condition or a part of one, or anything without: on one line, or else broken at its `or`s, at its `and`s,
        or within brackets.
        """
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
        """Tokens with brackets among them, of which some must be laid out over lines."""
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
        """Up to where a line goes on after a closing bracket: after the next opening one, or before a line's end."""
        at = close + 1
        while at < end and not self.sheet.ends_before(at):
            if at in self.sheet.pairs:
                return at + 1
            at += 1
        return at

    def listed(self, opening: int, close: int, action: str) -> None:
        """A list, one part a line; the last has its comma too."""
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

    def cut_part(self, first: int, line: Line, *, named: bool, action: str) -> None:
        """Notes the column in a parameter, after its colon, and in an enumerator."""
        at = first + 2 if named else first + 1
        if named or action == "enum":
            sheet = self.sheet
            place = sheet.places[2 * at] - sheet.places[2 * first + 1] + (len(sheet.gaps[at]) if named else 0)
            line.kind, line.cuts = ("part", ((0, place),))
