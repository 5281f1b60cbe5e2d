"""Threat: the same fields in other bytes, so that two readers read different values: white space, duplicate keys,
trailing data.
"""

import json

import pytest

from reference.forgery import expect, flight, leaf, read, rehashed
from virtual.rows import rows

LINES = flight()
NUMBER = next(number for number, line in enumerate(LINES) if read(line)["type"] == "decision")
LINE = LINES[NUMBER]
TEXT = LINE.decode().rstrip("\n")
SEQ = f'"seq":{NUMBER}'


def with_line(line: str | bytes) -> list[bytes]:
    data = line.encode() + b"\n" if isinstance(line, str) else line
    return [*LINES[:NUMBER], data, *LINES[NUMBER + 1 :]]


@rows(
    "line",
    [
        " " + TEXT,
        TEXT + " ",
        TEXT + "\r",
        TEXT.replace(",", ", ", 1),
        TEXT.replace('"seq":', '"seq": ', 1),
        json.dumps(read(LINE)),
        json.dumps(dict(reversed(read(LINE).items())), separators=(",", ":")),
        TEXT.replace(SEQ, f"{SEQ}.0", 1),
        TEXT.replace(SEQ, f"{SEQ}e0", 1),
        TEXT.replace('"type":"decision"', '"type":"\\u0064ecision"', 1),
        TEXT.replace('"mode":"software"', '"mode":"\\u0073oftware"', 1),
    ],
)
def test_whitespace_order_and_escapes(line: str) -> None:
    slug, record = expect(with_line(line))
    assert slug in ("record/not-canonical", "record/malformed")
    assert record == NUMBER


@pytest.mark.parametrize("twice", [f"{SEQ},{SEQ}", f'"seq":9,{SEQ}', f'{SEQ},"seq":9'])
def test_a_duplicate_key(twice: str) -> None:
    slug, record = expect(with_line(TEXT.replace(SEQ, twice, 1)))
    assert (slug, record) == ("record/not-canonical", NUMBER)


def test_a_duplicate_key_that_was_rehashed() -> None:
    """The link of the next line fits the doctored bytes: the form alone tells."""
    doctored = LINE.replace(SEQ.encode(), f"{SEQ},{SEQ}".encode(), 1)
    after = LINES[NUMBER + 1].replace(LINES[NUMBER + 1][10:74], leaf(doctored).hex().encode(), 1)
    forged = [*LINES[:NUMBER], doctored, *rehashed([after, *LINES[NUMBER + 2 :]])]
    assert expect(forged) == ("record/not-canonical", NUMBER)


@rows("junk", [b"\n", b" ", b"{}\n", b"\x00" * 100, LINES[-1], LINES[1], b"x" * 70_000 + b"\n"])
def test_junk_after_the_end(junk: bytes) -> None:
    assert expect([*LINES, junk]) == ("close/junk-after", len(LINES))


@pytest.mark.parametrize("junk", [b"\n", b"{}\n", b"\xef\xbb\xbf\n", b"// a note\n"])
def test_junk_in_the_middle(junk: bytes) -> None:
    assert expect([*LINES[:NUMBER], junk, *LINES[NUMBER:]]) == ("record/malformed", NUMBER)


def test_junk_at_the_end_of_a_log_without_close() -> None:
    assert expect([*LINES[:NUMBER], b"x"]) == ("record/malformed", NUMBER)
    assert expect([*LINES[:NUMBER], b"\x00" * 512 + b"x"]) == ("record/malformed", NUMBER)


def test_a_byte_order_mark() -> None:
    assert expect([b"\xef\xbb\xbf" + LINES[0], *LINES[1:]]) == ("record/malformed", 0)
