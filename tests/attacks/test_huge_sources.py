"""Threat: a source of megabytes occupies a build for minutes, or fills its log."""

import ast
import json
import re
import re._constants as constants  # type: ignore[import-not-found]
import re._parser as patterns  # type: ignore[import-not-found]
import tracemalloc
from collections.abc import Iterator
from pathlib import Path
from time import process_time
from typing import Any

import pytest

from reference.many_rules import policy
from rtshcua.app.layout import of_file
from rtshcua.diagnostics.codes import IMPORT_PATH, TOO_LARGE, UNKNOWN_IGNORE
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.render import MOST_TEXT, render_one
from rtshcua.diagnostics.span import Source
from rtshcua.ground.checker.geojson import NoArea, read_area
from rtshcua.ground.elaborate import elaborate
from rtshcua.ground.format import format_text as attempting
from rtshcua.ground.format.format_text import format_text
from rtshcua.ground.format.token_sheet import gap_of
from rtshcua.ground.language import load as loading
from rtshcua.ground.language import parse as parsing
from rtshcua.ground.language.load import load
from rtshcua.ground.language.parse import parse
from rtshcua.ground.language.paths import shown
from rtshcua.ground.language.size_limits import MAX_TOKENS
from rtshcua.ground.language.table import PATH as TABLE
from rtshcua.ground.lint import ignores as ignoring
from rtshcua.ground.lint.ignores import ignores
from rtshcua.ground.pipeline.program import examine_program
from rtshcua.mavlink import dialect

MOST = 1_000  # instead of `MAX_TOKENS`, for speed
LIBRARY = str(Path(__file__).resolve().parents[2])


@pytest.mark.parametrize("token", ["{", "(", "foo ", '"\n', '"x" ', "1\n"])
def test_source_with_too_many_tokens_is_refused(monkeypatch: pytest.MonkeyPatch, token: str) -> None:
    monkeypatch.setattr(parsing, "MAX_TOKENS", MOST)
    assert TOO_LARGE not in [each.code for each in parse(Source("a.rts", token * MOST)).diagnostics]
    found = parse(Source("a.rts", token * (MOST + 1))).diagnostics
    assert [each.code for each in found] == [TOO_LARGE]
    assert f"{MAX_TOKENS:,} tokens" in found[0].message


def test_comments_and_blanks_do_not_count_as_tokens(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parsing, "MAX_TOKENS", MOST)
    for filling in ("// a b c\n", "/* a b c */", " \n", "// /* a\n"):
        assert parse(Source("a.rts", "enum e { a = 1 }\n" + filling * MOST)).diagnostics == ()


def test_program_with_too_many_files_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loading, "MAX_FILES", 3)
    asked: list[str] = []

    def read(path: str) -> bytes:
        asked.append(path)
        if path != "x.rts":
            raise FileNotFoundError
        return "".join(f'import "f{number}.rts"\n' for number in range(9)).encode()

    program = load(["x.rts"], read)
    assert asked == ["x.rts", "f0.rts", "f1.rts"]
    assert [each.code.id for each in program.diagnostics] == ["E0104", "E0108", "E0108"]
    assert not program.whole


@pytest.mark.parametrize("of_templates", [False, True])
def test_policy_with_too_many_rules_is_not_checked_further(monkeypatch: pytest.MonkeyPatch, of_templates: bool) -> None:
    monkeypatch.setattr(elaborate, "MAX_RULES", 20)
    text = policy("apart", 10 if of_templates else 30)
    if of_templates:
        text = (
            "role other, third\ntemplate t() {\n  permit goto by role other\n  permit goto by role third\n}\n"
            + text.replace("  contingency", "  use t()\n" * 6 + "  contingency")
        )
    lines = text.splitlines(keepends=True)
    text = "".join(sorted(lines, key=lambda line: not line.startswith("import")))
    program = load(["x.rts"], lambda path: text.encode() if path == "x.rts" else Path(path).read_bytes(), LIBRARY)
    found = examine_program(program, dialect.load()).diagnostics
    assert [each.code.id for each in found] == ["E1001"]
    assert found[0].message == "`many` has more than 20 rules, the limit"


def test_a_long_text_that_a_finding_quotes_is_cut_for_a_person() -> None:
    told = render_one(Diagnostic(IMPORT_PATH, "x" * 10_000_000, None, "y" * 10_000_000), {})
    assert len(told) < 3 * MOST_TEXT


@pytest.mark.parametrize(
    "text",
    ['import "{}"\n', 'import "{}', '"{}"', "zone {} {{}}\n", "zone a = circle(47 N, 8 E, {} m)\n", "/*{}*/"],
)
@pytest.mark.parametrize("filling", ["x", "\U0001f600", '\\"', "1_", "a.", "* "])
def test_long_token_uses_bounded_memory(text: str, filling: str) -> None:
    source = Source("a.rts", text.format(filling * 50_000))
    parse(source)  # the table is read
    tracemalloc.start()
    try:
        parse(source)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 20 * len(source.text.encode()) + 500_000


def single(items: Any) -> bool:
    """Whether a part of a pattern is one character."""
    (op, value), *more = items
    if op is constants.SUBPATTERN:
        return not more and value[0] is None and single(value[-1])
    return not more and op in (constants.ANY, constants.IN, constants.LITERAL, constants.NOT_LITERAL)


