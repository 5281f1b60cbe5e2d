"""The span to delete when a part of a source is removed: its whole lines, or the part alone."""

import re

from rtshcua.diagnostics.span import Span

#: the rest of a line that is deleted with the part: blanks, a comment, the line end
_REST = re.compile(r"[ \t]*(?://[^\r\n]*)?(?:\r?\n|\Z)")


def whole_line(text: str, span: Span) -> Span:
    """The lines of a part if they have no other text but a trailing comment; else the part and the blanks around it.

    Comments on lines of their own stay: they may be about the next part.
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
