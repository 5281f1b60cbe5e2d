"""The table of source files that spans on board refer to, with the digest of each."""

from collections.abc import Mapping

from rtshcua.diagnostics.span import Span
from rtshcua.ground.checker.report import Report
from rtshcua.model.flat.limits import MAX_TEXT


def shortened(text: str) -> str:
    """The text as it is carried on board."""
    return text if len(text) <= MAX_TEXT else text[: MAX_TEXT - 3] + "..."


class Files:
    """File names by index, in the order in which they are first referred to; `stable` are the names that are signed."""

    def __init__(self, report: Report, stable: Mapping[str, str]) -> None:
        self._report = report
        self._stable = stable
        self._index: dict[str, int] = {}

    def index(self, file: str) -> int:
        """The index of a file."""
        return self._index.setdefault(file, len(self._index))

    def place(self, span: Span) -> tuple[str, int, int, int]:
        """A span as it is carried on board: its text, its file's index, its start and its end."""
        return shortened(self._report.text(span)), self.index(span.file), span.start, span.end

    def span(self, file: int, start: int, end: int) -> Span:
        """The span that a place on board came from."""
        return Span(tuple(self._index)[file], start, end)

    def text(self, span: Span) -> str:
        """All of the text under a span, on one line."""
        return self._report.text(span)

    @property
    def names(self) -> tuple[str, ...]:
        """The files' names, as they are signed."""
        return tuple(self._stable.get(name, name) for name in self._index)

    @property
    def digests(self) -> tuple[bytes, ...]:
        """The SHA-256 of each file's text in UTF-8."""
        return tuple(self._report.digest(name) for name in self._index)


class Joint(Files):
    """The files of a policy, and after them those of a mission: what a step's own clauses refer to.

    On board, in bundles and in logs, a clause's `source` counts the policy's sources first, then its mission's.
    """

    def __init__(self, policy: Files, mission: Files) -> None:
        super().__init__(policy._report, mission._stable)
        self._policy = policy
        self._mission = mission

    def index(self, file: str) -> int:
        """The index of a file."""
        own = self._policy._index.get(file)
        return len(self._policy._index) + self._mission.index(file) if own is None else own

    def span(self, file: int, start: int, end: int) -> Span:
        """The span that a place came from."""
        first = len(self._policy._index)
        return self._policy.span(file, start, end) if file < first else self._mission.span(file - first, start, end)
