"""All errors of a text are reported once, and valid declarations are kept."""

import pytest

from rtshcua.diagnostics.codes import NOT_WRITTEN, SYNTAX, TOO_DEEP, UNCLOSED, UNKNOWN_UNIT, WRITTEN_TWICE
from rtshcua.diagnostics.span import Source
from rtshcua.ground.language.build.reader import MAX_DEPTH, MAX_FINDINGS
from rtshcua.ground.language.parse import Parsed, parse

GOOD = "zone good{0} = circle(1 N, 2 E, 3 m)\n"


def run(text: str) -> Parsed:
    return parse(Source("x", text))


def codes(parsed: Parsed) -> list[str]:
    return [found.code.slug for found in parsed.diagnostics]


def kept(parsed: Parsed) -> set[str]:
    unit = parsed.unit
    found = (*unit.zones, *unit.skills, *unit.policies, *unit.missions, *unit.signals, *unit.enums, *unit.vehicles)
    found = (*found, *unit.templates)
    return {node.name.text for node in found}


def test_parsing_continues_at_the_next_declaration() -> None:
    parsed = run(
        GOOD.format(1)
        + "zone bad1 = circle(1 N 2 E, 3 m)\n"
        + GOOD.format(2)
        + "skill bad2(a b: speed) { class x }\n"
        + "policy bad3 version { permit }\n"
        + GOOD.format(3)
        + "mission bad4 under p on v { phase a { x() } }\n"
        + GOOD.format(4)
    )
    assert codes(parsed) == [SYNTAX.slug] * 4
    assert kept(parsed) == {"good1", "good2", "good3", "good4"}
    assert parsed.broken == {"bad1", "bad2", "bad3", "bad4"}


def test_parsing_continues_at_the_next_part_of_a_block() -> None:
    parsed = run(
        "skill bad() {\n  clas tactical\n  deadline 2 s\n  require a > > b\n  assume b > c c\n  grace 1 parsec\n}\n"
        + GOOD.format(1)
    )
    assert codes(parsed) == [SYNTAX.slug, SYNTAX.slug, SYNTAX.slug, UNKNOWN_UNIT.slug]
    assert kept(parsed) == {"good1"}
    assert parsed.broken == {"bad"}


def test_parsing_continues_after_the_closing_brace() -> None:
    parsed = run(
        "mission bad under p@1 on v {\n  phase a { x( } phase b { y(] }\n  phase c { z() }\n}\n" + GOOD.format(1)
    )
    assert codes(parsed) == [SYNTAX.slug, SYNTAX.slug]
    assert kept(parsed) == {"good1"}


def test_brace_in_the_failed_part_does_not_close_the_block() -> None:
    parsed = run("skill bad() {\n  require a in {b c}\n  grace 1 s\n}\n" + GOOD.format(1))
    assert codes(parsed) == [SYNTAX.slug]
    assert kept(parsed) == {"good1"}


def test_parsing_does_not_continue_inside_strings_or_comments() -> None:
    parsed = run('zone bad = x "\nzone z = y /*\nzone z = y\n*/ //\n' + GOOD.format(1))
    assert codes(parsed) == [SYNTAX.slug, SYNTAX.slug]  # a text ends on its line, so its second line is read
    assert kept(parsed) == {"good1"}


def test_unclosed_block_is_reported() -> None:
    parsed = run("skill bad() {\n  grace 1 s\nskill good() { }\nskill bad2() {")
    assert codes(parsed) == [UNCLOSED.slug, UNCLOSED.slug]
    assert kept(parsed) == {"good"}
    first = parsed.diagnostics[0]
    assert first.span is not None
    assert (first.span.start, first.span.end) == (12, 13)
    assert first.labels[0].text == "the next declaration begins here"


def test_unclosed_block_among_steps_is_reported() -> None:
    """The keyword of the next declaration may be the name of a step there."""
    for block in ("", "repeat 2 {", "repeat 2 { repeat 3 {", "x() {"):
        parsed = run(f"mission bad under p@1 on v {{ phase a {{ x() {block}\n" + GOOD.format(1))
        assert codes(parsed) == [UNCLOSED.slug], block
        assert kept(parsed) == {"good1"}
    parsed = run('mission bad under p@1 on v { phase a {\nimport "x.rts"\n' + GOOD.format(1))
    assert codes(parsed) == [UNCLOSED.slug]
    assert [each.path for each in parsed.unit.imports] == ["x.rts"]
    parsed = run("mission good under p@1 on v { phase a {\nzone()\nmission(1)\nimport(a)\n} }\n")
    assert codes(parsed) == []


