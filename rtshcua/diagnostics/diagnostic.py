"""One finding for the person who reads it: a stable code, the exact span, what was found, what would be accepted."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from rtshcua.diagnostics.codes import Code, Severity
from rtshcua.diagnostics.span import Span


class Applicability(Enum):
    """Whether a fix keeps the author's meaning (`SAFE`) or needs the author's judgement (`SUGGESTED`)."""

    SAFE = "safe"
    SUGGESTED = "suggested"


@dataclass(frozen=True, slots=True)
class Label:
    """A further place that explains the finding, with a few words under it."""

    span: Span
    text: str


@dataclass(frozen=True, slots=True)
class Fix:
    """Replace the text under `span` by `replacement`: the nearest change that would be accepted."""

    span: Span
    replacement: str
    title: str
    applicability: Applicability = Applicability.SUGGESTED


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """A finding.

    `message` is lower case, without a full stop, user text in backticks; `help` says what would be accepted.
    `span` is None only where there is no source text; `pointer` is the JSON Pointer (RFC 6901) into a mission
    specification when the finding is about structured input.
    """

    code: Code
    message: str
    span: Span | None = None
    help: str | None = None
    labels: tuple[Label, ...] = ()
    fixes: tuple[Fix, ...] = ()
    pointer: str | None = None

    @property
    def severity(self) -> Severity:
        """The severity of its code."""
        return self.code.severity


def has_errors(diagnostics: Iterable[Diagnostic]) -> bool:
    """Whether any of the findings forbids going on."""
    return any(d.severity is Severity.ERROR for d in diagnostics)
