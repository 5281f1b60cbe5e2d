"""The formatter refuses sources with syntax errors, and results with another meaning."""

from collections.abc import Callable

import pytest

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.span import Source
from rtshcua.ground.format import format_text
from rtshcua.ground.format.format import formatted
from rtshcua.ground.format.format_text import difference, not_formatted
from rtshcua.ground.format.token_reader import read
from rtshcua.ground.language.file_findings import MAX_SIZE
from rtshcua.ground.language.parse import parse
from virtual.rows import rows

TEXT = """// a
skill s(p: length, q: speed = 1 m/s) {
  require height <= 20 m and battery > 30 %  // rtshcua: ignore E1304 because x
  // b
  grace 1 s
}
"""


@rows(
    "text",
    [
        "zone z = 3", "skill s() {", "skill s() { deadline 2 s", '"', "/* a", "zone z = circle(1 N, 2 E, 3 m) \0 // b",
        "// \0", "zone z = circle(1 N, 2 E, 3 m) /", "x" * 100, "x" * (MAX_SIZE + 1),
        "skill s() { require " + "(" * 3_000 + "a < 1" + ")" * 3_000 + " }",
        "skill s() { require " + "max(1, " * 2_000 + "a" + ")" * 2_000 + " < 1 }",
    ],
    ids=lambda text: text[:20],
)  # fmt: skip
def test_syntax_error_is_refused(text: str) -> None:
    source = Source("x.rts", text)
    made = formatted(source)
    assert made.text is None
    assert made.diagnostics == parse(source).diagnostics != ()


@pytest.mark.parametrize(
    "text", ["zone z = circle(1 N, 2 E, 3 parsec)", "skill s() { grace 1 s grace 2 s }", "signal a.b : c = d.e"]
)
def test_other_errors_do_not_prevent_formatting(text: str) -> None:
    assert formatted(Source("x.rts", text)).text is not None


@pytest.mark.parametrize("text", ["", " ", "\n\n", "\ufeff", "\t\r\n"])
def test_blank_text_formats_to_nothing(text: str) -> None:
    assert formatted(Source("x.rts", text)).text == ""


CHANGES: dict[str, tuple[Callable[[str], str], str]] = {
    "a word lost": (lambda text: text.replace("battery", ""), "the syntax"),
    "a number": (lambda text: text.replace("20 m", "21 m"), "a token"),
    "a unit": (lambda text: text.replace("20 m", "20 km"), "a token"),
    "parts in another order": (lambda text: text.replace("p: length, q: speed", "q: length, p: speed"), "a token"),
    "a comment lost": (lambda text: text.replace("// b\n", "\n"), "a comment"),
    "a comment of other words": (lambda text: text.replace("// b", "// c"), "a comment"),
    "a comment twice": (lambda text: text.replace("// b", "// b\n// b"), "a comment"),
    "a comment past a word": (lambda text: text.replace("  // b\n  grace 1 s\n", "  grace 1 s // b\n"), "a comment"),
    "comments in another order": (lambda text: text.replace("// a", "// z").replace("// b", "// a"), "a comment"),
    "code in a comment": (lambda text: text.replace("// b\n", "// b "), "a token"),
    "a line that an ignore speaks of": (lambda text: text.replace("and battery", "\nand battery"), "the line of an"),
}


@pytest.mark.parametrize("name", CHANGES)
def test_changed_result_is_refused(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    change, what = CHANGES[name]
    monkeypatch.setattr(format_text, "lay_out", lambda before, width: change(before.text))
    made = formatted(Source("x.rts", TEXT))
    assert made.text is None
    (found,) = made.diagnostics
    assert found.code is codes.UNSAFE_FORMAT
    assert f"would change {what}" in found.message
    assert found.help is not None
    assert "please report it" in found.help


def test_same_tokens_with_another_tree_are_refused() -> None:
    """Brackets are tokens, so no source shows this difference; the comparison of the rules detects it."""
    one = read("skill s() { require a < 1 }")
    assert one is not None
    found = difference(one, one._replace(rules=one.rules[:-1]))
    assert found is not None
    assert found.what == "the meaning"


def test_only_a_trailing_comma_may_differ() -> None:
    def compared(one: str, other: str) -> str | None:
        first = read(one)
        assert first is not None
        found = difference(first, read(other))
        return None if found is None else found.what

    assert compared("skill s(a: b) { }", "skill s(a: b,) { }") is None
    assert compared("skill s() { require a in {b, c} }", "skill s() { require a in {b, c,} }") is None
    assert compared("skill s(a: one of b, c) { }", "skill s(a: one of b c) { }") == "the syntax"


def test_unformatted_source_gives_one_finding_with_a_fix() -> None:
    source = Source("x.rts", "// a\nskill s() {}\n")
    text = formatted(source).text
    assert text is not None
    found = not_formatted(source, text)
    assert found is not None
    assert found.code is codes.NOT_FORMATTED
    assert found.span is not None
    assert source.slice(found.span) == "skill s() {}"
    assert found.fixes[0].replacement == text
    assert not_formatted(Source("x.rts", text), text) is None
    shorter = not_formatted(Source("x.rts", text + "\n\n"), text)
    assert shorter is not None