def test_parsing_continues_in_blocks_of_missions_and_templates() -> None:
    parsed = run(
        "mission bad under p@1 on v {\n"
        "  phase a { repeat 2 { x() {\n deadlin 2 s\n grace 1 parsec\n require a >\n record b c\n } } }\n"
        "  phase b { repeat x { } }\n"
        "  steps at most few\n"
        "  phase c { repeat 2 { x(] } }\n"
        "}\n"
        + GOOD.format(1)
        + "template bad2(a: zone) {\n  permit x\n  airspace inside z\n  permit x by any\n  forbid y by\n}\n"
        + "template good2() { forbid x by any }\n"
        + "policy bad3 version 1 {\n  use x\n  delegate x by y\n  permit any by any\n}\n"
        + GOOD.format(3)
    )
    assert codes(parsed) == [SYNTAX.slug, UNKNOWN_UNIT.slug, *[SYNTAX.slug] * 8]
    assert kept(parsed) == {"good1", "good2", "good3"}
    assert parsed.broken == {"bad", "bad2", "bad3"}


def test_repeated_and_missing_parts_are_reported() -> None:
    parsed = run('vehicle v { identity "a" identity "b" }\nvehicle w { identity "c" }\n' + GOOD.format(1))
    assert codes(parsed) == [WRITTEN_TWICE.slug, NOT_WRITTEN.slug]
    assert kept(parsed) == {"good1"}
    assert parsed.broken == {"v", "w"}


def test_nesting_limit_is_reported_once() -> None:
    fits, deep = MAX_DEPTH, MAX_DEPTH * 100
    for text in ("{0}a > 1{1}", "{0}a{1} > 1"):
        good = text.format("(" * fits, ")" * fits)
        assert codes(run(f"skill s() {{ require {good} }}")) == []
        bad = text.format("(" * deep, ")" * deep)
        assert codes(run(f"skill s() {{ require {bad} }}")) == [TOO_DEEP.slug]
    assert codes(run(f"skill s() {{ require {'not ' * deep} a > 1 }}")) == [TOO_DEEP.slug]
    assert codes(run(f"skill s() {{ require a > {'a + ' * deep} 1 }}")) == [TOO_DEEP.slug]
    assert codes(run(f"skill s() {{ require {' and '.join(['a > 1'] * deep)} }}")) == []


@pytest.mark.parametrize(
    ("text", "before", "after"),
    [
        ("skill s() { require §a > 1§ }", "", " for the last 1 s"),
        ("skill s() { require §a > 1§ }", "", " within the last 1 s"),
        ("skill s() { require §a > 1§ }", "", " within 1 s of b > 1"),
        ("skill s() { require §a > 1§ }", "rising ", ""),
        ("skill s() { require §a > 1§ }", "(falling ", ")"),
        ("skill s() { require §a > 1§ }", "not (", ")"),
        ("skill s() { require a inside grow(z, §b§) }", "abs(", ")"),
        ("skill s() { require a > §b§ }", "min(1, ", ", 2)"),
        ("skill s() { require a > §b§ }", "", " / 2"),
        ("zone z = union(§a§)", "union(b, ", ")"),
        ("zone z = union(§a§)", "difference(", ", b)"),
        ("mission m under p@1 on v { phase a { §§ } }", "repeat 2 { ", " }"),
        ("mission m under p@1 on v { phase a { §x()§ } }", "repeat 2 { x() ", " x() }"),
    ],
)
def test_nesting_limit_applies_to_every_construct(text: str, before: str, after: str) -> None:
    start, middle, end = text.split("§")

    def nested(levels: int) -> str:
        return f"{start}{before * levels}{middle}{after * levels}{end}"

    def runs(levels: int) -> bool:
        found = codes(run(nested(levels)))
        assert found in ([], [TOO_DEEP.slug])
        return not found

    assert runs(MAX_DEPTH // 2 - 1)
    assert not runs(MAX_DEPTH + 1)
    assert not runs(MAX_DEPTH * 20)  # beyond what Python's own stack would take


def test_parsing_stops_at_the_limit_of_errors() -> None:
    parsed = run("zone bad\n" * 50_000)
    assert len(parsed.diagnostics) == MAX_FINDINGS + 1
    assert parsed.diagnostics[-1].code.slug == "too-many-findings"
    assert len(run("zone z = circle(1 N, 2 E, 3 parsec)\n" * 5_000).diagnostics) == MAX_FINDINGS + 1
