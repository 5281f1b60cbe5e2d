"""Rendered findings: the source line, the exact underline, and no control characters."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.diagnostics import codes
from rtshcua.diagnostics import excerpt as excerpts
from rtshcua.diagnostics.diagnostic import Diagnostic, Fix, Label
from rtshcua.diagnostics.excerpt import MAX_WIDTH, NEAR, TAB_WIDTH, excerpt
from rtshcua.diagnostics.render import render
from rtshcua.diagnostics.serialise import FORMAT, VERSION, as_json
from rtshcua.diagnostics.span import Source, Span
from rtshcua.wire import names


def shown(text: str, start: int, end: int) -> list[str]:
    """The line and its underline."""
    source = Source("a.rts", text)
    line, underlines = excerpt(source, source.position(start).line, [(Span("a.rts", start, end), "^", "")])
    return [line, *underlines]


def test_span_is_underlined() -> None:
    assert shown("one two three\n", 4, 7) == ["one two three", "    ^^^"]


def test_tab_is_underlined_at_its_displayed_width() -> None:
    assert TAB_WIDTH == 4
    assert shown("a\tbc\td", 2, 4) == ["a   bc  d", "    ^^"]


def test_wide_characters_take_two_columns_and_combining_ones_none() -> None:
    assert shown("漢字x", 1, 2) == ["漢字x", "  ^^"]
    assert shown("e\u0301x", 2, 3) == ["e\u0301x", " ^"]


def test_empty_span_has_one_mark_even_at_the_line_end() -> None:
    assert shown("ab\n", 2, 2) == ["ab", "  ^"]
    assert shown("", 0, 0) == ["", "^"]


def test_span_over_lines_is_underlined_to_the_end_of_the_first() -> None:
    assert shown("ab cd\nef\n", 3, 8) == ["ab cd", "   ^^"]


def test_long_line_is_cut_around_the_span() -> None:
    text = "x" * 5_000 + "here" + "y" * 5_000
    line, underline = shown(text, 5_000, 5_004)
    assert line.startswith("...")
    assert line.endswith("...")
    assert line[underline.index("^") : underline.rindex("^") + 1] == "here"
    assert len(line) <= MAX_WIDTH


def test_very_long_line_is_examined_near_the_span_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hundred findings on one line of a megabyte are shown as fast as on short lines."""
    looked_at: list[str] = []
    monkeypatch.setattr(excerpts, "_cell", lambda character: looked_at.append(character) or (character, 1))
    line, underline = shown("x" * 500_000 + "here" + "y" * 500_000, 500_000, 500_004)
    assert line[underline.index("^") : underline.rindex("^") + 1] == "here"
    assert line.startswith("...")
    assert line.endswith("...")
    assert len(looked_at) == 2 * NEAR


def test_control_characters_are_escaped() -> None:
    line, underline = shown("a\x1b[31m\u202ebc", 7, 8)
    assert line == "a<U+001B>[31m<U+202E>bc"
    assert line[underline.index("^")] == "b"
    found = Diagnostic(codes.SYNTAX, "bad `\x1b[2J`", Span("\x07.rts", 0, 1), "help \u2066")
    text = render([found], {"\x07.rts": Source("\x07.rts", "x")})
    assert all(character.isprintable() or character == "\n" for character in text)


@given(st.text(max_size=40), st.integers(0, 40), st.integers(0, 40))
def test_rendering_is_total_and_printable(text: str, a: int, b: int) -> None:
    source = Source("a.rts", text)
    span = Span("a.rts", min(a, b), max(a, b))
    found = Diagnostic(codes.SYNTAX, "message", span, labels=(Label(span, "label"),))
    rendered = render([found], {"a.rts": source})
    assert all(character.isprintable() or character == "\n" for character in rendered)
    json.dumps(as_json([found], {"a.rts": source}))


def test_labels_are_shown_with_their_files() -> None:
    sources = {"a.rts": Source("a.rts", "one\ntwo\n"), "b.rts": Source("b.rts", "\nthree")}
    found = Diagnostic(
        codes.UNKNOWN_NAME,
        "`two` is not declared",
        Span("a.rts", 4, 7),
        "did you mean `three`?",
        (Label(Span("a.rts", 0, 3), "not this"), Label(Span("b.rts", 1, 6), "declared here")),
    )
    assert render([found], sources).splitlines() == [
        "error[E0201]: `two` is not declared",
        " --> a.rts:2:1",
        "  |",
        "2 | two",
        "  | ^^^",
        "  :",
        "1 | one",
        "  | --- not this",
        " ::: b.rts:2:1",
        "  |",
        "2 | three",
        "  | ----- declared here",
        "  = help: did you mean `three`?",
    ]


def test_finding_without_a_place_is_one_line() -> None:
    assert render([Diagnostic(codes.NO_MISSION, "the sources declare no mission")], {}) == (
        "error[E0206]: the sources declare no mission\n"
    )


def test_place_in_an_unknown_file_names_the_file() -> None:
    assert render([Diagnostic(codes.SYNTAX, "bad", Span("gone.rts", 0, 1))], {}).splitlines()[1] == " --> gone.rts"


def test_json_has_every_key_and_the_format_of_the_registry() -> None:
    source = Source("a.rts", "ab\ncd")
    fix = Fix(Span("a.rts", 3, 5), "ef", "write `ef`")
    found = Diagnostic(codes.SYNTAX, "bad", Span("a.rts", 3, 5), pointer="/a", fixes=(fix,))
    value = as_json([found, Diagnostic(codes.NO_MISSION, "none")], {"a.rts": source})
    assert (value["format"], value["version"]) == (names.DIAGNOSTICS.name, names.DIAGNOSTICS.version)
    assert (names.DIAGNOSTICS.name, names.DIAGNOSTICS.version) == (FORMAT, VERSION)
    first, second = value["diagnostics"]
    assert first["at"] == {
        "file": "a.rts",
        "start": 3,
        "end": 5,
        "line": 2,
        "column": 1,
        "end_line": 2,
        "end_column": 3,
    }
    assert first["fixes"][0]["replacement"] == "ef"
    assert first["pointer"] == "/a"
    assert second["at"] is None
    assert set(first) == set(second)


def test_label_on_a_long_line_is_visible() -> None:
    line = "first" + " x" * 100 + " second" + " y" * 100 + " third"
    places = [line.index(word) for word in ("first", "second", "third")]
    spans = [Span("a.rts", at, at + 5) for at in places]
    found = Diagnostic(codes.SYNTAX, "bad", spans[1], labels=(Label(spans[0], "one"), Label(spans[2], "three")))
    lines = render([found], {"a.rts": Source("a.rts", line)}).splitlines()
    for word, mark in (("secon", "^^^^^"), ("first", "----- one"), ("third", "----- three")):
        at = next(number for number, each in enumerate(lines) if each.endswith(mark))
        column = lines[at].index(mark)
        assert lines[at - 1][column : column + 5] == word
        assert len(lines[at - 1]) < 130
