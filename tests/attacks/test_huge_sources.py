"""Threat: a source of megabytes keeps a build busy for minutes, or fills its log."""

from pathlib import Path

import pytest

from reference.many_rules import policy
from rtshcua.diagnostics.codes import IMPORT_PATH, TOO_LARGE
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.render import MOST_TEXT, render_one
from rtshcua.diagnostics.span import Source
from rtshcua.ground.compiler.program import examine_program
from rtshcua.ground.elaborate import elaborate
from rtshcua.ground.language import load as loading
from rtshcua.ground.language import parse as parsing
from rtshcua.ground.language.load import load
from rtshcua.ground.language.parse import parse
from rtshcua.ground.language.size import MAX_TOKENS
from rtshcua.mavlink import dialect

MOST = 1_000  # instead of `MAX_TOKENS`, for speed
LIBRARY = str(Path(__file__).resolve().parents[2])


@pytest.mark.parametrize("token", ["{", "(", "foo ", '"\n', '"x" ', "1\n"])
def test_more_words_and_marks_than_are_read(monkeypatch: pytest.MonkeyPatch, token: str) -> None:
    monkeypatch.setattr(parsing, "MAX_TOKENS", MOST)
    assert TOO_LARGE not in [each.code for each in parse(Source("a.rts", token * MOST)).diagnostics]
    found = parse(Source("a.rts", token * (MOST + 1))).diagnostics
    assert [each.code for each in found] == [TOO_LARGE]
    assert f"{MAX_TOKENS:,} words and marks" in found[0].message


def test_comments_and_blanks_count_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parsing, "MAX_TOKENS", MOST)
    for filling in ("// a b c\n", "/* a b c */", " \n", "// /* a\n"):
        assert parse(Source("a.rts", "enum e { a = 1 }\n" + filling * MOST)).diagnostics == ()


def test_more_files_than_a_program_has(monkeypatch: pytest.MonkeyPatch) -> None:
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
def test_more_rules_than_fit_are_not_looked_at(monkeypatch: pytest.MonkeyPatch, of_templates: bool) -> None:
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
    assert found[0].message == "`many` has more than 20 rules, which is what fits on board"


def test_a_long_text_that_a_finding_quotes_is_cut_for_a_person() -> None:
    told = render_one(Diagnostic(IMPORT_PATH, "x" * 10_000_000, None, "y" * 10_000_000), {})
    assert len(told) < 3 * MOST_TEXT
