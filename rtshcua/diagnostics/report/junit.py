"""Outcomes as JUnit XML, for Jenkins (`junit-10.xsd` of its xUnit plugin) and GitLab.

JUnit XML has no standard. The schema of Jenkins rejects unknown attributes, also `file` and `line` of a test case. So
the suite and the `classname` of the case carry the file, and the text carries the line.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from itertools import groupby
from typing import Final
from xml.etree import ElementTree

from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.render import render_one
from rtshcua.diagnostics.span import Source

_HEAD: Final = '<?xml version="1.0" encoding="utf-8"?>\n'


@dataclass(frozen=True, slots=True)
class CaseOutcome:
    """The outcome of one test: passed, unless `failure` or `skipped` gives a reason.

    `kind` is a short name of the failure, for programs. `broken` means that the test could not run: an error of JUnit.
    `time_us` is the duration, None if not measured. `line` counts from 1.
    """

    name: str
    file: str = ""
    line: int | None = None
    failure: str | None = None
    kind: str = ""
    broken: bool = False
    skipped: str | None = None
    time_us: int | None = None
    output: str = ""


@dataclass(frozen=True, slots=True)
class Suite:
    """The tests of one file, `name`; `properties` are names and values for the reader of the report."""

    name: str
    cases: tuple[CaseOutcome, ...]
    properties: tuple[tuple[str, str], ...] = ()


def junit(suites: Iterable[Suite], name: str = "rtshcua") -> str:
    """Return a whole document, ended by a newline. Characters that XML forbids or a terminal would obey are shown as
    `<U+001B>`.
    """
    root = ElementTree.Element("testsuites")
    each = tuple(suites)
    _count(root, name, [case for suite in each for case in suite.cases], skipped=False)
    for suite in each:
        _suite(root, suite)
    ElementTree.indent(root)
    return f"{_HEAD}{ElementTree.tostring(root, encoding='unicode')}\n"


def _suite(root: ElementTree.Element, suite: Suite) -> None:
    made = ElementTree.SubElement(root, "testsuite")
    _count(made, suite.name, suite.cases, skipped=True)
    files = {case.file for case in suite.cases if case.file}
    if len(files) == 1:
        made.set("file", _line(*files))
    if suite.properties:
        properties = ElementTree.SubElement(made, "properties")
        for key, value in suite.properties:
            ElementTree.SubElement(properties, "property", name=_line(key), value=_line(value))
    for case in suite.cases:
        _case(made, case, suite)


def _count(element: ElementTree.Element, name: str, cases: Iterable[CaseOutcome], *, skipped: bool) -> None:
    each = tuple(cases)
    element.set("name", _line(name))
    element.set("tests", str(len(each)))
    element.set("failures", str(sum(case.failure is not None and not case.broken for case in each)))
    element.set("errors", str(sum(case.failure is not None and case.broken for case in each)))
    if skipped:
        element.set("skipped", str(sum(_is_skipped(case) for case in each)))
    element.set("time", _seconds(sum(case.time_us or 0 for case in each)))


def _case(made: ElementTree.Element, case: CaseOutcome, suite: Suite) -> None:
    element = ElementTree.SubElement(made, "testcase", name=_line(case.name), classname=_line(case.file or suite.name))
    if case.time_us is not None:
        element.set("time", _seconds(case.time_us))
    if case.failure is not None:
        text = _text(case.failure)
        failure = ElementTree.SubElement(element, "error" if case.broken else "failure", message=text.split("\n")[0])
        if case.kind:
            failure.set("type", _line(case.kind))
        failure.text = f"{_place(case)}{text}"
    elif case.skipped is not None:
        ElementTree.SubElement(element, "skipped", message=_line(case.skipped))
    if case.output:
        ElementTree.SubElement(element, "system-out").text = _text(case.output)


def _is_skipped(case: CaseOutcome) -> bool:
    return case.failure is None and case.skipped is not None


def _place(case: CaseOutcome) -> str:
    if not case.file:
        return ""
    return f"{_line(case.file)}{'' if case.line is None else f':{case.line}'}\n"


def _seconds(microseconds: int) -> str:
    """Seconds with three decimals, the most that the schema of Jenkins accepts, rounded up."""
    milliseconds = -(-microseconds // 1_000)
    return f"{milliseconds // 1000}.{milliseconds % 1000:03}"


def _line(text: str) -> str:
    return visible(text)


def _text(text: str) -> str:
    """Lines stay lines."""
    return "\n".join(visible(line) for line in text.split("\n"))


#: the name of the suite of findings without a file
NO_FILE = "rtshcua"


def suites(
    found: Iterable[Diagnostic],
    sources: Mapping[str, Source],
    files: Iterable[str] = (),
    failing: Collection[Severity] = (Severity.ERROR, Severity.WARNING),
) -> tuple[Suite, ...]:
    """Return suites for `junit`, by name. Each of `files` has a suite; one without findings has one passing test.

    A finding of a severity outside `failing` is a passing test with the finding as its output.
    """
    of_file = sorted(found, key=_file)
    grouped = {
        file: tuple(_outcome(each, sources, failing) for each in group) for file, group in groupby(of_file, _file)
    }
    passed = {file: (CaseOutcome("nothing found", file),) for file in files}
    return tuple(Suite(file, cases) for file, cases in sorted((passed | grouped).items()))


def _file(diagnostic: Diagnostic) -> str:
    return NO_FILE if diagnostic.span is None else diagnostic.span.file


def _outcome(diagnostic: Diagnostic, sources: Mapping[str, Source], failing: Collection[Severity]) -> CaseOutcome:
    code, span = diagnostic.code, diagnostic.span
    name, file, line = f"{code.id} {code.slug}", "", None
    if span is not None:
        file = span.file
        if file in sources:
            at = sources[file].position(span.start)
            name, line = f"{name} at {at.line}:{at.column}", at.line
    text = render_one(diagnostic, sources).rstrip("\n")
    if diagnostic.severity in failing:
        return CaseOutcome(name, file, line, failure=text, kind=code.id)
    return CaseOutcome(name, file, line, output=text)