def given_back(items: Any) -> Iterator[Any]:
    """The groups that a pattern repeats without end and may give back: each repetition is kept in memory for that, 130
    bytes of it, so a text of 8 MiB takes gigabytes.
    """
    for op, value in items:
        match op:
            case constants.MAX_REPEAT | constants.MIN_REPEAT | constants.POSSESSIVE_REPEAT:
                _, most, repeated = value
                if op is not constants.POSSESSIVE_REPEAT and most is constants.MAXREPEAT and not single(repeated):
                    yield repeated
                yield from given_back(repeated)
            case constants.SUBPATTERN:
                yield from given_back(value[-1])
            case constants.BRANCH:
                for branch in value[1]:
                    yield from given_back(branch)
            case constants.ASSERT | constants.ASSERT_NOT:
                yield from given_back(value[1])
            case constants.ATOMIC_GROUP:
                yield from given_back(value)


def written_patterns() -> Iterator[tuple[str, str, int]]:
    """Each pattern that stands in a module as a whole, and those of the language's words."""
    raw = json.loads(TABLE.read_text(encoding="utf-8"))
    yield from ((name, each, 0) for name, each in [*raw["patterns"], *(("ignored", each) for each in raw["ignored"])])
    for file in sorted((Path(LIBRARY) / "rtshcua").rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(text)) if re.search(r"\bre\.[a-z]+\(", text) else ():
            match node:
                case ast.Call(func=ast.Attribute(value=ast.Name(id="re")), args=[ast.Constant(value=str(each)), *_]):
                    yield file.name, each, re.VERBOSE if "VERBOSE" in ast.unparse(node) else 0


def test_regular_expressions_do_not_backtrack() -> None:
    assert list(given_back(patterns.parse(r'"(?:[^"]|\\.)*"')))
    found = [(name, each) for name, each, flags in written_patterns() if list(given_back(patterns.parse(each, flags)))]
    assert found == []


def test_unclosed_text_is_scanned_once() -> None:
    text = b'"' + b'\\"' * 60_000  # from each quote to the end: minutes
    before = process_time()
    with pytest.raises(NoArea) as refused:
        read_area(text, None)
    assert refused.value.message == "line 1, column 1: unterminated string starting at"
    assert process_time() - before < 3


def test_comments_on_one_line_are_joined_once() -> None:
    gap = gap_of("/*1*/ /*2*/\n/*3*/  // 4\n" + "/**/" * 300_000, at_start=True, at_end=True)
    assert [each.text[:11] for each in gap.comments] == ["/*1*/ /*2*/", "/*3*/ // 4", "/**/ /**/ /"]
    assert [(each.first, each.last) for each in gap.comments] == [(True, True)] * 3


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    ["{word}{comment}" * 6_000, "{word}" * 6_000 + "{comment}" * 6_000, "{comment}" * 6_000 + "{word}" * 6_000],
)
def test_line_with_many_ignores_is_scanned_once(text: str) -> None:
    source = text.format(word='import "a.rts" ', comment="/* rtshcua: ignore E1303 because why */ ")
    before = process_time()
    made = format_text(source)
    assert isinstance(made, str)
    assert made.count("ignore") == 6_000
    assert process_time() - before < 8  # a minute and more, when each walked all of it


def test_too_many_comments_are_not_formatted(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(attempting, "MAX_TOKENS", 20)
    fits = "//\n" * 10 + "/**/" * 10 + 'import "//"' + "\n"
    assert isinstance(format_text(fits), str)
    many = tmp_path / "many.rts"
    many.write_text("//" * 50 + "\n" + fits)
    laid = of_file(many, 100, write=True)
    assert [each.message for each in laid.diagnostics] == [
        f"`{shown(str(many))}` has more than 500,000 comments, the limit"
    ]
    assert laid.unreadable
    assert [each.code for each in laid.diagnostics] == [TOO_LARGE]
    assert many.read_text() == "//" * 50 + "\n" + fits


def test_too_many_tokens_are_not_formatted(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for module in (attempting, parsing):
        monkeypatch.setattr(module, "MAX_TOKENS", 20)
    many = tmp_path / "many.rts"
    many.write_text('import "a.rts"\n' * 11)
    laid = of_file(many, 100, write=True)
    assert [each.code for each in laid.diagnostics] == [TOO_LARGE]
    assert laid.unreadable


def test_ignores_of_unknown_codes_are_cheap(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ignoring, "MOST_GUESSES", 3)
    found = ignores(Source("a.rts", "// rtshcua: ignore E1333 because why\n" * 5)).faults
    assert [bool(each.fixes) for each in found] == [True] * 3 + [False] * 2
    assert [each.code for each in found] == [UNKNOWN_IGNORE] * 5
    many = ignores(Source("a.rts", "// rtshcua: ignore " + "E1303, " * 101 + "because why"))
    assert [each.message for each in many.faults] == ["this names more than 100 codes, so it has no effect"]
    assert many.valid == ()
    assert len(ignores(Source("a.rts", "// rtshcua: ignore " + "E1303, " * 100 + "because why")).valid) == 100
