"""Apply the fixes of findings to source texts. The caller checks the result."""

from collections.abc import Collection, Iterable, Mapping

from rtshcua.diagnostics.diagnostic import Applicability, Diagnostic, Fix
from rtshcua.diagnostics.span import Source


def chosen(diagnostic: Diagnostic, *, suggested: bool) -> Fix | None:
    """Return the first safe fix of a finding, or with `suggested` the first fix if none is safe."""
    safe = next((fix for fix in diagnostic.fixes if fix.applicability is Applicability.SAFE), None)
    if safe is None and suggested and diagnostic.fixes:
        return diagnostic.fixes[0]
    return safe


def fixed(
    found: Iterable[Diagnostic], sources: Mapping[str, Source], files: Collection[str], *, suggested: bool = False
) -> dict[str, str]:
    """Return the new text of each of `files` that a fix changes.

    Of fixes that overlap or touch, only the first by position is applied. The next round applies the others.
    """
    wanted: dict[str, set[Fix]] = {}
    for diagnostic in found:
        fix = chosen(diagnostic, suggested=suggested)
        if fix is not None and fix.span.file in files and fix.span.file in sources:
            wanted.setdefault(fix.span.file, set()).add(fix)
    changed: dict[str, str] = {}
    for file, fixes in wanted.items():
        text = _applied(sources[file].text, fixes)
        if text != sources[file].text:
            changed[file] = text
    return changed


def _applied(text: str, fixes: Iterable[Fix]) -> str:
    pieces: list[str] = []
    end = -1
    for fix in sorted(fixes, key=lambda fix: (fix.span.start, fix.span.end, fix.replacement)):
        if fix.span.start > end:
            pieces += [text[max(end, 0) : fix.span.start], fix.replacement]
            end = fix.span.end
    return "".join([*pieces, text[max(end, 0) :]])
