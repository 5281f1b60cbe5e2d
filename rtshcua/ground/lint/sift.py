"""What is left of findings when what a project ignores is taken out, and what it ignores for nothing."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple

from rtshcua.diagnostics.codes import NOT_FORMATTED, can_be_ignored
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.lint.ignores import Ignore, ignores, unused
from rtshcua.ground.project.settings import Ignored


class Suppressed(NamedTuple):
    """A finding that is ignored, why, and where that is written; None where it is written in a configuration."""

    diagnostic: Diagnostic
    reason: str
    at: Span | None


class Sifted(NamedTuple):
    """What is found all the same, what is ignored, and the ignores of configurations that ignored something."""

    found: tuple[Diagnostic, ...]
    ignored: tuple[Suppressed, ...]
    used: frozenset[Ignored]


def sift(
    found: Iterable[Diagnostic],
    sources: Mapping[str, Source],
    asked: Collection[str],
    configured: Mapping[str, Sequence[Ignored]],
    untold: Collection[str] = (),
    laid: Collection[str] = (),
) -> Sifted:
    """Take out what is ignored by a comment in the same file, or by the configuration of that file (`configured`).

    Only the files that were `asked` for are searched for comments. `untold` are those of which not everything was
    looked for, because of errors: there an ignore may well be used when these are corrected. `laid` are those whose
    layout was looked at: of others an ignore of it is neither used nor unused.
    """
    written = {file: ignores(sources[file]) for file in asked if file in sources}
    kept: list[Diagnostic] = []
    taken: list[Suppressed] = []
    by_comment: set[Ignore] = set()
    by_project: set[Ignored] = set()
    for each in found:
        span = each.span
        if span is None or not can_be_ignored(each.code):
            kept.append(each)
            continue
        line = sources[span.file].position(span.start).line if span.file in sources else 0
        given = written[span.file].given if span.file in written else ()
        mine = [one for one in given if one.code is each.code and one.line in (None, line)]
        projects = [one for one in configured.get(span.file, ()) if one.code is each.code]
        by_comment.update(mine)
        by_project.update(projects)
        if mine:
            taken.append(Suppressed(each, mine[0].reason, mine[0].span))
        elif projects:
            taken.append(Suppressed(each, projects[0].reason, None))
        else:
            kept.append(each)
    for file, here in written.items():
        kept += here.faults
        for one in here.given if file not in untold else ():
            if one not in by_comment and (one.code is not NOT_FORMATTED or file in laid):
                kept.append(unused(one))
    return Sifted(tuple(kept), tuple(taken), frozenset(by_project))
