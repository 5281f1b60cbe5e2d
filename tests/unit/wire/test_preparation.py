"""The preparation permit: encoding, decoding, and malformed ones."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtshcua.wire.preparation import MOST, ParameterWrite, Preparation, decode, encode, open_preparation, seal

KEY, OTHER = bytes(range(32)), bytes(32)
WORD = st.integers(0, 2**32 - 1)
NAMES = st.text(st.characters(min_codepoint=1, max_codepoint=127), max_size=16)
WRITES = st.lists(st.builds(ParameterWrite, NAMES, WORD, WORD), max_size=MOST).map(tuple)
LONG = st.integers(0, 2**63 - 1)
PREPARATIONS = st.builds(Preparation, LONG, st.booleans(), LONG, WRITES)
ONE = Preparation(1, False, 5, (ParameterWrite("FENCE_RADIUS", 1, 2),))


@given(PREPARATIONS)
def test_preparation_roundtrip(preparation: Preparation) -> None:
    assert decode(encode(preparation)) == preparation
    assert open_preparation(seal(preparation, KEY), KEY) == preparation
    assert open_preparation(seal(preparation, KEY), OTHER) is None


@given(st.binary(max_size=200))
def test_hostile_octets_are_refused(data: bytes) -> None:
    found = decode(data)
    assert found is None or encode(found) == data
    assert open_preparation(data, KEY) is None


def test_changed_permit_octet_is_refused() -> None:
    sealed = seal(ONE, KEY)
    for at in range(len(sealed)):
        assert open_preparation(sealed[:at] + bytes([sealed[at] ^ 1]) + sealed[at + 1 :], KEY) is None


def test_malformed_body_is_refused() -> None:
    body = encode(ONE)
    assert decode(body) == ONE
    name = body.index(b"FENCE")
    for bad in (
        b"", body[:-1], body + b"\0", b"\2" + body[1:], body[:name] + b"\xff" + body[name + 1 :],
        body[:name] + b"\0" + body[name + 1 :],
    ):  # fmt: skip
        assert decode(bad) is None
    assert decode(body[:18] + bytes([MOST + 1]) + body[19:]) is None


def test_permit_has_a_parameter_limit() -> None:
    with pytest.raises(ValueError, match="at most 32"):
        encode(Preparation(1, False, 5, ONE.writes * (MOST + 1)))
