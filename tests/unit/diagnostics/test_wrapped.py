"""Lines are wrapped to 80 columns."""

from hypothesis import given
from hypothesis import strategies as st

from rtshcua.diagnostics.wrapped import WIDTH, wrapped

DIGEST = "0123456789abcdef" * 4


def test_line_that_fits_is_unchanged() -> None:
    for line in ("", "x" * WIDTH, "  a   b", "y" * 10):
        assert wrapped(line) == [line]


def test_continuation_lines_are_indented_to_the_text() -> None:
    words = "word " * 30
    for head in (
        "error: ",
        " help: ",
        "error[E0716]: ",
        "   = help: ",
        "  + ",
        "  name      value  ",
        "· event   step  ",
    ):
        lines = wrapped(head + words.strip())
        assert lines[0].startswith(head)
        assert all(line.startswith(" " * len(head) + "word") for line in lines[1:]), head
        assert max(map(len, lines)) <= WIDTH
    assert all(line.startswith("  word") for line in wrapped(words.strip())[1:])


def test_command_in_backticks_is_kept_on_one_line() -> None:
    command = "`rtshcua keys approver NAME --role ROLE`"
    assert any(command in line for line in wrapped(f"error: {'x ' * 25}{command} and so on, at some length"))
    lines = wrapped(f"`{'a b ' * 40}`")
    assert max(map(len, lines)) <= WIDTH


def test_word_longer_than_a_line_gets_a_line_of_its_own() -> None:
    path = "/" + "folder/" * 20
    for long in (DIGEST, path):
        (line,) = [each for each in wrapped(f"  policy        digest {long}, and then some more words") if long in each]
        assert line.strip() == f"{long},"
    assert max(map(len, wrapped(f"  policy        digest {DIGEST}, key"))) <= WIDTH


def test_colour_sequences_have_no_width() -> None:
    coloured = "  " + "\x1b[1mword\x1b[0m " * 15
    assert wrapped(coloured.rstrip()) == [coloured.rstrip()]
    assert len(wrapped(coloured * 2)) > 1


@given(st.text(st.sampled_from("ab `:.-+=·/ ")), st.integers(0, 40))
def test_no_text_is_lost_and_only_single_words_exceed_the_width(text: str, count: int) -> None:
    line = text + "xy " * count + text
    lines = wrapped(line)
    assert "".join("".join(lines).split()) == "".join(line.split())
    assert all(len(each) <= WIDTH or " " not in each.strip() for each in lines)


def test_own_commands_are_never_broken() -> None:
    command = f"`rtshcua keys accept {'/a/long/folder/' * 6}root.trust --vehicle IDENTITY`"
    assert command in [line.strip() for line in wrapped(f"type {command} then")]
    assert max(map(len, wrapped(f"a `{'word ' * 40}`"))) <= WIDTH
