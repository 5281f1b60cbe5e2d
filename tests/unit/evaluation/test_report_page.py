"""The report as HTML and Markdown: well formed, self-contained, safe against hostile texts, with every choice."""

import re
from base64 import b64decode
from collections.abc import Iterable
from hashlib import sha256
from html import unescape
from itertools import pairwise
from pathlib import Path
from random import Random
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import msgspec
import pytest
from hypothesis import given, settings
from markdown_it import MarkdownIt
from msgspec import Meta
from msgspec.structs import replace

from reference import worlds
from reference.evaluation_results import COMPUTER, campaign, case_flights, checks, everything, flights, sizes, timings
from reference.html_outline import Outline
from rtshcua.evaluation import report_page, report_text
from rtshcua.evaluation.comparison import COMPARISON
from rtshcua.evaluation.design import MISSIONS, MODES, POINTS
from rtshcua.evaluation.published import CASES, CHOICES
from rtshcua.evaluation.report_content import evaluation_report
from rtshcua.evaluation.report_parts import EvaluationReport, ReportChart, ReportTable, digits
from rtshcua.evaluation.results import Result, UnavailableMode
from rtshcua.ground.drawing.bar_chart import BarChart

HOSTILE = (
    '"><svg onload=alert(1)>',
    "</style><script>1</script>",
    "{{ 7 * 7 }}",
    "`<b>`",
    "a | b\nc `",
    "[x](http://y)",
)


def made(results: Iterable[Result], **more: str) -> EvaluationReport:
    return evaluation_report(
        results, replace(COMPUTER, **more), "2026-11-29 00:00 UTC", (("jobs", "2"),), (campaign(),)
    )


@pytest.fixture(scope="module")
def report() -> EvaluationReport:
    return made(list(everything(runs=1)))


@pytest.fixture(scope="module")
def text(report: EvaluationReport) -> str:
    return report_page.render(report)


@pytest.fixture(scope="module")
def outline(text: str) -> Outline:
    return Outline(text)


def test_elements_are_nested_and_every_link_has_its_target(outline: Outline) -> None:
    assert (outline.wrong, outline.open) == ([], [])
    ids = [attributes["id"] for _, attributes in outline.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    links = [attributes["href"] for attributes in outline.of("a")]
    sources = {source for each in COMPARISON for source in each.sources}
    assert sources <= {*links}
    assert not {link for link in links if link not in sources and (link[:1] != "#" or link[1:] not in ids)}
    labelled = {word for _, attributes in outline.elements for word in attributes.get("aria-labelledby", "").split()}
    assert not labelled - set(ids)
    levels = [int(tag[1]) for tag, _ in outline.elements if re.fullmatch(r"h[1-6]", tag)]
    assert levels[0] == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))


def test_page_loads_nothing_and_has_no_script(outline: Outline, text: str) -> None:
    assert not {tag for tag, _ in outline.elements} & {"script", "link", "img", "iframe", "object", "form", "base"}
    for _, attributes in outline.elements:
        assert not {name for name in attributes if name.startswith("on") or name in ("src", "style", "srcset")}
    assert "@import" not in text
    assert "url(" not in text


def test_content_security_policy_allows_only_the_own_style(outline: Outline, text: str) -> None:
    (policy,) = (each["content"] for each in outline.of("meta") if each.get("http-equiv") == "Content-Security-Policy")
    (style,) = re.findall(r"<style>(.*?)</style>", text, re.DOTALL)
    digest = re.search(r"style-src 'sha256-([^']+)'", policy)
    assert digest is not None
    assert b64decode(digest[1]) == sha256(style.encode()).digest()
    assert policy.startswith("default-src 'none'; ")
    assert "unsafe" not in policy


def test_wide_tables_are_scrolled_by_keys(outline: Outline) -> None:
    regions = [each for each in outline.of("div") if each.get("class") == "wide"]
    assert len(regions) == len(outline.of("table"))
    assert all(each["tabindex"] == "0" and each["role"] == "region" and each["aria-label"] for each in regions)


def cells(shown: EvaluationReport, section: str, caption: str) -> dict[str, tuple[str, ...]]:
    """The rows of a table, by their first cell."""
    parts = next(each.parts for each in shown.sections if each.anchor == section)
    table = next(each for each in parts if isinstance(each, ReportTable) and each.caption.startswith(caption))
    rows = [tuple(getattr(cell, "text", cell) for cell in row) for row in table.rows]
    return {str(first): tuple(map(str, others)) for first, *others in rows}


