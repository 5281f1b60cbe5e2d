"""The texts of an editor's session, and where things are in them, in the terms of the protocol.

A copy of them is what a long search works on.
"""

from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from lsprotocol import types as lsp

from rtshcua.adapters.store.project import Project, Projects
from rtshcua.diagnostics.codes import Code, Severity
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Span
from rtshcua.front.lsp.disk import name_of, sources, uri_of
from rtshcua.ground.editor.incremental_parse import ParsedText
from rtshcua.ground.editor.positions import Encoding, LineIndex, TextPosition
from rtshcua.ground.editor.workspace import ProgramView, Workspace
from rtshcua.ground.language.paths import shown
from rtshcua.ground.project.project_settings import FormatSettings
from rtshcua.mavlink.dialect import Dialect

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
    "role": lsp.SymbolKind.Key,
    "policy": lsp.SymbolKind.Class, "mission": lsp.SymbolKind.Module, "nominal": lsp.SymbolKind.Constant,
    "test": lsp.SymbolKind.Method, "member": lsp.SymbolKind.EnumMember, "phase": lsp.SymbolKind.Namespace,
    "scenario": lsp.SymbolKind.Method, "parameter": lsp.SymbolKind.Field,
}  # fmt: skip
ITEMS = {
    "keyword": lsp.CompletionItemKind.Keyword, "skill": lsp.CompletionItemKind.Function,
    "fault": lsp.CompletionItemKind.Event,
    "signal": lsp.CompletionItemKind.Variable, "zone": lsp.CompletionItemKind.Class,
    "parameter": lsp.CompletionItemKind.Property, "member": lsp.CompletionItemKind.EnumMember,
    "unit": lsp.CompletionItemKind.Unit, "file": lsp.CompletionItemKind.File, "field": lsp.CompletionItemKind.Field,
    "type": lsp.CompletionItemKind.TypeParameter, "policy": lsp.CompletionItemKind.Module,
    "template": lsp.CompletionItemKind.Interface, "vehicle": lsp.CompletionItemKind.Struct,
    "command": lsp.CompletionItemKind.Event, "flight mode": lsp.CompletionItemKind.EnumMember,
}  # fmt: skip


@dataclass(slots=True)
class OpenText:
    """An open text: its URI, version and lines, and the findings of its program."""

    uri: str
    version: int
    lines: LineIndex
    stamp: int = 0  # increases with every change of the program
    quick: tuple[Diagnostic, ...] = ()
    whole: tuple[Diagnostic, ...] | None = None  # None: not known for the present text
    files: frozenset[str] = frozenset()
    quick_stamp: int = -1  # of the text that `quick` is about
    whole_stamp: int = -1  # of the text that was proved

    @property
    def found(self) -> tuple[Diagnostic, ...]:
        """The findings of the present text; empty until it is checked."""
        if self.quick_stamp != self.stamp:
            return ()
        return self.quick if self.whole is None else self.whole


class Spot(NamedTuple):
    """A position in a text: its program, the name and lines of the first file, and the character offset."""

    view: ProgramView
    name: str
    lines: LineIndex
    offset: int


@dataclass(eq=False)
class Texts:
    """The open texts over the files of the disk, and the editor's encoding and URIs."""

    desk: Workspace
    library: str
    dialect: Dialect
    encoding: Encoding = Encoding.UTF_16
    folders: list[str] = field(default_factory=list)
    versioned: bool = False  # whether the editor accepts versioned changes
    opened: dict[str, OpenText] = field(default_factory=dict)

    def copied(self) -> "Texts":
        """A copy of the present texts for another thread."""
        opened = {name: copy(each) for name, each in self.opened.items()}
        desk = self.desk.with_texts({})
        return Texts(desk, self.library, self.dialect, self.encoding, list(self.folders), self.versioned, opened)

    def spot(self, uri: str, at: lsp.Position) -> Spot | None:
        """A position in a text; None if there is no such text."""
        name = name_of(uri)
        lines = self.lines(name)
        return None if lines is None else Spot(self.desk.view(name), name, lines, lines.offset(place(at)))

    def cut(self, uri: str) -> tuple[ParsedText, LineIndex] | None:
        """An open text and its lines; None if it is not open."""
        cut = self.desk.open.get(name_of(uri))
        lines = None if cut is None else self.lines(cut.source.file)
        return None if cut is None or lines is None else (cut, lines)

    def workspace(self) -> Iterator[str]:
        """The names of all sources of the workspace."""
        return (shown(path) for path in sources(self.folders))

    def layout(self, name: str) -> FormatSettings | None:
        """How the project lays out a file; None where it leaves it out. A configuration that is none counts for
        nothing, which `rtshcua lint` and `rtshcua fmt` tell of.
        """
        project = Projects().of(Path(name))
        if not isinstance(project, Project):
            return FormatSettings()
        settings = project.settings.format
        return None if project.excludes(Path(name), settings.exclude) else settings

    def lines(self, name: str) -> LineIndex | None:
        """The lines of a file, open or not."""
        opened = self.opened.get(name)
        if opened is not None:
            return opened.lines
        text = self.desk.text(name)
        return None if text is None else LineIndex(text, self.encoding)

    def uri(self, name: str) -> str:
        """The URI of a file in the editor."""
        opened = self.opened.get(name)
        return uri_of(name) if opened is None else opened.uri

    def locate(self, span: Span) -> lsp.Location | None:
        """The location of a span in any file; None if the file is gone."""
        lines = self.lines(span.file)
        return None if lines is None else lsp.Location(self.uri(span.file), range_of(lines, *span[1:]))

    def page(self, code: Code) -> str | None:
        """The URI of the page about a code."""
        return uri_of(f"{self.library}/docs/codes/{code.id}.md")


def position(place: TextPosition) -> lsp.Position:
    """Convert a position for the protocol."""
    return lsp.Position(place.line, place.column)


def place(at: lsp.Position) -> TextPosition:
    """Convert a position from the protocol."""
    return TextPosition(at.line, at.character)


def range_of(lines: LineIndex, start: int, end: int) -> lsp.Range:
    """The range between two character offsets."""
    return lsp.Range(position(lines.place(start)), position(lines.place(end)))


def diagnostic(
    found: Diagnostic,
    lines: LineIndex,
    locate: Callable[[Span], lsp.Location | None],
    page: Callable[[Code], str | None],
) -> lsp.Diagnostic:
    """Convert a finding in the file of `lines`; without a span it is at the beginning. `page` gives a code's page."""
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
