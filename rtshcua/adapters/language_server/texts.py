"""The texts of an editor's session, and where things are in them; a copy of it is what a long search works on."""

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, field
from pathlib import Path

from lsprotocol import types as lsp

from rtshcua.adapters.files.project import Project, Projects
from rtshcua.adapters.language_server import convert
from rtshcua.adapters.language_server.disk import sources
from rtshcua.adapters.language_server.uris import name_of, uri_of
from rtshcua.diagnostics.codes import Code
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Span
from rtshcua.ground.editor.desk import Desk, View
from rtshcua.ground.editor.pieces import Cut
from rtshcua.ground.editor.positions import Encoding, Lines
from rtshcua.ground.language.paths import shown
from rtshcua.ground.project.settings import FormatSettings
from rtshcua.mavlink.dialect import Dialect


@dataclass(slots=True)
class Opened:
    """One text that is open: as the editor calls it, its lines, and what was found in the program that it makes."""

    uri: str
    version: int
    lines: Lines
    stamp: int = 0  # goes up with every change of the program
    quick: tuple[Diagnostic, ...] = ()
    whole: tuple[Diagnostic, ...] | None = None  # None: not known for the present text
    files: frozenset[str] = frozenset()
    quick_stamp: int = -1  # of the text that `quick` is about
    whole_stamp: int = -1  # of the text that was proved

    @property
    def found(self) -> tuple[Diagnostic, ...]:
        """What is known of the present text; nothing while it waits to be looked at."""
        if self.quick_stamp != self.stamp:
            return ()
        return self.quick if self.whole is None else self.whole


@dataclass(eq=False)
class Texts:
    """What is open, over what is on the disk, and how the editor counts and calls it."""

    desk: Desk
    library: str
    dialect: Dialect
    encoding: Encoding = Encoding.UTF_16
    folders: list[str] = field(default_factory=list)
    versioned: bool = False  # whether the editor takes changes that name the version they are for
    opened: dict[str, Opened] = field(default_factory=dict)

    def copied(self) -> "Texts":
        """The same as they are just now, for another thread: what is found in them is true of these versions."""
        opened = {name: copy(each) for name, each in self.opened.items()}
        desk = self.desk.with_texts({})
        return Texts(desk, self.library, self.dialect, self.encoding, list(self.folders), self.versioned, opened)

    def view(self, uri: str) -> tuple[View, str]:
        """The program of a text, and its name."""
        name = name_of(uri)
        return self.desk.view(name), name

    def cut(self, uri: str) -> Cut | None:
        """A text that is open."""
        return self.desk.open.get(name_of(uri))

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

    def lines(self, name: str) -> Lines | None:
        """The lines of a file, open or not."""
        opened = self.opened.get(name)
        if opened is not None:
            return opened.lines
        text = self.desk.text(name)
        return None if text is None else Lines(text, self.encoding)

    def uri(self, name: str) -> str:
        """What the editor calls a file."""
        opened = self.opened.get(name)
        return uri_of(name) if opened is None else opened.uri

    def locate(self, span: Span) -> lsp.Location | None:
        """A place in any file; None where the file is gone."""
        lines = self.lines(span.file)
        return None if lines is None else lsp.Location(self.uri(span.file), convert.range_of(lines, *span[1:]))

    def page(self, code: Code) -> str | None:
        """Where a code is explained."""
        return uri_of(f"{self.library}/docs/codes/{code.id}.md")
