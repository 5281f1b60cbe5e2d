"""Comments that ignore findings, compared with a naive reading of the same text."""

from hypothesis import given
from hypothesis import strategies as st

from reference import ignoring
from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.format.token_sheet import gap_of
from rtshcua.ground.lint.filter import filter_findings
from rtshcua.ground.lint.ignores import comments, ignores
from virtual.rows import rows

CODES = (codes.NAMING, codes.UNUSED, codes.UNDECIDED, codes.SYNTAX, codes.UNUSED_IGNORE)
PIECES = st.sampled_from(
    [
        "\n", "\n", "\n", " ", "\r\n", "//", "/*", "*/", '"', "\\", "a", "zone", "because", " because it is so", ",",
        "// rtshcua: ignore E1302 because it is so", "// rtshcua: ignore-file naming, unused because it is so\n",
        "/* rtshcua: ignore E1103,E1301 because it is so */", "// rtshcua:ignore E1302 E1301 because it is so\n",
        "rtshcua: ignore", " naming", " E1301", " E0101", " unused-ignore", " nothing",
        " because ...", " because `\u200b`", "\u00a0", "// rtshcua: ignore E1302 because 30",
    ]
)  # fmt: skip
TEXTS = st.lists(PIECES, max_size=24).map("".join)


@given(TEXTS, st.lists(st.tuples(st.sampled_from(CODES), st.integers(0, 400)), max_size=8))
def test_ignores_agree_with_a_naive_reading(text: str, places: list[tuple[codes.Code, int]]) -> None:
    source = Source("x", text)
    found = {Diagnostic(code, "it is so", Span("x", min(at, len(text)), len(text))) for code, at in places}
    sifted = filter_findings(found, {"x": source}, ["x"], {})
    assert {each.diagnostic for each in sifted.ignored} == ignoring.ignored(source, found)
    assert {each for each in sifted.found if each in found} == found - {each.diagnostic for each in sifted.ignored}


@given(TEXTS)
def test_comments_agree_with_a_naive_reading(text: str) -> None:
    found = [(each.inside.rstrip("\r"), each.alone, not each.begun) for each in comments(Source("x", text))]
    naive = [(each.text.rstrip("\r"), each.alone, each.at_top) for each in ignoring.remarks(text)]
    assert found == naive
    holding = [each for each in comments(Source("x", text)) if "rtshcua:" in each.inside]
    assert list(comments(Source("x", text), "rtshcua:")) == holding


@given(TEXTS)
def test_fix_removes_only_the_unused_ignore(text: str) -> None:
    source = Source("x", text)
    for each in ignores(source).valid:
        start, end = each.fix.span.start, each.fix.span.end
        gone = text[start:end]
        rest = text[:start] + each.fix.replacement + text[end:]
        assert each.fix.replacement == ""
        left = {(one.code, one.line is None, one.reason) for one in ignores(Source("x", rest)).valid}
        assert left <= {(one.code, one.line is None, one.reason) for one in ignores(source).valid}
        assert each.code.id in gone or each.code.slug in gone
        outside = gone.replace("\n", "", 1).strip()
        assert outside.startswith(("//", "/*")) or "because" not in gone


@rows(
    ("comment", "line"),
    [
        ("\n{} \na\n", 3),
        ("\n{}\n\n  \n// more\n\na\nb", 7),  # blank lines and comments are between
        ("/* why */ {}\na", 2),
        ("/* why\n */ {}\na", 3),
        ("a /* why */ {}\nb", 1),
        ("a\n{}", 3),
    ],
)
def test_ignore_applies_to_the_next_line_with_code(comment: str, line: int) -> None:
    for marks in ("// {}", "/* {} */"):
        text = comment.format(marks.format("rtshcua: ignore E1302 because it is so"))
        (given,) = ignores(Source("x", text)).valid
        assert given.line == line


@rows(
    ("reason", "says_why"),
    [
        ("the letter says 30 m", True), ("EU 2019/947", True), ("das Amt für X", True), ("规定如此", True),
        ("...", False), ("`\u200b`", False), ("---", False), ("2019", False), ("\u200b" * 3, False), ("ok", False),
    ],
)  # fmt: skip
def test_reason_must_contain_letters(reason: str, says_why: bool) -> None:
    read = ignores(Source("x", f"// rtshcua: ignore E1302 because {reason}\n"))
    assert [each.code.id for each in read.faults] == ([] if says_why else ["E1310"])


@rows("blank", ["", " ", "\t", "\u00a0", "\u3000", "\x0b", "\x1c", "\u2028"])
@rows("word", ["ignore", "ignore-file", "ignored", "ignore,"])
@rows("marks", ["//{}", "/*{}*/"])
def test_formatter_recognizes_the_same_comments(blank: str, word: str, marks: str) -> None:
    comment = marks.format(f"{blank}rtshcua:{blank}{word} E1302 because it is so")
    (row,) = gap_of(f"\n{comment}\n", at_start=True, at_end=False).comments
    given = ignores(Source("x", f"{comment}\n")).valid
    assert row.ignores == any(each.line is not None for each in given)
