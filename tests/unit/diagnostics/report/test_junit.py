"""JUnit XML: well formed for any content, valid by the schema of Jenkins, with correct counts."""

from functools import cache
from pathlib import Path
from xml.etree import ElementTree

from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.codes import Severity
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.excerpt import visible
from rtshcua.diagnostics.report.junit import CaseOutcome, Suite, junit, suites
from rtshcua.diagnostics.span import Source, Span


@cache
def schema() -> etree.XMLSchema:
    return etree.XMLSchema(etree.parse(Path(__file__).parents[3] / "vectors/junit/junit-10.xsd"))


def read(*given: Suite) -> ElementTree.Element:
    """The document, read back by two parsers and valid by the schema."""
    text = junit(given)
    strict = etree.fromstring(text.encode(), etree.XMLParser(resolve_entities=False, no_network=True))
    schema().assertValid(strict)
    return ElementTree.fromstring(text)


CASES = (
    CaseOutcome("passes", "a.rts", 3, time_us=1_249_001),
    CaseOutcome("fails", "a.rts", 9, failure="asked for allow\nwas deny", kind="state/violated", output="trace"),
    CaseOutcome("cannot run", "a.rts", failure="no nominal", broken=True),
    CaseOutcome("is left out", "a.rts", skipped="not asked for"),
)


def test_outcomes_follow_the_jenkins_schema() -> None:
    (suite,) = read(Suite("a.rts", CASES, (("coverage", "95 %"),)))
    assert suite.attrib == {
        "name": "a.rts", "tests": "4", "failures": "1", "errors": "1", "skipped": "1", "time": "1.250", "file": "a.rts",
    }  # fmt: skip
    assert [each.attrib for each in suite.iter("property")] == [{"name": "coverage", "value": "95 %"}]
    passes, fails, broken, skipped = suite.iter("testcase")
    assert passes.attrib == {"name": "passes", "classname": "a.rts", "time": "1.250"}
    assert [*passes] == []
    (failure, output) = fails
    assert (failure.tag, failure.attrib) == ("failure", {"message": "asked for allow", "type": "state/violated"})
    assert failure.text == "a.rts:9\nasked for allow\nwas deny"
    assert output.text == "trace"
    assert [each.tag for each in broken] == ["error"]
    assert [(each.tag, each.get("message")) for each in skipped] == [("skipped", "not asked for")]


def test_root_counts_the_cases_of_all_suites() -> None:
    whole = read(Suite("a.rts", CASES), Suite("b.rts", CASES[1:]))
    assert {name: whole.get(name) for name in ("tests", "failures", "errors", "time")} == {
        "tests": "7", "failures": "2", "errors": "2", "time": "1.250",
    }  # fmt: skip


def test_empty_report_is_a_document() -> None:
    assert read().attrib["tests"] == "0"


def test_findings_fail_by_severity() -> None:
    sources = {"a.rts": Source("a.rts", "one two\n")}
    found = [
        Diagnostic(codes.UNDECIDED, "cannot tell", Span("a.rts", 0, 3)),
        Diagnostic(codes.NAMING, "a name", Span("a.rts", 4, 7)),
        Diagnostic(codes.NO_SUCH_FILE, "`x.rts` is not there"),
    ]
    made = read(*suites(found, sources, ("a.rts", "b.rts")))
    assert [(suite.get("name"), suite.get("failures")) for suite in made] == [
        ("a.rts", "1"), ("b.rts", "0"), ("rtshcua", "1"),
    ]  # fmt: skip
    note, name = made[0].iter("testcase")
    assert note.findtext("system-out", "").startswith("note[E1103]: cannot tell\n --> a.rts:1:1")
    assert (name.get("name"), name[0].get("type")) == ("E1302 naming at 1:5", "E1302")
    assert name[0].get("message") == "warning[E1302]: a name"
    assert [case.get("name") for case in made[1].iter("testcase")] == ["nothing found"]
    only = suites(found, sources, failing={Severity.ERROR})
    assert [case.failure is None for suite in only for case in suite.cases] == [True, True, False]


anything = st.text(max_size=20) | st.text("<>&'\"]\r\n\t\0\x1b\ufffe\ud800\U0010ffff -!", max_size=12)


@given(anything, anything, anything, anything, anything)
def test_hostile_text_is_shown_escaped(name: str, file: str, why: str, kind: str, output: str) -> None:
    cases = (CaseOutcome(name, file, 1, failure=why, kind=kind, output=output), CaseOutcome(name, file, skipped=why))
    failed, skipped = read(Suite(name, cases, ((kind, why),)))[0].iter("testcase")
    assert failed.get("name") == visible(name)
    expected = "\n".join(map(visible, why.split("\n")))
    text = failed[0].text or ""
    assert text == (f"{visible(file)}:1\n{expected}" if file else expected)
    assert skipped[0].get("message") == visible(why)
