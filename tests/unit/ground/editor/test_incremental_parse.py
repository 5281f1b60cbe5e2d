"""Incremental parsing gives the same declarations, findings, spans and broken names as parsing the whole text."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.diagnostics.excerpt import hiding
from rtshcua.diagnostics.span import Source
from rtshcua.ground.editor import incremental_parse
from rtshcua.ground.editor.incremental_parse import ParsedText, parse_edited, parse_text
from rtshcua.ground.language.parse import parse
from rtshcua.library import root

LIBRARY = sorted(path for shelf in ("skills", "policies", "missions") for path in (root() / shelf).glob("*.rts"))
REJECTED = sorted((Path(__file__).parents[3] / "rejected").glob("e01*.rts"))
TEXT = "".join(path.read_text(encoding="utf-8") for path in LIBRARY)
TWINS = [path.read_text(encoding="utf-8") for path in REJECTED]
TWIN = "".join(text for text in TWINS if "\0" not in text and hiding(text) is None)
PARTS = (
    "", " ", "\n", "}", "{", "/*", "*/", "//", '"', ",", "1", "1e5", " 2e\n", ".", "zone", "zone ", "\nzone a = b\n",
    "import", "\nimport <x\n", "signal x : y = A.b stale after 2", "\nenum e { a = 1 }", "x", ";", "-", "when", "𝄞",
    "\nskill", "\nskill f()", "skill f() { }", "\nimport \"lib:skills/goto.rts\"", "policy p version 1 {", "18:00",
    "\nmission m", "\r\n", "\r", "\u202e", "\t", "@7", "test \"t\" { }", "\nnominal n { }\n", "permit any by any\n",
)  # fmt: skip


def agree(old: str, *texts: str) -> None:
    now = parse_text(Source("a.rts", old))
    assert now.parsed == parse(Source("a.rts", old))
    earlier: tuple[ParsedText, ...] = ()
    for text in texts:
        earlier, now = (*earlier, now), parse_edited(now, text, earlier)
        whole = parse(Source("a.rts", text))
        assert now.parsed.diagnostics == whole.diagnostics
        assert now.parsed == whole


@given(
    st.sampled_from([TEXT, TWIN, TEXT[:900], TWIN[:1500]]),
    st.lists(st.tuples(st.integers(0, 40_000), st.integers(0, 120), st.sampled_from(PARTS)), min_size=1, max_size=4),
    st.integers(0, 24_000),
)
def test_sequence_of_edits_gives_the_same_parse(text: str, edits: list[tuple[int, int, str]], cut_at: int) -> None:
    start = cut_at % len(text)
    text = text[start : start + 1_500]  # from any place, also within a declaration
    states = [text]
    for at, removed, put in edits:
        last = states[-1]
        at %= len(last) + 1
        states.append(last[:at] + put + last[at + removed % 60 :])
    agree(*states)


@given(st.lists(st.sampled_from(PARTS), max_size=12), st.lists(st.sampled_from(PARTS), max_size=12))
def test_text_made_of_parts_gives_the_same_parse(one: list[str], other: list[str]) -> None:
    agree("".join(one), "".join(other), "".join(one) + "".join(other))


@pytest.mark.parametrize("char", ["/", "}"])
def test_inserted_character_at_each_place_gives_the_same_parse(char: str) -> None:
    text = (
        'import "a"\nzone a = circle(47 N, 8 E, 5 m)//c\nzone b = a\nsignal c : d = E.f stale after 2\nenum g {h = 1}\n'
    )
    for at in range(len(text) + 1):
        agree(text, text[:at] + char + text[at:], text[:at] + text[at + 1 :])


def test_edit_parses_few_pieces_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """After an edit in one of many declarations, the parser reads this one and the start of the next."""
    text = "".join(f"zone z{n} = circle(47.39{n:03} N, 8.54 E, 5 m) // {n}\n" for n in range(200))
    old = parse_text(Source("a.rts", text))
    read: list[int] = []
    plain = incremental_parse._PieceBuilder.close
    monkeypatch.setattr(
        incremental_parse._PieceBuilder, "close", lambda self, *a, **k: (read.append(1), plain(self, *a, **k))[1]
    )
    for change in (("5 m) // 100\n", "55 m) // 100\n"), ("// 100", "// one hundred"), ("zone z100", "zone other")):
        read.clear()
        now = parse_edited(old, text.replace(*change, 1))
        assert now.parsed == parse(now.source)
        assert len(read) <= 2


def test_closing_a_comment_reuses_the_earlier_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    text = "".join(f"zone z{n} = circle(47.39{n:03} N, 8.54 E, 5 m) // {n}\n" for n in range(200))
    before = parse_text(Source("a.rts", text))
    opened = parse_edited(before, text.replace("zone z50", "/* zone z50"))
    read: list[int] = []
    plain = incremental_parse._PieceBuilder.close
    monkeypatch.setattr(
        incremental_parse._PieceBuilder, "close", lambda self, *a, **k: (read.append(1), plain(self, *a, **k))[1]
    )
    for now in (text, text.replace("zone z50", "/* */ zone z50")):
        assert parse_edited(opened, now, (before,)).parsed == parse(Source("a.rts", now))
        assert len(read) <= 2
