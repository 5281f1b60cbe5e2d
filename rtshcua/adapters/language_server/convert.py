"""Our places, findings and proposals as those of the protocol."""

from collections.abc import Callable

from lsprotocol import types as lsp

from rtshcua.diagnostics.codes import Code, Severity
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Span
from rtshcua.ground.editor.positions import Lines, Place

SOURCE = "rtshcua"
_SEVERITIES = {
    Severity.ERROR: lsp.DiagnosticSeverity.Error,
    Severity.WARNING: lsp.DiagnosticSeverity.Warning,
    Severity.NOTE: lsp.DiagnosticSeverity.Information,
}
#: findings on what is there for nothing, which editors show faded
_UNNECESSARY = frozenset({"E1301", "E1305", "E0720", "E0721", "E0722"})

SYMBOLS = {
    "enum": lsp.SymbolKind.Enum, "signal": lsp.SymbolKind.Variable, "zone": lsp.SymbolKind.Object,
    "vehicle": lsp.SymbolKind.Struct, "skill": lsp.SymbolKind.Function, "template": lsp.SymbolKind.Interface,
    "policy": lsp.SymbolKind.Class, "mission": lsp.SymbolKind.Module, "nominal": lsp.SymbolKind.Constant,
    "test": lsp.SymbolKind.Method, "member": lsp.SymbolKind.EnumMember, "phase": lsp.SymbolKind.Namespace,
    "parameter": lsp.SymbolKind.Field,
}  # fmt: skip
ITEMS = {
    "keyword": lsp.CompletionItemKind.Keyword, "skill": lsp.CompletionItemKind.Function,
    "signal": lsp.CompletionItemKind.Variable, "zone": lsp.CompletionItemKind.Class,
    "parameter": lsp.CompletionItemKind.Property, "member": lsp.CompletionItemKind.EnumMember,
    "unit": lsp.CompletionItemKind.Unit, "file": lsp.CompletionItemKind.File, "field": lsp.CompletionItemKind.Field,
    "type": lsp.CompletionItemKind.TypeParameter, "policy": lsp.CompletionItemKind.Module,
    "template": lsp.CompletionItemKind.Interface, "vehicle": lsp.CompletionItemKind.Struct,
}  # fmt: skip


def position(place: Place) -> lsp.Position:
    """A place."""
    return lsp.Position(place.line, place.column)


def place(at: lsp.Position) -> Place:
    """A place of the editor's."""
    return Place(at.line, at.character)


def range_of(lines: Lines, start: int, end: int) -> lsp.Range:
    """A range of characters."""
    return lsp.Range(position(lines.place(start)), position(lines.place(end)))


def diagnostic(
    found: Diagnostic, lines: Lines, locate: Callable[[Span], lsp.Location | None], page: Callable[[Code], str | None]
) -> lsp.Diagnostic:
    """A finding in the file of `lines`; one without a place is at its beginning. `page` is where a code is told."""
    span = found.span
    further = [lsp.DiagnosticRelatedInformation(at, label.text) for label in found.labels
               if (at := locate(label.span)) is not None]  # fmt: skip
    href = page(found.code)
    return lsp.Diagnostic(
        range=range_of(lines, *(span.start, span.end) if span is not None else (0, 0)),
        message=found.message if found.help is None else f"{found.message}\nhelp: {found.help}",
        severity=_SEVERITIES[found.severity],
        code=found.code.id,
        code_description=None if href is None else lsp.CodeDescription(href),
        source=SOURCE,
        tags=[lsp.DiagnosticTag.Unnecessary] if found.code.id in _UNNECESSARY else None,
        related_information=further or None,
    )
