"""Merge the findings of all programs of a run: each finding once, ignores applied, unused ignores reported."""

import os
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from rtshcua import library
from rtshcua.adapters.store.git import GitChanges
from rtshcua.adapters.store.project import LARGEST, Project
from rtshcua.adapters.store.reading import read_regular
from rtshcua.app.lint.cache import LintedProgram
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic, has_errors
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.language.paths import shown
from rtshcua.ground.lint.filter import Linted, Suppressed, agreed, filter_findings
from rtshcua.ground.project.project_settings import IgnoredCode


class LintFindings(NamedTuple):
    """The findings by file and position, the ignored findings, the sources, and the used ignores of configurations.

    `untold` are the files of programs with errors: their lint findings are incomplete.
    """

    found: tuple[Diagnostic, ...]
    ignored: tuple[Suppressed, ...]
    sources: Mapping[str, Source]
    used: frozenset[IgnoredCode]
    untold: frozenset[str]


def gather(
    programs: Sequence[LintedProgram],
    sources: Callable[[Sequence[str]], dict[str, Source]],
    configured: Mapping[str, Sequence[IgnoredCode]],
    asked: Sequence[str],
    laid: Collection[str] = (),
) -> LintFindings:
    """Merge the findings of programs.

    `configured` has the ignores of each file's configuration. `asked` are the linted files. `laid` are the files whose
    layout was checked.
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
    kept = filter_findings(found, texts, asked, configured, untold, laid)

    def place(found: Diagnostic) -> tuple[int, Span]:
        span = found.span
        return (-1, Span("", 0, 0)) if span is None else (order.get(span.file, len(order)), span)

    return LintFindings(tuple(sorted(kept.found, key=place)), kept.ignored, texts, kept.used, frozenset(untold))


def unused_ignores(
    projects: Collection[Project], used: Collection[IgnoredCode], asked: Collection[Path]
) -> Iterator[tuple[Diagnostic, Source]]:
    """Yield a finding for each unused ignore of a configuration, with the text of the configuration.

    A project that is linted only in part is skipped: its ignores may be needed for the other files.
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
    message = f"there is no finding `{ignored.code.id}` ({ignored.code.slug}){where}, so this ignore has no effect"
    return Diagnostic(codes.UNUSED_IGNORE, message, span, "delete it")


def affected(programs: Sequence[LintedProgram], changed: GitChanges) -> list[LintedProgram]:
    """Return the programs that read a changed file.

    A file outside of all repositories counts as changed, unless it is installed, such as the library or a pack.
    """
    known: dict[str, bool | None] = {}

    def touches(name: str, installed: tuple[str, ...]) -> bool:
        if name not in known:
            known[name] = changed.touch(name)
        return known[name] is not False and (known[name] is True or not os.path.realpath(name).startswith(installed))

    found = []
    for program in programs:
        packs = [each for each in program.packs.values() if each is not None]
        installed = tuple(f"{os.path.realpath(each)}{os.sep}" for each in (str(library.root()), *packs))
        if any(touches(name, installed) for name in program.reads):
            found.append(program)
    return found
