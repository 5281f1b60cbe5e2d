"""The open texts of an editor, their findings, and when findings are published.

After a change, findings are published twice: at once those of the parser and the checks of declarations; after a pause
also those of lowering, proofs and lint rules, from another process. Findings of an older text are never published for a
newer one, except if only comments and blanks changed: then all findings are kept and moved.
"""

import asyncio
import gc
import logging
import os
from collections.abc import Callable

from lsprotocol import types as lsp

from rtshcua.adapters.store.source_access import ReadableSources
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.front.lsp.disk import desk, name_of, path_of
from rtshcua.front.lsp.prover import Found, Proving
from rtshcua.front.lsp.searching import Searching
from rtshcua.front.lsp.texts import OpenText, Texts, diagnostic
from rtshcua.ground.editor.incremental_parse import ParsedText, moved_finding
from rtshcua.ground.editor.positions import LineIndex, TextChange, edited
from rtshcua.ground.pipeline.program import check_declared
from rtshcua.mavlink import dialect

log = logging.getLogger("rtshcua.lsp")

AT_ONCE = 0.005
"""How long a check waits for a further change, in seconds."""
PAUSE = 0.25
"""The time without a change after which proofs begin, in seconds."""
_IGNORE = "rtshcua:"


class EditorSession(Texts):
    """The session of one editor. `tell` publishes the findings of a text, `say` shows an error to the user."""

    def __init__(
        self,
        library: str,
        tell: Callable[[lsp.PublishDiagnosticsParams], None],
        say: Callable[[str], None] = log.warning,
    ) -> None:
        self._readable = ReadableSources(library)
        super().__init__(desk(library, self._readable), library, dialect.load())
        self._tell = tell
        self._proving = Proving(library, say)
        self.searching = Searching()
        self._soon: asyncio.TimerHandle | None = None
        self._later: asyncio.TimerHandle | None = None
        self._told: set[str] = set()  # files that the editor has findings of
        self._last: dict[str, list[lsp.Diagnostic]] = {}  # and which

    def end(self) -> None:
        """Stop all running work."""
        for timer in (self._soon, self._later):
            if timer is not None:
                timer.cancel()
        self._proving.end()
        self.searching.end()

    # ------------------------------------------------------------------------------------------ what is open

    def look_in(self, folders: list[str]) -> None:
        """Set the folders of the workspace; imports may lead only to these."""
        self.folders = folders
        self._readable.folders = [os.path.realpath(each) for each in folders]

    def open(self, uri: str, version: int, text: str) -> None:
        """Open a text. Without a workspace, its project becomes one."""
        name = name_of(uri)
        if not self.folders and path_of(uri) is not None:
            self._readable.ask(name)
        self.opened[name] = OpenText(uri, version, LineIndex(text, self.encoding))
        self.desk.put(name, text)
        self.desk.forget()
        gc.freeze()  # open texts live long: the garbage collector skips them
        self._outdated(None, first=name)

    def change(self, uri: str, version: int, changes: list[TextChange]) -> None:
        """Change an open text."""
        name = name_of(uri)
        opened = self.opened.get(name)
        if opened is None:
            log.warning("a change to %s, which is not open", uri)
            return
        old = opened.lines.text
        opened.lines = edited(opened.lines, changes)
        opened.version = version
        cut = self.desk.put(name, opened.lines.text)
        self._outdated(name, cut if _only_moves(old, cut) else None)

    def close(self, uri: str) -> None:
        """Close a text: use the file on the disk again, and clear its findings."""
        name = name_of(uri)
        gone = self.opened.pop(name, None)
        if gone is not None:
            self._proving.forget(name)
            self._last.pop(name, None)
            self._tell(lsp.PublishDiagnosticsParams(gone.uri, []))
            self.desk.close(name)
            self._outdated(None)

    def reread(self) -> None:
        """Read files again after they changed on the disk."""
        self.desk.forget()
        self._outdated(None)

    # -------------------------------------------------------------------------------------------- what is found

    def _outdated(self, name: str | None, moves: ParsedText | None = None, first: str | None = None) -> None:
        """What depends on a file (None: everything) is checked again; where `moves` is given, it says the same."""
        for own, opened in self.opened.items():
            if name is None or own == name or name in opened.files:
                known = moves is not None and opened.quick_stamp == opened.stamp
                opened.stamp += 1
                if moves is None or not known:
                    opened.whole = None
                else:
                    opened.quick, opened.quick_stamp = _moved(opened.quick, moves), opened.stamp
                    opened.whole = None if opened.whole is None else _moved(opened.whole, moves)
        loop = asyncio.get_running_loop()
        if self._soon is None:
            self._soon = loop.call_later(AT_ONCE, self._check, first or name)
        if self._later is not None:
            self._later.cancel()
        self._later = loop.call_later(PAUSE, self._prove)

    def _check(self, first: str | None) -> None:
        """Checks declarations, those of the file that was changed first."""
        self._soon = None
        waiting = [each for each, opened in self.opened.items() if opened.quick_stamp != opened.stamp]
        waiting.sort(key=lambda each: each != first)
        if not waiting:
            self._publish(first)
            return
        name = waiting[0]
        self._quick(name, self.opened[name])
        self._publish(name)
        if len(waiting) > 1:  # others may wait until the loop has looked for newer changes
            self._soon = asyncio.get_running_loop().call_later(AT_ONCE, self._check, None)

    def _quick(self, name: str, opened: OpenText) -> None:
        view = self.desk.view(name)
        opened.quick_stamp = opened.stamp
        opened.files = frozenset(view.program.sources)
        opened.quick = check_declared(view.program, self.dialect)

    def _prove(self) -> None:
        self._later = None
        texts = {name: opened.lines.text for name, opened in self.opened.items()}
        for name, opened in self.opened.items():
            if opened.whole_stamp != opened.stamp:
                self._proving.ask(name, texts, self._taker(name, opened.stamp), self._readable.edges)

    def _taker(self, name: str, stamp: int) -> Callable[[Found], None]:
        def take(found: Found) -> None:
            opened = self.opened.get(name)
            if opened is not None and opened.stamp == stamp and found is not None:
                opened.whole, opened.whole_stamp, opened.quick_stamp = found, stamp, stamp
                self._publish()

        return take

    def findings(self, name: str) -> tuple[Diagnostic, ...]:
        """The findings of a file from the programs of all open texts, each once."""
        found: dict[tuple[object, ...], Diagnostic] = {}
        for own, opened in self.opened.items():
            for each in opened.found:
                file = own if each.span is None else each.span.file
                if file == name:
                    found.setdefault((each.code, each.span, each.message), each)
        return tuple(found.values())

    def _publish(self, changed: str | None = None) -> None:
        """Publish new findings, and in any case those of the changed text."""
        if changed is not None and any(each.quick_stamp != each.stamp for each in self.opened.values()):
            self._publish_one(changed)  # the other texts are not checked yet
            return
        files = {own if each.span is None else each.span.file
                 for own, opened in self.opened.items() for each in opened.found}  # fmt: skip
        for name in sorted(files | self._told | set(self.opened), key=lambda each: each != changed):
            self._publish_one(name, always=name == changed)
        self._told = files

    def _publish_one(self, name: str, *, always: bool = True) -> None:
        lines = self.lines(name)
        found = [] if lines is None else [
            diagnostic(each, lines, self.locate, self.page) for each in self.findings(name)
        ]  # fmt: skip
        if always or self._last.get(name, []) != found:
            opened = self.opened.get(name)
            version = None if opened is None else opened.version
            self._tell(lsp.PublishDiagnosticsParams(self.uri(name), found, version))
        self._last[name] = found


def _only_moves(old: str, cut: ParsedText) -> bool:
    """Whether an edit changed nothing but comments, and none that ignores findings."""
    if cut.since is None:
        return False
    start, end, length = cut.since
    new = cut.source.text
    around = (old[old.rfind("\n", 0, start) + 1 : end + 200], new[new.rfind("\n", 0, start) + 1 : start + length + 200])
    return not any(_IGNORE in each for each in around)


def _moved(found: tuple[Diagnostic, ...], cut: ParsedText) -> tuple[Diagnostic, ...]:
    assert cut.since is not None
    by = cut.since.length - (cut.since.end - cut.since.start)
    return tuple(moved_finding(each, by, cut.since.end, cut.source.file) for each in found)
