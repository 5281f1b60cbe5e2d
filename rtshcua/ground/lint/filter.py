"""Select the findings to report: those that are not ignored and that every program with the file has."""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

from rtshcua.diagnostics.codes import NOT_FORMATTED, can_be_ignored
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.lint.ignores import Ignore, Ignores, ignores, unused_ignore
from rtshcua.ground.project.project_settings import IgnoredCode


class Suppressed(NamedTuple):
    """An ignored finding, the reason, and the span of the comment (None if a configuration ignores it)."""

    diagnostic: Diagnostic
    reason: str
    at: Span | None


class FilteredFindings(NamedTuple):
    """The findings to report, the ignored findings, and the configured ignores that had an effect."""

    found: tuple[Diagnostic, ...]
    ignored: tuple[Suppressed, ...]
    used: frozenset[IgnoredCode]


def filter_findings(
    found: Iterable[Diagnostic],
    sources: Mapping[str, Source],
    requested: Collection[str],
    configured: Mapping[str, Sequence[IgnoredCode]],
    incomplete: Collection[str] = (),
    formatted: Collection[str] = (),
) -> FilteredFindings:
    """Separate findings that a comment in the same file, or the configuration of that file (`configured`), ignores.

    Comments are read only in the `requested` files. Files with errors are `incomplete`: they have no unused ignores,
    since an ignore may have an effect once the errors are corrected. `formatted` are the files whose layout was
    checked: in other files an ignored layout is neither used nor unused.
    """
    written = {file: ignores(sources[file]) for file in requested if file in sources}
    kept: list[Diagnostic] = []
    taken: list[Suppressed] = []
    by_comment: set[Ignore] = set()
    by_project: set[IgnoredCode] = set()
    for each in found:
        comments, settings = _ignores_of(each, sources, written, configured)
        by_comment.update(comments)
        by_project.update(settings)
        if comments:
            taken.append(Suppressed(each, comments[0].reason, comments[0].span))
        elif settings:
            taken.append(Suppressed(each, settings[0].reason, None))
        else:
            kept.append(each)
    for file, here in written.items():
        unused = [] if file in incomplete else [one for one in here.valid if one not in by_comment]
        kept += here.faults
        kept += [unused_ignore(one) for one in unused if one.code is not NOT_FORMATTED or file in formatted]
    return FilteredFindings(tuple(kept), tuple(taken), frozenset(by_project))


def _ignores_of(
    found: Diagnostic,
    sources: Mapping[str, Source],
    written: Mapping[str, Ignores],
    configured: Mapping[str, Sequence[IgnoredCode]],
) -> tuple[list[Ignore], list[IgnoredCode]]:
    """Return the comments and the settings that ignore a finding."""
    span = found.span
    if span is None or not can_be_ignored(found.code):
        return [], []
    line = sources[span.file].position(span.start).line if span.file in sources else 0
    valid = written[span.file].valid if span.file in written else ()
    comments = [one for one in valid if one.code is found.code and one.line in (None, line)]
    return comments, [one for one in configured.get(span.file, ()) if one.code is found.code]


class Linted(NamedTuple):
    """The files of one program and its findings."""

    files: frozenset[str]
    found: tuple[Diagnostic, ...]


def agreed(programs: Sequence[Linted]) -> tuple[Diagnostic, ...]:
    """Return the findings in each file that every program with that file has: a name used by one of them is used."""
    counts = Counter(found for program in programs for found in program.found)
    members = Counter(file for program in programs for file in program.files)
    return tuple(
        found for found, count in counts.items() if found.span is not None and count == members[found.span.file]
    )
