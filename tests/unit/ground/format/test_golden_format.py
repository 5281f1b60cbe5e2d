"""Pairs of sources before and after formatting, in `tests/golden/format`."""

import re
from pathlib import Path

from rtshcua.diagnostics.span import Source
from rtshcua.ground.format.format import formatted
from virtual.rows import rows

GOLDEN = Path(__file__).resolve().parents[3] / "golden" / "format"
PAIRS = sorted(GOLDEN.glob("*.before.rts"))


def read(path: Path) -> str:
    return path.read_bytes().decode()


@rows("before", PAIRS, ids=lambda path: path.name.partition(".")[0])
def test_formatted_text_matches_the_golden(before: Path) -> None:
    after = before.with_name(before.name.replace(".before.", ".after."))
    made = formatted(Source("x.rts", read(before)))
    assert made.diagnostics == ()
    assert made.text == read(after)
    assert formatted(Source("x.rts", read(after))).text == read(after)


def test_each_golden_is_a_pair() -> None:
    assert len(PAIRS) >= 5
    assert {path.name.partition(".")[0] for path in GOLDEN.iterdir()} == {path.name.partition(".")[0] for path in PAIRS}


def test_formatting_page_shows_formatted_examples() -> None:
    page = read(GOLDEN.parents[2] / "docs" / "formatting.md")
    blocks = re.findall(r"^```rts\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
    assert blocks
    for block in blocks:
        assert formatted(Source("x.rts", block)).text == block


def test_language_page_shows_formatted_examples() -> None:
    """The columns of the examples may differ, but none is refused."""
    page = read(GOLDEN.parents[2] / "docs" / "language.md")
    for block in re.findall(r"^```rts\n(.*?)^```$", page, re.DOTALL | re.MULTILINE):
        assert formatted(Source("x.rts", block)).diagnostics == ()
