"""Convert findings to plain lists for a cache, and back. Malformed lists are refused."""

from collections.abc import Iterator
from typing import Any

from rtshcua.diagnostics.codes import REGISTRY
from rtshcua.diagnostics.diagnostic import Applicability, Diagnostic, Fix, Label
from rtshcua.diagnostics.span import Span


def findings_as_lists(found: tuple[Diagnostic, ...]) -> list[Any]:
    """Return findings as lists that `json` can encode."""
    return [
        [
            each.code.id,
            each.message,
            each.span,
            each.help,
            [[label.span, label.text] for label in each.labels],
            [[fix.span, fix.replacement, fix.title, fix.applicability.value] for fix in each.fixes],
            each.pointer,
        ]
        for each in found
    ]


def findings_from_lists(lists: Any) -> tuple[Diagnostic, ...]:
    """Return the findings that these lists encode. Raises ValueError, KeyError or TypeError for malformed lists.

    The caller checks that the spans lie within the source text.
    """
    return tuple(
        Diagnostic(
            REGISTRY[code],
            _str(message),
            None if span is None else _span(*span),
            _optional_str(help),
            tuple(Label(_span(*place), _str(text)) for place, text in labels),
            tuple(
                Fix(_span(*place), _str(replacement), _str(title), Applicability(applicability))
                for place, replacement, title, applicability in fixes
            ),
            _optional_str(pointer),
        )
        for code, message, span, help, labels, fixes, pointer in lists
    )


def spans_of(found: tuple[Diagnostic, ...]) -> Iterator[Span]:
    """Yield every span that findings, their labels and their fixes refer to."""
    for each in found:
        if each.span is not None:
            yield each.span
        yield from (label.span for label in each.labels)
        yield from (fix.span for fix in each.fixes)


def _str(found: Any) -> str:
    if type(found) is not str:
        raise TypeError("expected a string")
    return found


def _optional_str(found: Any) -> str | None:
    return None if found is None else _str(found)


def _span(file: Any, start: Any, end: Any) -> Span:
    if type(start) is not int or type(end) is not int or not 0 <= start <= end:
        raise TypeError("expected a span")
    return Span(_str(file), start, end)
