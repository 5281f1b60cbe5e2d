"""Threat: an agent proposes a mission with tens of thousands of mistakes, and keeps the checker busy."""

import json
from time import process_time

import pytest

from rtshcua.diagnostics import codes
from rtshcua.ground.agent.json_tree import MAX_BYTES, MAX_VALUES
from rtshcua.ground.agent.specification import MAX_FINDINGS, parse_specification

#: seconds of the processor: many times what it takes, and a fraction of what it took
BOUND_S = 4.0
FEW = MAX_VALUES // 3


def found(data: bytes) -> tuple[str, ...]:
    begun = process_time()
    told = parse_specification("proposal.json", data).diagnostics
    assert process_time() - begun < BOUND_S
    return tuple(each.message for each in told)


def listed(item: bytes, count: int) -> bytes:
    return b"[" + (item + b",") * count + b"1]"


@pytest.mark.parametrize(
    ("data", "count"),
    [
        (json.dumps({f"k{number}": 1 for number in range(FEW)}).encode(), FEW + 7),
        (b'{"imports":' + listed(b"1", FEW) + b"}", FEW + 8),
        (b"{" + b'"a":1,' * FEW + b'"b":1}', FEW - 1),
        (listed('"\u202e"'.encode(), FEW), FEW),
    ],
    ids=["unknown keys", "wrong imports", "repeated keys", "hidden characters"],
)
def test_findings_are_capped_with_a_count(data: bytes, count: int) -> None:
    told = found(data)
    assert len(told) == MAX_FINDINGS + 1
    assert told[-1] == f"{count - MAX_FINDINGS} more findings are not listed"


@pytest.mark.parametrize("item", [b"[]", b"{}", b"1", b'""', b'{"a":1}'])
def test_proposal_with_too_many_values_is_refused_early(item: bytes) -> None:
    data = listed(item, MAX_BYTES // (len(item) + 1) - 2)
    specification = parse_specification("proposal.json", data)
    assert [each.code for each in specification.diagnostics] == [codes.SPECIFICATION_SIZE]
    assert specification.tree is None


def test_few_findings_are_all_reported() -> None:
    assert len(found(b'{"imports":' + listed(b"1", 90) + b"}")) == 98
