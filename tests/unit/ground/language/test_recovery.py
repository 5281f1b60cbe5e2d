"""All errors of a text are reported, each once, and what is good is kept."""

from rtshcua.diagnostics.codes import NOT_WRITTEN, SYNTAX, TOO_DEEP, UNCLOSED, UNKNOWN_UNIT, WRITTEN_TWICE
from rtshcua.diagnostics.span import Source
from rtshcua.ground.language.build.base import MAX_DEPTH, MAX_FINDINGS
from rtshcua.ground.language.parse import Parsed, parse

GOOD = "zone good{0} = circle(1 N, 2 E, 3 m)\n"


def run(text: str) -> Parsed:
    return parse(Source("x", text))


def codes(parsed: Parsed) -> list[str]:
    return [found.code.slug for found in parsed.diagnostics]


def kept(parsed: Parsed) -> set[str]:
    unit = parsed.unit
    found = (*unit.zones, *unit.skills, *unit.policies, *unit.missions, *unit.signals, *unit.enums, *unit.vehicles)
    return {node.name.text for node in found}


def test_goes_on_at_the_next_declaration() -> None:
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


def test_goes_on_at_the_next_part_of_a_block() -> None:
    parsed = run(
        "skill bad() {\n  clas tactical\n  deadline 2 s\n  require a > > b\n  assume b > c c\n  grace 1 parsec\n}\n"
        + GOOD.format(1)
    )
    assert codes(parsed) == [SYNTAX.slug, SYNTAX.slug, SYNTAX.slug, UNKNOWN_UNIT.slug]
    assert kept(parsed) == {"good1"}
    assert parsed.broken == {"bad"}


def test_goes_on_after_the_brace_that_closes_the_block() -> None:
    parsed = run(
        "mission bad under p@1 on v {\n  phase a { x( } phase b { y(] }\n  phase c { z() }\n}\n" + GOOD.format(1)
    )
    assert codes(parsed) == [SYNTAX.slug, SYNTAX.slug]
    assert kept(parsed) == {"good1"}


def test_a_brace_within_the_failed_part_closes_no_block() -> None:
    parsed = run("skill bad() {\n  require a in {b c}\n  grace 1 s\n}\n" + GOOD.format(1))
    assert codes(parsed) == [SYNTAX.slug]
    assert kept(parsed) == {"good1"}


def test_text_and_comments_hold_no_place_to_go_on() -> None:
    parsed = run('zone bad = x "\nzone z = y /*\nzone z = y\n*/ //\n' + GOOD.format(1))
    assert codes(parsed) == [SYNTAX.slug, SYNTAX.slug]  # a text ends on its line, so its second line is read
    assert kept(parsed) == {"good1"}


def test_a_block_that_is_not_closed() -> None:
    parsed = run("skill bad() {\n  grace 1 s\nskill good() { }\nskill bad2() {")
    assert codes(parsed) == [UNCLOSED.slug, UNCLOSED.slug]
    assert kept(parsed) == {"good"}
    first = parsed.diagnostics[0]
    assert first.span is not None
    assert (first.span.start, first.span.end) == (12, 13)
    assert first.labels[0].text == "the next declaration begins here"


def test_parts_are_written_once_and_not_left_out() -> None:
    parsed = run('vehicle v { identity "a" identity "b" }\nvehicle w { identity "c" }\n' + GOOD.format(1))
    assert codes(parsed) == [WRITTEN_TWICE.slug, NOT_WRITTEN.slug]
    assert kept(parsed) == {"good1"}
    assert parsed.broken == {"v", "w"}


def test_nesting_has_a_limit_and_is_reported_once() -> None:
    fits, deep = MAX_DEPTH, MAX_DEPTH * 100
    for text in ("{0}a > 1{1}", "{0}a{1} > 1"):
        good = text.format("(" * fits, ")" * fits)
        assert codes(run(f"skill s() {{ require {good} }}")) == []
        bad = text.format("(" * deep, ")" * deep)
        assert codes(run(f"skill s() {{ require {bad} }}")) == [TOO_DEEP.slug]
    assert codes(run(f"skill s() {{ require {'not ' * deep} a > 1 }}")) == [TOO_DEEP.slug]
    assert codes(run(f"skill s() {{ require a > {'a + ' * deep} 1 }}")) == [TOO_DEEP.slug]
    assert codes(run(f"skill s() {{ require {' and '.join(['a > 1'] * deep)} }}")) == []


def test_a_text_with_very_many_errors_ends_early() -> None:
    parsed = run("zone bad\n" * 50_000)
    assert len(parsed.diagnostics) == MAX_FINDINGS + 1
    assert parsed.diagnostics[-1].code.slug == "too-many-findings"
    assert len(run("zone z = circle(1 N, 2 E, 3 parsec)\n" * 5_000).diagnostics) == MAX_FINDINGS + 1