def test_negative_cost_of_isolation_is_in_a_table_and_has_no_bar() -> None:
    """The boundary in C decides sooner than that in Python."""
    faster = [
        replace(each, invocations=tuple(replace(step, validation_ns=11_000) for step in each.invocations))
        for each in flights(["process"], runs=1)
    ]
    shown = made([*flights(["software", "optee"], runs=1), *faster])
    added = cells(shown, "x5", "What an isolated mode adds to `software`, in ms: ")["median validation, `process`"]
    assert float(added[1]) < 0
    by_mission = cells(shown, "x5", "What an isolated mode adds to `software`, in ms, by")
    assert {f"{mission}, `process`" for mission in MISSIONS} <= by_mission.keys()
    of_short = by_mission["short, `process`"][0]
    (section,) = (each for each in shown.sections if each.anchor == "x5")
    (chart,) = (part.chart for part in section.parts if isinstance(part, ReportChart))
    assert isinstance(chart, BarChart)
    bar = next(each.bar for each in chart.bars if each.bar.label == "process, median validation")
    assert (bar.value, bar.told) == (None, f"{of_short.partition(' ')[0]} ms")
    in_c = cells(shown, "x5", "What an isolated mode adds to `process`")["median validation, `optee`"]
    assert float(in_c[1]) > float(added[1]) > float(in_c[1]) - 10
    assert float(in_c[1]) == pytest.approx(5.6, abs=0.6)


def test_sum_without_a_home_is_incomplete() -> None:
    whole = [replace(each, code_lines=10, memory=2048) for each in sizes()]
    name = "sum of our rows, `optee` as the only home"
    assert cells(made(whole), "x7", "Code lines")[name][2:] == ("20", "-", "185.65", "-", "4.00", "")
    unbuilt = [*whole[:-1], replace(whole[-1], artifact=None, memory=None)]
    found = cells(made(unbuilt), "x7", "Code lines")[name]
    assert found[2:] == ("20", "-", "-", "-", "-", "incomplete: a row has no size")


def test_cold_verifications_have_a_row_of_their_own() -> None:
    rows = cells(made(timings(1)), "x6", "Verification of a log")
    assert (rows["default"][1], rows["default, cold"][1]) == ("1.39", "15.4")


def test_charts_have_titles_and_tables_have_captions(outline: Outline, text: str) -> None:
    tags = [tag for tag, _ in outline.elements]
    assert tags.count("table") == tags.count("caption") > 15
    assert tags.count("svg") == tags.count("figcaption") == 7
    assert all(each["role"] == "img" and each["aria-labelledby"] for each in outline.of("svg"))
    assert text.count("bar published") > 20
    assert "nan" not in re.findall(r'(?:x|y|width|height|d)="([^"]*)"', text)


@pytest.mark.parametrize("hostile", HOSTILE)
def test_hostile_texts_are_escaped(hostile: str) -> None:
    absent = UnavailableMode(mode="process", why=hostile)
    shown = made([absent], processor=hostile, commit=hostile)
    text = report_page.render(shown)
    outline = Outline(text)
    assert (outline.wrong, outline.open) == ([], [])
    assert not {"script", "b"} & {tag for tag, _ in outline.elements}
    assert not any(name.startswith("on") for _, attributes in outline.elements for name in attributes)
    assert "49" not in re.findall(r"<td[^>]*>([^<]*)</td>", text)
    if "`" not in hostile:
        assert hostile in unescape(text)
    lines = report_text.render(shown).splitlines()
    (row,) = (line for line in lines if line.startswith("| `process` | 0 of 630 | not available"))
    assert len(re.findall(r"(?<!\\)\|", row)) == 5
    assert "](http" not in re.sub(r"\\.", "", row)
    assert "<" not in re.sub(r"\\<|`[^`]*`", "", row)


@pytest.mark.parametrize(
    "hostile",
    [
        "``` <img src=x onerror=1> `` x `", "`` ` <img src=x> ` ``", "` <img src=x>", "`a``<img src=x>`b`",
        "\\` <img src=x> \\`",
        "x` <img src=x> `y", "<img src=x>", "`|` <img src=x>", "&lt;img src=x&gt; ``` <script>", "[a]: http://x <b>",
        "a\n\n# <h1>", "\n- <img src=x>",
    ],
)  # fmt: skip
def test_markdown_makes_no_markup_of_hostile_texts(hostile: str) -> None:
    """As a reader of Markdown understands it: no element but those of our own words."""
    shown = made([UnavailableMode(mode="process", why=hostile)], processor=hostile, commit=hostile)
    summary = replace(campaign(), mission=hostile)
    text = report_text.render(evaluation_report([], replace(COMPUTER, commit=hostile), "x", (), (summary,)))
    for written in (text, report_text.render(shown)):
        page = MarkdownIt("commonmark", {"html": True}).enable("table").render(written)
        tags = {each.lower() for each in re.findall(r"<\s*/?(\w+)", page)}
        assert tags <= {"h1", "h2", "p", "em", "strong", "code", "table", "thead", "tbody", "tr", "th", "td", "a"}
        assert not re.search(r"<a href=\"http://x", page)
        assert page.count("<h1") == 1


