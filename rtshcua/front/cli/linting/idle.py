"""Ignores of a configuration that ignored nothing, of a run over everything that it is about."""

import re
from collections.abc import Collection, Iterator
from pathlib import Path

from rtshcua.adapters.store.project import LARGEST, Project
from rtshcua.adapters.store.reading import read_regular
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.language.paths import shown
from rtshcua.ground.project.settings import IgnoredCode


def idle(
    projects: Collection[Project], used: Collection[IgnoredCode], asked: Collection[Path]
) -> Iterator[tuple[Diagnostic, Source]]:
    """The findings, each with the text of its configuration; none of a configuration of whose folder only a part was
    asked for.
    """
    places = [path.absolute() for path in asked]
    for project in projects:
        if project.file is None or not any(project.root.is_relative_to(place) for place in places):
            continue
        settings = project.settings.lint
        ignored = [each for each in settings.ignored if each not in used]
        ignored = [each for each in ignored if each.code is not codes.NOT_FORMATTED or settings.format]
        if ignored:
            source = Source(shown(str(project.file)), read_regular(project.file, LARGEST).decode("utf-8"))
            for each in ignored:
                yield _found(each, source), source


def _found(ignored: IgnoredCode, source: Source) -> Diagnostic:
    where = "" if ignored.pattern is None else f" in `{ignored.pattern}`"
    names = "|".join(map(re.escape, (ignored.code.id, ignored.code.slug)))
    match = re.search(rf"(?<![\w-])({names})(?![\w-])(?=[\"']?\s*=)", source.text)
    span = Span(source.file, *match.span(1)) if match else Span(source.file, 0, 0)
    message = f"nothing of `{ignored.code.id}` ({ignored.code.slug}) is found{where}, so this ignores nothing"
    return Diagnostic(codes.UNUSED_IGNORE, message, span, "delete it")
