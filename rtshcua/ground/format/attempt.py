"""Laying a text out, and looking at what came of it. No parser is imported here: its table is enough."""

from rtshcua.ground.format.align import align
from rtshcua.ground.format.comments import COMMENT
from rtshcua.ground.format.layout import layout
from rtshcua.ground.format.read import Read, read
from rtshcua.ground.format.same import Difference, difference
from rtshcua.ground.format.sheet import sheet
from rtshcua.ground.format.style import WIDTH
from rtshcua.ground.language.size import MAX_SIZE, MAX_TOKENS

#: brackets within brackets; the parser gives up before (E0105), and what has more would be too deep for us to walk
DEEPEST = 100


def attempt(text: str, width: int = WIDTH) -> str | Difference | None:
    """`text` in the one style, in lines of at most `width` characters where that can be.

    None where the parser does not take the text, it is nested too deeply, or has too many words or comments. A
    Difference where the result would not say the same, with the same comments in the same places: that is a fault of
    ours.
    """
    before = read(text) if len(text) <= MAX_SIZE and "\0" not in text else None
    if before is None or before.depth > DEEPEST or len(before.words) > MAX_TOKENS or crowded(before):
        return None
    made = lay_out(before, width)
    if made == text:
        return made
    return difference(before, read(made)) or made


def crowded(read: Read) -> bool:
    """Whether there are more comments than are laid out: each of them may be a line."""
    text = read.text
    if text.count("//") + text.count("/*") <= MAX_TOKENS:
        return False
    gaps = (text[end:start] for end, start in zip([0, *read.ends], [*read.starts, len(text)], strict=True))
    return sum(len(COMMENT.findall(gap)) for gap in gaps if "/" in gap) > MAX_TOKENS


def lay_out(before: Read, width: int) -> str:
    """The text in the one style, not yet held against what was there."""
    return align(layout(sheet(before), width), width)
