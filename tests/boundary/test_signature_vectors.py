"""The validity of Ed25519 signatures: the product in Python and in C, the independent verifier, and the page taken
literally, on vectors in Wycheproof's form.
"""

import ctypes
import json
from typing import Any

import pytest

from reference.edwards import L, P, counts, decoded, encoded, equation_holds, torsion
from reference.independent_root import _WEAK, holds, weak
from reference.signature_vectors import FILE, NOTES, made
from rtshcua.wire.keys import Duty, VerificationKey, is_strong, verified

GROUPS: list[dict[str, Any]] = json.loads(FILE.read_bytes())["testGroups"]
CASES = [
    (bytes.fromhex(group["publicKey"]["pk"]), bytes.fromhex(each["sig"]), bytes.fromhex(each["msg"]), each)
    for group in GROUPS
    for each in group["tests"]
]


@pytest.mark.slow
def test_the_file_is_what_the_script_makes() -> None:
    assert FILE.read_bytes() == made()
    found = {flag for *_, each in CASES for flag in each["flags"]}
    assert found == set(NOTES), "each kind of hostile signature has a case"


@pytest.mark.parametrize(
    ("key", "signature", "message", "case"), [pytest.param(*each, id=f"{each[3]['tcId']}") for each in CASES]
)
def test_all_implementations_agree_on_signature_vectors(
    boundary: ctypes.CDLL, key: bytes, signature: bytes, message: bytes, case: dict[str, Any]
) -> None:
    good = case["result"] == "valid"
    assert counts(key, signature, message) is good, case["comment"]
    assert holds(key, signature, message) is good, case["comment"]
    assert verified(key, signature, message) is good, case["comment"]
    if len(signature) == 64:  # C does not check this: its callers do
        assert bool(boundary.rt_test_verify(key, signature, message, len(message)) & 1) is good, case["comment"]


def test_some_refused_signatures_satisfy_the_equation() -> None:
    """Otherwise the refusal of points of small order, and of large s, would not be tested."""
    flags = {
        case["flags"][0] for key, signature, message, case in CASES
        if len(signature) == 64 and case["result"] == "invalid" and equation_holds(key, signature, message)
    }  # fmt: skip
    assert flags == {"SmallOrderKey", "SmallOrderR", "Malleability"}


def test_the_page_lists_all_points_of_small_order() -> None:
    listed = (FILE.parents[2] / "docs" / "log-format.md").read_text()
    ys = {point[1] for point in torsion()}
    assert ys == _WEAK
    for y in ys - {0, 1, P - 1}:
        assert y.to_bytes(32, "little").hex() in listed
    assert all(weak(encoded(point)) and not is_strong(encoded(point)) for point in torsion())


def test_weak_key_is_refused_in_trust_root() -> None:
    for group in GROUPS:
        key = bytes.fromhex(group["publicKey"]["pk"])
        flags = {flag for each in group["tests"] for flag in each["flags"]}
        if flags & {"SmallOrderKey"} or (flags == {"NonCanonical"} and decoded(key) is None):
            with pytest.raises(ValueError, match="canonical form"):
                VerificationKey(Duty.LOG, key)
        elif "NotAPoint" not in flags:
            assert VerificationKey(Duty.LOG, key).public == key


def test_the_order_is_that_of_the_base_point() -> None:
    assert L.bit_length() == 253
