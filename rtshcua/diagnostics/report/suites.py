"""Findings as suites of JUnit: a suite for each file, in which each finding is a test that fails."""

from collections.abc import Collection, Iterable, Mapping
from itertools import groupby

from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.render import render_one
from rtshcua.diagnostics.report.junit import Outcome, Suite
from rtshcua.diagnostics.span import Source

#: the name of the suite of what is about no file
NO_FILE = "rtshcua"


def suites(
    found: Iterable[Diagnostic],
    sources: Mapping[str, Source],
    files: Iterable[str] = (),
    failing: Collection[Severity] = (Severity.ERROR, Severity.WARNING),
) -> tuple[Suite, ...]:
    """Suites for `junit`, by name. Each of `files` has one, in which a test passes where nothing was found.

    A finding of a severity that is not among `failing` is a test that passes, and says in its output what was found.
    """
    of_file = sorted(found, key=_file)
    grouped = {
        file: tuple(_outcome(each, sources, failing) for each in group) for file, group in groupby(of_file, _file)
    }
    passed = {file: (Outcome("nothing found", file),) for file in files}
    return tuple(Suite(file, cases) for file, cases in sorted((passed | grouped).items()))


def _file(diagnostic: Diagnostic) -> str:
    return NO_FILE if diagnostic.span is None else diagnostic.span.file


def _outcome(diagnostic: Diagnostic, sources: Mapping[str, Source], failing: Collection[Severity]) -> Outcome:
    code, span = diagnostic.code, diagnostic.span
    name, file, line = f"{code.id} {code.slug}", "", None
    if span is not None:
        file = span.file
        if file in sources:
            at = sources[file].position(span.start)
            name, line = f"{name} at {at.line}:{at.column}", at.line
    text = render_one(diagnostic, sources).rstrip("\n")
    if diagnostic.severity in failing:
        return Outcome(name, file, line, failure=text, kind=code.id)
    return Outcome(name, file, line, output=text)
