"""Statements of a boundary: one encoding, one duty, and range checks."""

import pytest
from msgspec.structs import replace

from rtshcua.model.flat.limits import MAX_VALUE
from rtshcua.model.flat.situation import Now
from rtshcua.wire import artefact, cose, names
from rtshcua.wire.clock import ClockSource
from rtshcua.wire.keys import Duty, SigningKey, WrongDuty
from rtshcua.wire.statement import MAX_STATEMENT, Statement, claimed, open_statement, sign
from rtshcua.wire.untrusted import Untrusted
from virtual.rows import rows

KEY = SigningKey.from_seed(b"b" * 32, duty=Duty.BOUNDARY)
KEYS = {KEY.kid: KEY.verification()}
SAID = Statement(
    b"f" * 16, 1, bytes(32), 2, b"d" * 32, b"m" * 16, 3, b"l" * 32, 4, 5, 6, 7, b"a" * 32,
    ClockSource.KERNEL, 8, 9, 10, final=False,
)  # fmt: skip


def slug(data: bytes) -> str:
    with pytest.raises(Untrusted) as refused:
        open_statement(data, KEYS)
    return refused.value.slug


def test_signed_statement_opens() -> None:
    assert open_statement(sign(SAID, KEY), KEYS) == claimed(sign(SAID, KEY)) == SAID
    whole = replace(SAID, marks=b"m" * 1024, count=(1 << 63) - 1, final=True)
    assert open_statement(sign(whole, KEY), KEYS) == whole
    longest = replace(whole, at_us=MAX_VALUE, utc_us=MAX_VALUE, utc_error_us=MAX_VALUE)
    assert len(sign(longest, KEY)) < MAX_STATEMENT
    assert SAID.now == Now(8, 9, 10)


def test_no_key_of_another_duty_signs_one() -> None:
    with pytest.raises(WrongDuty):
        sign(SAID, SigningKey.from_seed(b"b" * 32, duty=Duty.LOG))


@rows(
    "fields",
    [
        {"flight": b"f" * 15}, {"before": b""}, {"digest": b"d" * 31}, {"left": b""}, {"aside": b"a" * 33},
        {"marks": b"m" * 7}, {"marks": b"m" * 1032}, {"session": -1}, {"count": -1}, {"frames": -1},
        {"repeated": -1}, {"declined": -1}, {"stopped": -1}, {"ahead": -1}, {"source": -1},
        {"source": 5}, {"at_us": -1}, {"utc_us": -1}, {"utc_error_us": -1},
    ],
)  # fmt: skip
def test_statement_out_of_range_is_malformed(fields: dict[str, object]) -> None:
    assert slug(sign(replace(SAID, **fields), KEY)) == "malformed"


def test_other_bodies_are_malformed() -> None:
    for body in (1, [], [*artefact.unwrap(names.STATEMENT, artefact.pack(names.STATEMENT, SAID)), 1]):  # type: ignore[misc]
        payload = artefact.wrap(names.STATEMENT, body)
        content = names.STATEMENT.content_type
        assert slug(cose.sign1(payload, key=KEY, duty=Duty.BOUNDARY, content_type=content)) == "malformed"
    assert slug(b"") == "malformed"
    assert slug(b"x" * (MAX_STATEMENT + 1)) == "malformed"