WORDS = (*MODES, *(point.mission for point in POINTS[::7]), *(case.name for case in CASES[:3]), "allow", "written", "")


def drawn(kind: Any, of: Random) -> Any:
    """Any value of a type that raw data may hold."""
    match getattr(kind, "__metadata__", None), get_origin(kind):
        case (Meta() as bounds,), _:
            return of.choice([bounds.ge, 1, 1000, of.randrange(1 << 40), bounds.le])
        case _, origin if origin is tuple:
            return tuple(drawn(get_args(kind)[0], of) for _ in range(of.choice([0, 1, 1000])))
        case _, origin if origin is UnionType or origin is Union:
            return drawn(of.choice(get_args(kind)), of)
    if kind is str:
        return of.choice((*WORDS, *HOSTILE))
    if kind in (bool, NoneType):
        return of.random() < 0.5 if kind is bool else None
    return kind(**{name: drawn(each, of) for name, each in get_type_hints(kind, include_extras=True).items()})


@given(worlds.CHANCES)
@settings(max_examples=20)
def test_report_is_made_of_any_results(of: Random) -> None:
    """Whatever raw data say, with zeros and the greatest numbers, the report is well formed."""
    results = [drawn(Result, of) for _ in range(of.choice([1, 5, 40]))]
    made_of = msgspec.json.decode(msgspec.json.encode(results), type=list[Result])
    assert made_of == results
    shown = made(made_of)
    outline = Outline(report_page.render(shown))
    assert (outline.wrong, outline.open) == ([], [])
    assert not {"script", "b"} & {tag for tag, _ in outline.elements}
    assert report_text.render(shown)


def test_every_choice_of_a_table_is_explained(report: EvaluationReport, text: str) -> None:
    named = {
        name for section in report.sections for part in section.parts if isinstance(part, ReportTable)
        for name in part.choices
    }  # fmt: skip
    known = {each.anchor for each in CHOICES}
    assert named <= known
    assert known - named <= {"plots"}
    assert all(f'id="choice-{each}"' in text for each in known)


def test_every_choice_is_on_the_documentation_page() -> None:
    page = Path(__file__).resolve().parents[3] / "docs" / "evaluation.md"
    _, *rows = "\n".join(report_text.choice_lines()).partition("| Choice |")
    assert "".join(rows) in page.read_text(encoding="utf-8")


def test_partial_results_say_so(report: EvaluationReport) -> None:
    text = report_text.render(report)
    assert "No headline claim fails: 1 held, 16 incomplete, 3 not available here." in text
    assert "| X1, `software`: no missed deadlines and no fallbacks; all flights complete | incomplete | " in text
    assert "| 21 of 630 |" in text


def test_a_failed_claim_is_in_the_verdict() -> None:
    results: list[Result] = [
        *(replace(each, agrees=False, differs="one; `decide`: two") for each in checks(["process"], runs=1)),
        *(replace(each, holds=False, differs="sent late") for each in case_flights()),
    ]
    shown = made(results)
    assert shown.verdict.startswith("Headline claims fail: `x3/process`, `x3/extra`, `x3/runtime`.")
    text = report_page.render(shown)
    assert 'class="verdict missed"' in text
    assert "Checks that fail: 294; the first 20" in text
    assert 'class="part wrong"' in text
    assert "one; <code>decide</code>: two" in text
    assert "Flights in which a case does not hold: 48; the first 20" in text
    assert "sent late" in text


def test_nothing_measured_is_a_report_too() -> None:
    shown = evaluation_report([], replace(COMPUTER, memory=None, load=(), commit=""), "now")
    assert shown.verdict == "No headline claim fails: 20 not measured."
    outline = Outline(report_page.render(shown))
    assert (outline.wrong, outline.open) == ([], [])
    assert "commit `unknown`" in report_text.render(shown)


def test_same_results_give_the_same_bytes(report: EvaluationReport, text: str) -> None:
    again = made(list(everything(runs=1)))
    assert report_page.render(again) == text
    assert report_text.render(again) == report_text.render(report)


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (0, "0"), (0.0123456, "0.0123"), (1, "1.00"), (9.999, "10.0"), (135, "135"), (999.6, "1,000"),
        (1234.5, "1,234"), (-0.04, "-0.0400"), (71_600, "71,600"),
    ],
)  # fmt: skip
def test_numbers_have_three_digits(value: float, expected: str) -> None:
    assert digits(value) == expected
