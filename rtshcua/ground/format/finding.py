"""What lint and the editor say of a source that is not in the one style."""

from rtshcua.diagnostics.codes import NOT_FORMATTED
from rtshcua.diagnostics.diagnostic import Applicability, Diagnostic, Fix
from rtshcua.diagnostics.span import Source, Span


def not_formatted(source: Source, text: str) -> Diagnostic | None:
    """The finding on `source`, of which `text` is the formatted one; None where both are the same.

    It stands at the first line that differs; its fix is safe, and writes the whole text.
    """
    if source.text == text:
        return None
    old, new = source.text.split("\n"), text.split("\n")
    same = next(
        (at for at, pair in enumerate(zip(old, new, strict=False)) if pair[0] != pair[1]), min(len(old), len(new))
    )
    start = min(sum(len(line) + 1 for line in old[:same]), len(source.text))
    end = start + len(old[same]) if same < len(old) else start
    return Diagnostic(
        NOT_FORMATTED,
        "this is not laid out in the one style",
        Span(source.file, start, end),
        f"`rtshcua fmt {source.file}` lays it out",
        fixes=(Fix(Span(source.file, 0, len(source.text)), text, "lay the file out", Applicability.SAFE),),
    )
