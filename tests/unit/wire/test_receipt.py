"""Receipts have exactly one encoding."""

from hypothesis import given
from hypothesis import strategies as st

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.wire import artefact, names
from rtshcua.wire.receipt import APPROVAL, Receipt, decode, encode
from virtual.rows import rows

INTEGERS = st.integers(-(1 << 63), (1 << 63) - 1)


@given(st.builds(Receipt, INTEGERS, st.text(), st.text(), INTEGERS, INTEGERS, INTEGERS, INTEGERS, st.binary()))
def test_receipt_roundtrip(receipt: Receipt) -> None:
    assert decode(encode(receipt)) == receipt


@given(st.binary(max_size=60))
def test_other_bytes_are_not_a_receipt(data: bytes) -> None:
    assert isinstance(decode(data), Refusal)


@rows(
    "body",
    [
        1,
        (),
        (1,),
        (1, "a"),
        (1, 2, "b"),
        (1, "a", "b", 1, 1, 1, 1, b"", 1),
        (1, "a", "b"),
        (1, "a", "b", 1, 1, 1, 1, ""),
    ],
)
def test_other_bodies_are_refused(body: object) -> None:
    assert isinstance(decode(artefact.wrap(names.RECEIPT, body)), Refusal)


def test_only_one_slug_is_acceptance() -> None:
    assert Receipt(APPROVAL, "accepted", "").accepted
    assert not Receipt(APPROVAL, "expired", "").accepted
