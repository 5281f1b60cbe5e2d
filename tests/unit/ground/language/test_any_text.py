"""Parsing any text ends without an exception, and accepts the same texts as Lark."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from lark import UnexpectedInput

from rtshcua.diagnostics.codes import NOT_TEXT, TOO_LARGE, UNCLOSED
from rtshcua.diagnostics.span import Source
from rtshcua.ground.format.token_reader import read
from rtshcua.ground.language import generate
from rtshcua.ground.language.automaton import Automaton
from rtshcua.ground.language.build.reader import Reader
from rtshcua.ground.language.file_findings import MAX_SIZE
from rtshcua.ground.language.parse import parse
from rtshcua.ground.language.table import MAX_SKIPPED, table
from virtual.rows import rows

CHECKOUT = Path(__file__).resolve().parents[4]
GRAMMAR = generate.GRAMMAR.read_text(encoding="utf-8")
SHIPPED = [
    path.read_text(encoding="utf-8")
    for folder in ("skills", "policies", "missions")
    for path in sorted((CHECKOUT / folder).glob("*.rts"))
] + [Path(__file__).with_name("forms.rts").read_text(encoding="utf-8")]


LED = [
    "abs(",
    "circle(",
    "falling",
    "grow(",
    "local time",
    "max",
    "on inadmissible",
    "one of",
    "repeat",
    "rising",
    "union",
]
TOKENS = sorted(
    {*table().words, *LED, *"(){},:=@+-*/", "..", "<=", "==", '"t"', "08:00", "a", "a.b", "3", "2.5", "m", "%"}
)


def sound(text: str) -> None:
    """Check that findings are in order, inside the text, and have a message."""
    source = Source("x", text)
    parsed = parse(source)
    starts = []
    for found in parsed.diagnostics:
        assert found.message
        if found.span is not None:
            assert 0 <= found.span.start <= found.span.end <= len(text)
            starts.append(found.span.start)
        for fix in found.fixes:
            assert 0 <= fix.span.start <= fix.span.end <= len(text)
    assert starts == sorted(starts)


def fits(text: str) -> bool:
    return Automaton(Reader(Source("x", text))).run(0) is None


def as_lark_reads_it(text: str) -> str | None:
    """The tokens that Lark finds, with spaces between them; None where Lark finds an error."""
    parser = generate.lark(GRAMMAR).parse_interactive(text)
    try:
        tokens = parser.exhaust_lexer()
        parser.feed_eof()
    except UnexpectedInput:
        return None
    return " ".join(tokens)


def agree(text: str) -> None:
    """Check that the parser agrees with Lark, except that words must be separated: Lark reads `skillhover` as two."""
    spaced = as_lark_reads_it(text)
    if spaced is None:
        assert not fits(text)
    else:
        assert fits(spaced)


@given(st.text())
def test_any_text_is_parsed_without_an_exception(text: str) -> None:
    sound(text)


@given(st.lists(st.sampled_from(TOKENS), max_size=60))
def test_any_tokens_are_parsed_like_lark(words: list[str]) -> None:
    sound("\n".join(words))
    agree(" ".join(words))


@given(st.data())
def test_damaged_sources(data: st.DataObject) -> None:
    text = data.draw(st.sampled_from(SHIPPED))
    start = data.draw(st.integers(0, len(text)))
    end = data.draw(st.integers(start, min(len(text), start + 20)))
    damaged = text[:start] + data.draw(st.sampled_from(["", " ", *TOKENS]) | st.text(max_size=3)) + text[end:]
    sound(damaged)
    agree(damaged)


@rows("text", SHIPPED)
def test_shipped_sources_fit(text: str) -> None:
    assert fits(text)
    agree(text)


@given(st.binary(max_size=200))
def test_any_bytes(data: bytes) -> None:
    sound(data.decode("utf-8", errors="replace"))
    sound(data.decode("latin-1"))


def test_binary_file_is_refused() -> None:
    (found,) = parse(Source("x", "zone z \0\0")).diagnostics
    assert found.code is NOT_TEXT
    assert found.span is not None
    assert found.span.start == 7


def test_too_large_file_is_refused() -> None:
    (found,) = parse(Source("x", " " * (MAX_SIZE + 1))).diagnostics
    assert found.code is TOO_LARGE
    assert parse(Source("x", " " * MAX_SIZE)).diagnostics == ()


PARTS = (
    "(", "{", "}", '"', '"\\"', "/*", "//", "a", "a.", "1", "1_", ".", "not ", "\n", "\r", "\t", ")\n", "1 m\n", "é",
    "zone ", "skill a() { x } ",
)  # fmt: skip
BEGINNINGS = ("", "skill s() {\nrequire ", "zone z = circle(", 'import "', "mission m under p@1 on v { phase a {")
#: each part in one place; a part is a hazard by itself, whatever stands before it
ONE_PLACE = [(BEGINNINGS[number % len(BEGINNINGS)], part) for number, part in enumerate(PARTS)]


def long_run(before: str, part: str) -> None:
    sound(before + part * (200_000 // len(part)))


@pytest.mark.slow
@pytest.mark.parametrize(("before", "part"), ONE_PLACE)
def test_long_run_of_one_token_ends_with_findings(before: str, part: str) -> None:
    long_run(before, part)


@pytest.mark.soak
@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("before", BEGINNINGS)
def test_long_runs_in_every_place_end_with_findings(before: str, part: str) -> None:
    long_run(before, part)


@rows("between", ["/**/", "/**/ ", "// a\n", "// a\n\n", '/* \\" */\t//\n'])
def test_comments_between_tokens_are_unlimited(between: str) -> None:
    comments = between * (3 * MAX_SKIPPED)
    one, other = f"skill{comments} a() {{{comments} deadline 1 s{comments}}}{comments}", "skill b() { deadline 1 s }"
    source = f"{comments}{one}{other}{comments}"
    found = parse(Source("x", source))
    assert [skill.name.text for skill in found.unit.skills] == ["a", "b"]
    assert found.diagnostics == ()
    assert read(source) is not None
    assert read(source + "}") is None


def test_string_with_many_escapes_is_read() -> None:
    text = '\\"' * 900
    (mission,) = parse(Source("x", f'mission m under p@1 on v {{ intent "{text}" phase a {{ b() }} }}')).unit.missions
    assert mission.intent == '"' * 900


def test_string_with_too_many_escapes_is_refused() -> None:
    (found,) = parse(Source("x", 'import "' + '\\"' * 1_000 + '"')).diagnostics
    assert found.code is UNCLOSED
