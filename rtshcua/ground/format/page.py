"""The lines of the output while they are made."""

from dataclasses import dataclass, field

from rtshcua.ground.format.sheet import Sheet
from rtshcua.ground.format.style import INDENT


@dataclass(slots=True)
class Line:
    """One line: what stands on it after its indentation, piece by piece, and the comment at its end.

    `width` counts the indentation, and not the comment. `kind` and `cuts` are for lines that align with neighbours of
    their kind: which columns it has, and where in its text each begins. `blank` asks for an empty line before it, `own`
    says that it is a comment alone.
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
        """Counts what it has so far."""
        self.width = self.indent + sum(map(len, self.pieces))

    @property
    def text(self) -> str:
        """What stands on it."""
        return "".join(self.pieces)


@dataclass(slots=True)
class Page:
    """Takes text token by token; `line` is the one that is being written."""

    sheet: Sheet
    line: Line = field(default_factory=lambda: Line(0))
    lines: list[Line] = field(default_factory=list)

    @property
    def column(self) -> int:
        """Where the next character would stand, from 0."""
        return self.line.width

    @property
    def fresh(self) -> bool:
        """Whether nothing stands on the line yet."""
        return self.line.width == self.line.indent

    def add(self, text: str) -> None:
        """Goes on, on the same line."""
        self.line.pieces.append(text)
        self.line.width += len(text)

    def word(self, token: int) -> None:
        """The token itself, without what stands before it."""
        self.add(self.sheet.written[2 * token + 1])

    def step(self, token: int, indent: int) -> None:
        """What stands before a token in the middle of a line, which a comment may end all the same."""
        if self.sheet.ends_before(token):
            self.new(token, indent)
        else:
            self.add(self.sheet.gaps[token])

    def new(self, token: int, indent: int, *, blank: bool = False, closing: bool = False) -> None:
        """Ends the line before `token`, with the comments that stand there; `blank` if an empty line may follow.

        Comments before a closing bracket are indented as what is within. On a line that is held it goes on.
        """
        gap = self.sheet.note(token)
        if token in self.sheet.held:
            self.add(self.sheet.gaps[token])
            return
        deeper = indent + INDENT if closing else indent
        before = ""
        for number, comment in enumerate(gap.comments):
            alone = not comment.first and not comment.last and number == 0
            several = "\n" in comment.text
            opens = token > 0 and self.sheet.read.symbols[token - 1] in ("{", "(", ",")
            if not comment.first and number == 0 and (not alone or several or not opens):
                # it ended the line before; but what opens a list or a block is not followed by several lines
                if several and alone and opens:
                    self._begin(Line(deeper, [comment.text], blank=False, own=True))
                else:
                    self.line.comment = comment.text
            elif comment.last or several or number < len(gap.comments) - 1:
                self._begin(Line(deeper, [comment.text], blank=blank and comment.blank, own=True))
                blank = True
            else:  # code follows on its line, and goes on to do so
                before = comment.text + " "
                gap = gap._replace(blank=comment.blank)
        self._begin(Line(indent, [before], blank=blank and gap.blank and not closing))

    def _begin(self, line: Line) -> None:
        if not self.fresh or self.line.comment or self.lines:
            self.lines.append(self.line)
        self.line = line
