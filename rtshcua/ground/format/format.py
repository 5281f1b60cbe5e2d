"""Format a source, or report why it cannot be formatted."""

from dataclasses import dataclass

from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source
from rtshcua.ground.format.format_text import FormatDifference, format_text, has_too_many_comments
from rtshcua.ground.format.style import WIDTH
from rtshcua.ground.format.token_reader import read
from rtshcua.ground.language.file_findings import too_many_comments
from rtshcua.ground.language.parse import parse


@dataclass(frozen=True, slots=True)
class Formatted:
    """The formatted text, or None with the diagnostics that explain the refusal."""

    text: str | None
    diagnostics: tuple[Diagnostic, ...] = ()


def formatted(source: Source, width: int = WIDTH) -> Formatted:
    """Return `source` in the standard style, in lines of at most `width` characters where possible.

    A text with syntax errors is refused with the findings of `parse`, and a text whose meaning or comments would change
    with E1502.
    """
    made = format_text(source.text, width)
    if isinstance(made, str):
        return Formatted(made)
    if made is None:
        found = parse(source).diagnostics
        if not found and (tokens := read(source.text)) is not None and has_too_many_comments(tokens):
            found = (too_many_comments(source.file),)
        return Formatted(None, found or (FormatDifference("the syntax", 0).finding(source),))
    return Formatted(None, (made.finding(source),))
