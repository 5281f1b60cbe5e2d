"""STATUSTEXT: reassembled, quoted, bounded and rate-limited; and our own announcements."""

from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.adapters.vehicle.messages import BURST, CHUNK_US, EACH_US, KEPT, LONGEST, Announcer, StatusTexts, quoted
from rtshcua.codec.frames import Codec
from rtshcua.onboard.ports import StatusText

S = 1_000_000


def text(content: str, number: int = 0, chunk: int = 0, severity: int = 6) -> Any:
    message = mavlink.MAVLink_statustext_message(severity, content.encode("latin-1"), number, chunk)
    return Codec(1, 1).parse(Codec(1, 1).pack(message))[0].message


def test_a_short_text_is_there_at_once_and_loses_its_padding() -> None:
    assert StatusTexts().take(text("Landing detected\t", 5), S) == [StatusText(S, 6, "Landing detected")]
    assert StatusTexts().take(text("Arm: Accels inconsistent", severity=2), S) == [
        StatusText(S, 2, "Arm: Accels inconsistent")
    ]


def test_chunks_are_put_together() -> None:
    texts, parts = StatusTexts(), ("a" * 50, "b" * 50, "c")
    said = [texts.take(text(part, 3, at), at) for at, part in enumerate(parts)]
    assert said == [[], [], [StatusText(2, 6, "".join(parts))]]


def test_a_full_text_without_a_number_has_no_more_chunks() -> None:
    assert StatusTexts().take(text("a" * 50), 0) == [StatusText(0, 6, "a" * 50)]


def test_a_missing_chunk_does_not_join_what_does_not_belong_together() -> None:
    texts = StatusTexts()
    assert texts.take(text("a" * 50, 3, 0), 0) == []
    assert texts.take(text("end", 4, 1), 1) == [StatusText(1, 6, "a" * 50), StatusText(1, 6, "end")]
    assert texts.take(text("b" * 50, 5, 0), 2) == []
    assert texts.take(text("third", 5, 2), 3) == [StatusText(3, 6, "b" * 50), StatusText(3, 6, "third")]


def test_incomplete_text_is_reported_as_received() -> None:
    texts = StatusTexts()
    texts.take(text("a" * 50, 3, 0), 0)
    assert texts.due(CHUNK_US) == []
    assert texts.due(CHUNK_US + 1) == [StatusText(CHUNK_US + 1, 6, "a" * 50)]
    assert texts.due(CHUNK_US + 2) == []


def test_a_text_that_never_ends_is_bounded() -> None:
    texts = StatusTexts()
    said = [one for at in range(20) for one in texts.take(text("x" * 50, 9, at), at)]
    assert said
    assert all(len(one.text) <= LONGEST for one in said)


def test_empty_text_is_ignored() -> None:
    assert StatusTexts().take(text("\t"), 0) == []


def test_a_flood_is_cut_and_what_was_left_out_is_counted() -> None:
    texts = StatusTexts()
    said = [one for at in range(1_000) for one in texts.take(text(f"text {at}"), at)]
    assert len(said) == BURST
    (later,) = texts.take(text("after it"), 60 * S)
    assert later.text == f"after it ({1_000 - BURST} texts before it were left out)"
    (calm,) = texts.take(text("calm"), 61 * S)
    assert calm.text == "calm"


def test_control_characters_and_what_turns_text_around_are_quoted() -> None:
    assert quoted("a\x1b[2Jb\r\n\u202ec\u0007") == "a\\x1b[2Jb\\r\\n\\u202ec\\x07"
    assert quoted("ascii und Umlaute: äöü") == "ascii und Umlaute: äöü"


@given(st.text(), st.integers(0, 65_535), st.integers(0, 255), st.integers(0, 10**12))
def test_whatever_is_said_prints_on_one_line(content: str, number: int, chunk: int, at_us: int) -> None:
    message = mavlink.MAVLink_statustext_message(0, b"", number, chunk)
    message.text = content
    texts = StatusTexts()
    for said in [*texts.take(message, at_us), *texts.due(at_us + CHUNK_US + 1)]:
        assert said.text.isprintable()
        assert 0 < len(said.text) <= LONGEST


def test_an_announcement_has_fifty_octets_at_most_and_its_severity() -> None:
    announcer = Announcer()
    announcer.add(4, "deny inspect_area(area = bridge_a, altitude = 20 m): authority/out-of-scope – no")
    (message,) = announcer.due(0, busy=False)
    (frame,) = Codec(1, 1).parse(Codec(1, 191).pack(message))
    assert frame.message.text == "deny inspect_area(area = bridge_a, altitude = 20 m"
    assert frame.message.severity == 4


def test_announcements_wait_for_a_free_link_and_the_oldest_are_left_out() -> None:
    announcer = Announcer()
    for number in range(10):
        announcer.add(6, f"{number}")
    assert announcer.due(0, busy=True) == []
    sent = [message.text for at in range(10) for message in announcer.due(at * EACH_US, busy=False)]
    assert sent == ["6", "7", "8", "9"]
    assert len(sent) == KEPT
    announcer.add(6, "a")
    announcer.add(6, "b")
    assert len(announcer.due(100 * EACH_US, busy=False)) == 1
    assert announcer.due(101 * EACH_US - 1, busy=False) == []
