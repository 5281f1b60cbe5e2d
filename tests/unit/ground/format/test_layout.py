"""Lines: short items stay on one line, long ones are broken by rule, and some breaks of the author stay."""

import pytest

from rtshcua.diagnostics.span import Source
from rtshcua.ground.format.format import formatted
from virtual.rows import rows


def laid_out(text: str, width: int = 120) -> str:
    made = formatted(Source("x.rts", text), width)
    assert made.text is not None, made.diagnostics
    assert formatted(Source("x.rts", made.text), width).text == made.text
    return made.text


@rows(
    ("written", "meant"),
    [
        ("require a<1 and b>=2", "require a < 1 and b >= 2"),
        ("require a - 1 < -1 and - 2 m < b+-3 m", "require a - 1 < -1 and -2 m < b + -3 m"),
        ("require (a<1)and(b<2)", "require (a < 1) and (b < 2)"),
        ("require not(a < 1)", "require not (a < 1)"),
        ("require max ( a,b ) < min(1 m,2m)", "require max(a, b) < min(1 m, 2 m)"),
        ("require a in 1 m..2 m", "require a in 1 m .. 2 m"),
        ("require a in { b,c , }", "require a in {b, c}"),
        ("require a inside grow ( b,- 5 m , )", "require a inside grow(b, -5 m)"),
        ("require local  \t time in 08:00..18:30", "require local time in 08:00 .. 18:30"),
        ("require rising(a < 1)within the last 5 s", "require rising (a < 1) within the last 5 s"),
        ("require a*2/3 < 1_000 m / s", "require a * 2 / 3 < 1_000 m / s"),
        ("require battery > 25%", "require battery > 25 %"),
        ("require a == 47.39 N,8.54 E", "require a == 47.39 N, 8.54 E"),
        ("fallback a( b,c=1 m )for 5s,d", "fallback a(b, c = 1 m) for 5 s, d"),
    ],
)
def test_blanks_within_a_line(written: str, meant: str) -> None:
    assert laid_out(f"skill s() {{ {written} }}") == f"skill s() {{ {meant} }}\n"


@rows(
    ("written", "meant"),
    [
        ("signal a:b=C.d", "signal a : b = C.d"),
        ("signal a : b = C.d unknown at - 1,x", "signal a : b = C.d  unknown at -1, x"),
        ("zone z=circle(1 N,2 E,3 m)active 08:00..09:00", "zone z = circle(1 N, 2 E, 3 m)  active 08:00 .. 09:00"),
        ("vehicle v { clock utc+02:00 }", "vehicle v { clock utc +02:00 }"),
        ("vehicle v{clock\"A/B\"}", 'vehicle v { clock "A/B" }'),
        ("zone z=circle(1 N,2 E,3 m)active on a,b..c", "zone z = circle(1 N, 2 E, 3 m)  active on a, b .. c"),
        (
            "zone z=circle(1 N,2 E,3 m)active 8:00..9:00 on a..b",
            "zone z = circle(1 N, 2 E, 3 m)  active 8:00 .. 9:00 on a .. b",
        ),
        ("skill s(a:b in 1 m..2 m=1 m,c:one\nof d,e,){}", "skill s(a: b in 1 m .. 2 m = 1 m, c: one of d, e) { }"),
        ("mission m ( ) under p @ 7 on v{}", "mission m() under p@7 on v { }"),
        ("enum e{a=1,b=2,}", "enum e { a = 1, b = 2 }"),
        ("policy p version 3{}", "policy p version 3 { }"),
    ],
)  # fmt: skip
def test_blanks_within_declarations(written: str, meant: str) -> None:
    assert laid_out(written) == meant + "\n"


def test_items_get_a_line_each_unless_the_block_is_on_one() -> None:
    short = "skill s() { deadline 2 s  grace 1 s }\n"
    assert laid_out(short) == short
    assert laid_out("skill s() { deadline 2 s\n grace 1 s }") == "skill s() {\n  deadline 2 s\n  grace    1 s\n}\n"
    assert laid_out(short, 30) == "skill s() {\n  deadline 2 s\n  grace    1 s\n}\n"


def test_blank_lines_are_reduced_to_one() -> None:
    text = "\n\nskill s() {\n\n\n  grace 1 s\n\n\n\n  deadline 2 s\n\n}\n\n\n\nskill t() { }\n\n\n"
    assert laid_out(text) == "skill s() {\n  grace    1 s\n\n  deadline 2 s\n}\n\nskill t() { }\n"


def test_blanks_and_line_ends_are_normalised() -> None:
    assert laid_out("\ufeffskill s() {\r\n\tgrace 1 s \t\r\n}") == "skill s() {\n  grace    1 s\n}\n"


def test_long_condition_breaks_at_all_its_weakest_operators() -> None:
    text = "skill s() {\n  require a < 1 and b < 2 or c < 3 and d < 4\n}\n"
    assert laid_out(text, 40) == ("skill s() {\n  require  a < 1 and b < 2\n           or c < 3 and d < 4\n}\n")
    assert laid_out(text, 24) == (
        "skill s() {\n  require  a < 1\n             and b < 2\n           or c < 3\n                and d < 4\n}\n"
    )


def test_when_keeps_its_line() -> None:
    head, condition = "  permit  a by role b", "when c < 1"
    own = f"policy p version 1 {{\n{head}\n          {condition}\n}}\n"
    same = f"policy p version 1 {{\n{head} {condition}\n}}\n"
    assert laid_out(own) == own
    assert laid_out(same) == same
    assert laid_out(same, 30) == own


def test_long_list_gets_a_line_for_each_item() -> None:
    text = "skill s(a: length, bcd: one of x, y = x) { }"
    broken = "skill s(\n  a:   length,\n  bcd: one of x, y = x,\n) { }\n"
    assert laid_out(text) == text + "\n"
    assert laid_out(text, 40) == broken
    assert laid_out("skill s(\na: length, bcd: one of x, y = x) { }") == broken
    assert laid_out("skill s(a: length,\n\n bcd: one of x, y = x) { }") == text + "\n"


def test_columns_are_not_aligned_if_a_line_gets_too_wide() -> None:
    long = f"signal {'a' * 20} : length = {'B' * 20}.{'c' * 20}  unknown at 0  stale after 2 s"
    text = f"signal b : altitude = C.d  stale after 2 s\n{long}\n"
    first, second = laid_out(text, len(long)).splitlines()
    assert second == long
    assert first == f"signal b{' ' * 19} : altitude = C.d  stale after 2 s"
    first, second = laid_out(text, len(long) + 2).splitlines()
    assert second == long.replace("length =", "length   =")
    assert first.index("stale") == second.index("stale")


@pytest.mark.parametrize("width", [1, 20, 40, 80])
def test_unbreakable_line_may_exceed_the_width(width: int) -> None:
    text = f'mission m under p@1 on v {{\n  intent "{"x" * 200}"\n}}\n'
    assert max(map(len, laid_out(text, width).splitlines())) > 200


def test_huge_line_is_formatted_in_time() -> None:
    parts = 4_000
    text = "skill s() { require " + " + ".join(["1 m"] * parts) + " < 2 m  record " + ", ".join(["a"] * parts) + " }"
    made = laid_out(text)
    assert made.count("1 m") == parts
    assert made.count("a") == parts
