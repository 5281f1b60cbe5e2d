"""Threat: a bit of the log flips, on the disk or by hand. Every flip must be detected, in any byte."""

import random

import pytest

from reference.forgery import edit, expect, flight, prove, read, rewritten, signed, signers
from rtshcua.evidence.report import LogVerdict
from rtshcua.evidence.verify import verify


def noticed(data: bytes, at: int, bit: int) -> bool:
    """Detected by the chain alone, with no other key than the one in the log."""
    changed = data[:at] + bytes([data[at] ^ 1 << bit]) + data[at + 1 :]
    return verify(_lines(changed)).verdict is not LogVerdict.VERIFIED


def _lines(data: bytes) -> list[bytes]:
    """Split at newlines only, as a file is."""
    *lines, rest = data.split(b"\n")
    return [line + b"\n" for line in lines] + ([rest] if rest else [])


def short() -> bytes:
    """A log of few bytes: the genesis with a small bundle and root, one effect, the close."""
    lines = flight()
    return b"".join(signed([edit(lines[0], bundle="YnVuZGxl", root="cm9vdA=="), lines[2], lines[-1]]))


def test_the_forger_writes_what_the_recorder_writes() -> None:
    """Otherwise the attacks in these files would fail for the wrong reason."""
    assert tuple(signed(flight())) == flight()
    assert rewritten(flight()) == list(flight())
    assert prove(flight()).report.verdict is LogVerdict.VERIFIED
    assert verify(_lines(short())).verdict is LogVerdict.VERIFIED


def test_flipped_bit_in_any_line_is_detected() -> None:
    lines = flight()
    for number, line in enumerate(lines):
        at = line.index(b'"utc_us":') + 24  # the microseconds
        changed = line[:at] + bytes([line[at] ^ 1]) + line[at + 1 :]
        slug, record = expect([*lines[:number], changed, *lines[number + 1 :]])
        assert record == number
        assert slug == ("seal/self" if number in signers(lines) else "chain/broken"), (number, slug)


def test_a_sample_of_all_bits() -> None:
    data = b"".join(flight())
    for at in random.Random(1).sample(range(len(data)), 400):
        assert noticed(data, at, at % 8), at


def test_a_bit_of_some_bytes_of_the_close_and_of_the_seals() -> None:
    """Every byte of a short log: below. Those of all records: test_log_exhaustive."""
    lines = flight()
    data = b"".join(lines)
    for number in signers(lines)[1:]:
        start = len(b"".join(lines[:number]))
        for at in range(start, start + len(lines[number]), 5 if number == len(lines) - 1 else 51):
            assert noticed(data, at, at % 8), at


def test_a_bit_of_every_byte_of_a_short_log() -> None:
    data = short()
    assert not [at for at in range(len(data)) if not noticed(data, at, at % 8)]


@pytest.mark.soak
def test_every_bit_of_a_short_log() -> None:
    data = short()
    missed = [(at, bit) for at in range(len(data)) for bit in range(8) if not noticed(data, at, bit)]
    assert not missed


@pytest.mark.soak
def test_every_byte_of_a_whole_flight_under_audit() -> None:
    data = b"".join(flight())
    for at in range(len(data)):
        changed = _lines(data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :])
        assert prove(changed).report.verdict is not LogVerdict.VERIFIED, at


def test_flipped_bit_is_located() -> None:
    lines = flight()
    number = next(n for n, line in enumerate(lines) if read(line)["type"] == "decision")
    line = lines[number]

    def with_byte(at: int, byte: int) -> list[bytes]:
        return [*lines[:number], line[:at] + bytes([byte]) + line[at + 1 :], *lines[number + 1 :]]

    assert expect(with_byte(0, ord("["))) == ("record/malformed", number)
    assert expect(with_byte(line.index(b'"outcome"') + 1, 0xFF)) == ("record/malformed", number)
    assert expect(with_byte(line.index(b'"seq":') + 6, ord("9"))) == ("chain/sequence", number)
    assert expect(with_byte(11, ord("x"))) == ("chain/broken", number)
    assert expect(with_byte(11, ord("0") if line[11] != ord("0") else ord("1"))) == ("chain/broken", number)
