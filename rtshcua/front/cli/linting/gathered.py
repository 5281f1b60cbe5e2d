"""Everything that a run found, together: each thing once, without what is ignored."""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import NamedTuple

from rtshcua.diagnostics.diagnostic import Diagnostic, has_errors
from rtshcua.diagnostics.span import Source, Span
from rtshcua.front.cli.linting.examined import Examined
from rtshcua.ground.lint.filter import Linted, Suppressed, agreed, filter_findings
from rtshcua.ground.project.settings import IgnoredCode


class Gathered(NamedTuple):
    """Findings by file and place, those that are ignored, the texts, and the configured ignores that were of use."""

    found: tuple[Diagnostic, ...]
    ignored: tuple[Suppressed, ...]
    sources: Mapping[str, Source]
    used: frozenset[IgnoredCode]
    untold: frozenset[str]


def gathered(
    programs: Sequence[Examined],
    sources: Callable[[Sequence[str]], dict[str, Source]],
    configured: Mapping[str, Sequence[IgnoredCode]],
    asked: Sequence[str],
    laid: Collection[str] = (),
) -> Gathered:
    """Put programs together. `configured` has the ignores of each file's configuration; `laid` are the files whose
    layout was looked at.
    """
    every: dict[tuple[object, ...], Diagnostic] = {}
    linted: list[Linted] = []
    untold: set[str] = set()
    for program in programs:
        assert program.result is not None
        for each in program.result.found:  # a file that two programs share has its findings once
            every.setdefault((each.code, each.span, each.message), each)
        linted.append(Linted(frozenset(program.members), program.result.habits))
        if has_errors(program.result.found):
            untold.update(program.members, program.reads)
    found = (*every.values(), *agreed(linted))
    order = {name: number for number, name in enumerate(asked)}
    spans = [each.span for each in found] + [label.span for each in found for label in each.labels]
    names = {*asked, *(span.file for span in spans if span is not None)}
    texts = sources(sorted(names))
    sifted = filter_findings(found, texts, asked, configured, untold, laid)

    def place(found: Diagnostic) -> tuple[int, Span]:
        span = found.span
        return (-1, Span("", 0, 0)) if span is None else (order.get(span.file, len(order)), span)

    return Gathered(tuple(sorted(sifted.found, key=place)), sifted.ignored, texts, sifted.used, frozenset(untold))
