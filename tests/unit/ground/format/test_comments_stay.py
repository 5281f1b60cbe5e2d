"""Comments stay between their tokens, and a `//` never hides code."""

from fuzz.targets.format import pieces
from rtshcua.diagnostics.span import Source
from rtshcua.ground.format.format import formatted
from virtual.rows import rows

CONTRACT = "skill s() {\n  deadline 2 s\n  require  battery > 30 % and gps.fix >= fix_3d\n}\n"

TABLE = {
    # an ignore's own line stays its line, and no other comes to it
    "zone a = circle(1 N, 2 E, 3 m)  ceiling 4 m  // rtshcua: ignore E1301 because x\n": None,
    "skill s() { deadline 2 s  grace 1 s  // rtshcua: ignore E1304 because x\n}\n":
        "skill s() { deadline 2 s  grace 1 s  // rtshcua: ignore E1304 because x\n}\n",
    "skill s() {\n  // rtshcua: ignore E1304 because x\n  deadline 2 s  grace 1 s\n  lasts at most 5 s }\n":
        "skill s() {\n  // rtshcua: ignore E1304 because x\n  deadline 2 s  grace 1 s\n  lasts    at most 5 s\n}\n",
    "skill s() {\n  require a < 1 and\n    b < 2  // rtshcua: ignore E1304 because x\n}\n":
        "skill s() {\n  require  a < 1\n           and\n             b < 2  // rtshcua: ignore E1304 because x\n}\n",
    "skill s(a: b\n, ) { grace 1 s  // rtshcua: ignore E1304 because x\n}\n":
        "skill s(\n  a: b,\n) { grace 1 s  // rtshcua: ignore E1304 because x\n}\n",
    # alone in a file, or in a block
    "// a": "// a\n",
    "/* a */": "/* a */\n",
    "\n\n// a\n\n\n\n// b\n\n": "// a\n\n// b\n",
    "skill s() { // a\n}": "skill s() {  // a\n}\n",
    "skill s() { /* a */ }": "skill s() { /* a */ }\n",
    "skill s() {\n// a\n}": "skill s() {\n  // a\n}\n",
    "skill s(\n// a\n) { }": "skill s(\n  // a\n) { }\n",
    # in the middle of a line
    "zone /* a */ z = circle( /* b */ 1 N, 2 E, 3 m /* c */ )":
        "zone /* a */ z = circle(/* b */ 1 N, 2 E, 3 m /* c */)\n",
    "zone // a\nz = circle(1 N, 2 E, 3 m)": "zone  // a\n  z = circle(1 N, 2 E, 3 m)\n",
    "zone z = circle(1 N, // a\n2 E, 3 m)":
        "zone z = circle(\n  1 N,  // a\n    2 E,\n  3 m,\n)\n",
    # what a comment says is its own: only blanks at the ends of its lines go
    "//\tx \t\r\n/* a\t\n\n\n  b */": "//\tx\n/* a\n\n\n  b */\n",
}  # fmt: skip


def laid_out(text: str) -> str | None:
    made = formatted(Source("x.rts", text))
    assert made.diagnostics == ()
    return made.text


@rows("before", TABLE)
def test_comments_at_special_places_are_kept(before: str) -> None:
    after = TABLE[before] or before
    assert laid_out(before) == after
    assert laid_out(after) == after


@rows("comment", ["// a\n", "/* a */", "/* a\n b */", "\n// a\n", "\n/* a */\n", '// */ "\n'])
def test_comments_between_any_two_tokens_are_kept(comment: str) -> None:
    """The tokens before and after a comment stay the same."""
    for text in (CONTRACT, 'mission m under p@1 on v { intent "x"  phase a { b(c = 1, 2 m) } }'):
        words = text.replace("(", " ( ").replace(")", " ) ").replace(",", " , ").replace("@", " @ ").split()
        for at in range(len(words) + 1):
            written = f"{' '.join(words[:at])} {comment} {' '.join(words[at:])}"
            made = laid_out(written)
            assert made is not None
            assert made.count(comment.strip()) == 1
            assert pieces(made) == pieces(written)


def test_trailing_comments_are_aligned() -> None:
    parts = [
        "deadline 2 s // a",
        "lasts at most 5 min // b",
        "grace 1 s",
        "class tactical // c",
        "",
        "energy at most 4 % // d",
    ]
    text = "skill s() {\n" + "\n".join(parts) + "\n}"
    lines = (laid_out(text) or "").splitlines()
    assert [line.find("//") for line in lines] == [-1, 26, 26, -1, 26, -1, 24, -1]


def test_wide_comment_is_not_aligned() -> None:
    wide = "x" * 100
    text = f"skill s() {{\n  deadline 2 s // {wide}\n  require battery > 30 % and gps.fix >= fix_3d // b\n}}\n"
    assert f"  deadline 2 s  // {wide}\n" in (laid_out(text) or "")


@rows("end", list("\xa0\u3000\u2028\u2029\x85\v\x1c\x1d\x1e\x1f\ufeff"), ids=ascii)
def test_other_unicode_blanks_stay_at_the_end_of_a_comment(end: str) -> None:
    for text in (f"// a{end}\n", f"skill s() {{  // a{end}\n}}\n", f"/* a{end}\n b{end} */\n"):
        assert laid_out(text) == text


def test_empty_brackets_stay_closed_with_a_comment() -> None:
    text = "skill land_somewhere(/* it takes no parameters */) {\n  deadline 2 s\n}\n"
    assert formatted(Source("x.rts", text), 40).text == text
