"""Threat: any small change of a log of 200 records. No verifier accepts a changed byte, record or length.

All cases for the full, the fast and the independent verifier; `make test` runs a sample, `make soak` all.
"""

from bisect import bisect_right
from collections.abc import Iterable
from functools import cache
from itertools import accumulate

import pytest

from reference.log_mutants import RECORDS, REJECTED, Verifiers, flipped, whole

LINES = whole()
DATA = b"".join(LINES)
STARTS = (0, *accumulate(map(len, LINES)))
SHARDS = 32
STRIDE = 1_013  # step of the sample, coprime to the log's periods


@cache
def verifiers() -> Verifiers:
    return Verifiers()


def line_at(offset: int) -> int:
    return bisect_right(STARTS, offset) - 1


def accepted(offsets: Iterable[int]) -> list[int]:
    """The bytes whose change not all three verifiers detect."""
    missed = []
    for at in offsets:
        number = line_at(at)
        one, other, quick = verifiers().judge(number, flipped(DATA, at)[STARTS[number] :])
        if quick or (one, other) not in REJECTED:
            missed.append(at)
    return missed


def not_incomplete(cuts: Iterable[int]) -> list[int]:
    """The places of cuts that not all verifiers report as incomplete, or as broken within the genesis."""
    missed = []
    for at in cuts:
        number = line_at(at)
        words = verifiers().judge(number, DATA[STARTS[number] : at])
        wanted = ("failed", "broken", False) if at < STARTS[1] else ("incomplete", "incomplete", False)
        if words != wanted:
            missed.append(at)
    return missed


def rearranged(numbers: Iterable[int]) -> list[tuple[str, int]]:
    """The records whose deletion, duplication or swap not all verifiers detect."""
    missed = []
    for number in numbers:
        line, after = LINES[number], LINES[number + 1 :]
        changes = {
            "deleted": after,
            "duplicated": (line, line, *after),
            "at the end": (*LINES[number:], line),
            "swapped": (*after[:1], line, *after[1:]),
            "replaced": (LINES[number - 1], *after),
        }
        if not after:
            del changes["swapped"], changes["deleted"]  # the same, and cut off
        for name, changed in changes.items():
            one, other, quick = verifiers().judge(number, b"".join(changed))
            if quick or (one, other) not in REJECTED:
                missed.append((name, number))
    return missed


def test_the_log_itself() -> None:
    assert len(LINES) == RECORDS
    for number in (0, 1, RECORDS // 2, RECORDS - 1):
        assert verifiers().judge(number, DATA[STARTS[number] :]) == ("verified", "closed", True)


def test_a_sample_of_its_bytes() -> None:
    assert accepted(range(0, len(DATA), STRIDE)) == []


def test_a_sample_of_its_cuts() -> None:
    assert not_incomplete(range(0, len(DATA), STRIDE)) == []
    assert not_incomplete(STARTS[:-1]) == []


def test_a_sample_of_its_records() -> None:
    assert rearranged(range(0, RECORDS, 11)) == []


@pytest.mark.soak
@pytest.mark.parametrize("shard", range(SHARDS))
def test_every_byte(shard: int) -> None:
    assert accepted(range(shard, len(DATA), SHARDS)) == []


@pytest.mark.soak
@pytest.mark.parametrize("shard", range(SHARDS))
def test_every_cut(shard: int) -> None:
    assert not_incomplete(range(shard, len(DATA), SHARDS)) == []


@pytest.mark.soak
def test_every_record() -> None:
    assert rearranged(range(RECORDS)) == []
