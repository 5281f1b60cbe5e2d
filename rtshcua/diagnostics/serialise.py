"""Findings as JSON for agents, editors and scripts. Offsets count characters from 0, lines and columns from 1."""

from collections.abc import Iterable, Mapping
from typing import Any, Final

from rtshcua.diagnostics.diagnostic import Diagnostic, Fix, Label
from rtshcua.diagnostics.span import Source, Span

FORMAT: Final = "rtshcua/diagnostics"
VERSION: Final = 1


def as_json(diagnostics: Iterable[Diagnostic], sources: Mapping[str, Source]) -> dict[str, Any]:
    """Return all findings as a value for `json.dumps`. Every key is present, with null where it does not apply."""
    found = [_diagnostic(diagnostic, sources) for diagnostic in diagnostics]
    return {"format": FORMAT, "version": VERSION, "diagnostics": found}


def _diagnostic(diagnostic: Diagnostic, sources: Mapping[str, Source]) -> dict[str, Any]:
    return {
        "code": diagnostic.code.id,
        "slug": diagnostic.code.slug,
        "severity": diagnostic.severity.value,
        "message": diagnostic.message,
        "help": diagnostic.help,
        "at": _span(diagnostic.span, sources),
        "pointer": diagnostic.pointer,
        "labels": [_label(label, sources) for label in diagnostic.labels],
        "fixes": [_fix(fix, sources) for fix in diagnostic.fixes],
    }


def _label(label: Label, sources: Mapping[str, Source]) -> dict[str, Any]:
    return {"text": label.text, "at": _span(label.span, sources)}


def _fix(fix: Fix, sources: Mapping[str, Source]) -> dict[str, Any]:
    return {
        "title": fix.title,
        "replacement": fix.replacement,
        "applicability": fix.applicability.value,
        "at": _span(fix.span, sources),
    }


def _span(span: Span | None, sources: Mapping[str, Source]) -> dict[str, Any] | None:
    if span is None:
        return None
    place: dict[str, Any] = {"file": span.file, "start": span.start, "end": span.end}
    source = sources.get(span.file)
    if source is not None:
        place["line"], place["column"] = source.position(span.start)
        place["end_line"], place["end_column"] = source.position(span.end)
    return place
