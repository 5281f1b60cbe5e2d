"""COSE receipts that the log key did not sign, or that are malformed."""

from typing import Any

from reference.proof_parts import (
    LOG,
    OTHER,
    THIEF,
    origin,
    receipt,
    receipt_of_record,
    slug_of_receipt,
)
from rtshcua.wire import cbor
from virtual.rows import rows


def test_forged_receipt_is_rejected() -> None:
    assert slug_of_receipt(receipt()) == "believed"
    assert slug_of_receipt(receipt(sign_it=True)) == "believed"
    path = cbor.decode(cbor.decode(receipt_of_record(3)[1:])[1][396][-1][0])[2]  # type: ignore[index,arg-type,call-overload]
    sized = {15: {1: origin(LOG), 2: "7"}}
    assert slug_of_receipt(receipt(size=7)) == "proof/malformed"  # a path of the same shape
    assert slug_of_receipt(receipt(size=7, protected=sized)) == "proof/signature"
    assert slug_of_receipt(receipt(size=3, protected={15: {1: origin(LOG), 2: "3"}})) == "proof/path"
    assert slug_of_receipt(receipt(size=-6, protected={15: {1: origin(LOG), 2: "-6"}})) == "proof/path"
    assert slug_of_receipt(receipt(number=2)) == "proof/path"
    assert slug_of_receipt(receipt(path=path[::-1])) == "proof/signature"  # type: ignore[index]
    assert slug_of_receipt(receipt(unprotected={"rtshcua/record": LOG.lines[4]})) == "proof/path"
    edited = LOG.lines[3].replace(b'"token":3', b'"token":4')
    assert slug_of_receipt(receipt(unprotected={"rtshcua/record": edited})) == "proof/signature"
    assert slug_of_receipt(receipt(unprotected={"rtshcua/record": LOG.lines[3][:-1]})) == "proof/record"
    assert slug_of_receipt(receipt(unprotected={"rtshcua/record": b"{}\n"})) == "proof/record"
    assert slug_of_receipt(receipt(unprotected={"rtshcua/root": b"junk"})) == "trust/root-malformed"
    assert slug_of_receipt(receipt(signature=bytes(64))) == "proof/signature"
    assert slug_of_receipt(receipt(protected={4: THIEF.kid}, sign_it=True)) == "trust/log-key"
    assert slug_of_receipt(receipt(protected={15: {1: origin(OTHER), 2: "6"}})) == "proof/signature"
    assert slug_of_receipt(receipt(protected={15: {1: "elsewhere", 2: "6"}}, sign_it=True)) == "proof/origin"


@rows(
    "fields",
    [
        {"protected": {1: -8}}, {"protected": {395: 2}}, {"protected": {2: (395,)}},
        {"protected": {15: {1: 7, 2: "6"}}},
        {"protected": {15: {1: "x", 2: "6", 3: 0}}}, {"path": ()}, {"path": (bytes(31),)}, {"path": ("x",)},
        {"path": 7},
        {"size": True}, {"number": None}, {"payload": bytes(32)}, {"unprotected": {"more": 1}},
        {"unprotected": {396: {-1: (b"",)}}}, {"unprotected": {396: {-2: (b"",)}}}, {"unprotected": {396: 7}},
        {"unprotected": {"rtshcua/root": 7}}, {"signature": 7},
    ],
)  # fmt: skip
def test_malformed_receipt_is_rejected(fields: dict[str, Any]) -> None:
    assert slug_of_receipt(receipt(**fields)) == "proof/malformed"
