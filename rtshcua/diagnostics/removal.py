"""What is taken out of a text so that no trace is left of a part: its whole line, or the part alone."""

import re

from rtshcua.diagnostics.span import Span

#: what may stand behind a part that goes with its line: blanks, a comment, and the line's end
_REST = re.compile(r"[ \t]*(?://[^\r\n]*)?(?:\r?\n|\Z)")


def whole_line(text: str, span: Span) -> Span:
    """The lines of a part that stands alone on them, with a comment behind it; else the part with the blanks before it.

    Comments on lines of their own stay: they may be about what follows.
    """
    start = text.rfind("\n", 0, span.start) + 1
    rest = _REST.match(text, span.end)
    if text[start : span.start].strip(" \t"):
        before = len(text[: span.start].rstrip(" \t"))
        return Span(span.file, before, span.end)
    if rest is None:
        after = len(text) - len(text[span.end :].lstrip(" \t"))
        return Span(span.file, span.start, after)
    return Span(span.file, start, rest.end())
