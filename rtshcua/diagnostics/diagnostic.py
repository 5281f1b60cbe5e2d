"""A diagnostic: a stable code, a message, the exact span, and the nearest fix."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import Enum

from rtshcua.diagnostics.codes import UNKNOWN_NAME, UNKNOWN_ROLE, Code, Severity
from rtshcua.diagnostics.span import Span


class Applicability(Enum):
    """Whether a fix keeps the author's meaning (`SAFE`) or needs the author's judgement (`SUGGESTED`)."""

    SAFE = "safe"
    SUGGESTED = "suggested"


@dataclass(frozen=True, slots=True)
class Label:
    """A further place that explains the finding, with a short text."""

    span: Span
    text: str


@dataclass(frozen=True, slots=True)
class Fix:
    """A change that makes the source valid: replace the text under `span` by `replacement`."""

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
    """Whether any of the findings is an error."""
    return any(d.severity is Severity.ERROR for d in diagnostics)


#: how many further places of a folded finding are shown
MOST_PLACES = 3
_FOLDED = (UNKNOWN_NAME, UNKNOWN_ROLE)


def folded(found: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Merge the findings about the same missing name into the first of them, with a count.

    Findings on a specification are not merged: each has its own pointer.
    """
    kept: list[Diagnostic] = []
    at: dict[tuple[str, str], int] = {}
    others: dict[int, list[Diagnostic]] = {}
    for each in found:
        key = (each.code.id, each.message)
        if each.code not in _FOLDED or each.span is None or each.pointer is not None:
            kept.append(each)
        elif key in at:
            others.setdefault(at[key], []).append(each)
        else:
            at[key] = len(kept)
            kept.append(each)
    for place, more in others.items():
        labels = tuple(Label(each.span, "also here") for each in more[:MOST_PLACES] if each.span is not None)
        message = f"{kept[place].message} ({len(more) + 1} places)"
        kept[place] = replace(kept[place], message=message, labels=(*kept[place].labels, *labels))
    return tuple(kept)
