"""Formats a source, or reports why it is left as it is."""

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
    """The text in the one style; None where it was refused, for which the diagnostics say why."""

    text: str | None
    diagnostics: tuple[Diagnostic, ...] = ()


def formatted(source: Source, width: int = WIDTH) -> Formatted:
    """`source` in the one style, in lines of at most `width` characters where that can be.

    A text that the parser does not take is refused with what `parse` says of it. So is one of which the result would
    not say the same, with the same comments in the same places (E1502).
    """
    made = format_text(source.text, width)
    if isinstance(made, str):
        return Formatted(made)
    if made is None:
        told = parse(source).diagnostics
        if not told and (taken := read(source.text)) is not None and has_too_many_comments(taken):
            told = (too_many_comments(source.file),)
        return Formatted(None, told or (FormatDifference("what can be read", 0).told(source),))
    return Formatted(None, (made.told(source),))
