"""Code actions for findings: their fixes, and comments that ignore a warning with a reason."""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.diagnostic import Applicability, Diagnostic, Fix
from rtshcua.diagnostics.span import Span

ALL = "apply all safe fixes"


class CodeAction(NamedTuple):
    """A change of one file, with a title. `safe` means that it keeps the author's intent."""

    title: str
    fixes: tuple[Fix, ...]
    found: Diagnostic | None
    safe: bool


def actions(found: Sequence[Diagnostic], file: str, start: int, end: int, text: str) -> Iterator[CodeAction]:
    """Yield the actions for a range of a file."""
    for each in found:
        if each.span is None or each.span.file != file or each.span.start > end or each.span.end < start:
            continue
        for fix in each.fixes:
            if fix.span.file == file:
                yield CodeAction(fix.title, (fix,), each, fix.applicability is Applicability.SAFE)
        if each.severity is not Severity.ERROR and each.code.id.startswith("E13"):
            yield CodeAction(
                f"ignore `{each.code.slug}` here, with a reason", (_ignore(each, each.span, text),), each, False
            )
    together = all_safe(found, file)
    if len(together) > 1:
        yield CodeAction(ALL, together, None, True)


def all_safe(found: Iterable[Diagnostic], file: str) -> tuple[Fix, ...]:
    """The safe fixes of a file that do not overlap, in source order."""
    fixes = {fix for each in found for fix in each.fixes
             if fix.applicability is Applicability.SAFE and fix.span.file == file}  # fmt: skip
    kept: list[Fix] = []
    for fix in sorted(fixes, key=lambda one: (one.span.start, one.span.end, one.replacement)):
        if not kept or fix.span.start >= kept[-1].span.end:
            kept.append(fix)
    return tuple(kept)


def _ignore(found: Diagnostic, span: Span, text: str) -> Fix:
    """A fix that inserts an ignore comment before the line of the finding.

    The author must write the reason: without one, the comment ignores nothing and is reported.
    """
    line = text.rfind("\n", 0, span.start) + 1
    blank = text[line : line + len(text[line:]) - len(text[line:].lstrip(" \t"))]
    ending = "\r\n" if text[: text.find("\n") + 1].endswith("\r\n") else "\n"
    comment = f"{blank}// rtshcua: ignore {found.code.id} because{ending}"
    return Fix(Span(span.file, line, line), comment, f"ignore `{found.code.slug}`")
