"""C opens the trust roots and bundles that Python opens, and refuses all others by the same slug."""

import ctypes
from collections import Counter
from random import Random

import pytest

from boundary.opening import (
    MANY,
    SIGNED_ROOT,
    Boundary,
    agree_on_bundle,
    agree_on_root,
    rich,
    some_bundle,
    some_root,
)
from reference import bundle_case
from reference.bundle_case import NOW, ROOT, root
from rtshcua.model.flat.limits import MAX_KEYS, MAX_REVOKED
from rtshcua.wire import cbor, cose, names
from rtshcua.wire.keys import Duty, SigningKey
from rtshcua.wire.trust import MAX_ROOT, TrustRoot


@pytest.fixture(scope="module")
def c(boundary: ctypes.CDLL) -> Boundary:
    return Boundary(boundary)


def compare(c: Boundary, seed: int, count: int) -> Counter[str]:
    """Count the mutants of roots and bundles that both accept or refuse, by reason."""
    random, found = Random(seed), Counter[str]()
    for number in range(count):
        pin = random.choice(
            (ROOT.public, ROOT.kid, None, ROOT.kid[::-1], bytes(32)) if number % 4 == 0 else (ROOT.public,)
        )
        if number % 3 == 0:
            trust = agree_on_root(c, some_root(random), pin, NOW + random.choice((0, 0, 0, -1, 1)))
            found[f"root {trust if isinstance(trust, str) else 'accepted'}"] += 1
            if isinstance(trust, TrustRoot):
                found[f"{agree_on_bundle(c, bundle_case.sealed(), trust)}"] += 1
            continue
        trusted = agree_on_root(c, SIGNED_ROOT, ROOT.kid)
        assert isinstance(trusted, TrustRoot)
        vehicle = random.choice(("quad-07",) * 9 + ("quad-08",))
        now_us = NOW + random.choice((0, 0, 0, bundle_case.HOUR, 1 << 40))
        found[f"{agree_on_bundle(c, some_bundle(random), trusted, vehicle, now_us)}"] += 1
    return found


def test_bundle_opened_by_python_is_opened_by_c(c: Boundary) -> None:
    signed, pin, data, vehicle, now_us = rich()
    trust = agree_on_root(c, signed, pin, now_us)
    assert isinstance(trust, TrustRoot)
    assert agree_on_bundle(c, data, trust, vehicle, now_us) is None
    assert isinstance(agree_on_root(c, signed, None, now_us), TrustRoot)
    assert isinstance(agree_on_root(c, MANY.sign(ROOT), ROOT.kid), TrustRoot)


def test_bundle_with_flipped_bit_is_refused_by_both(c: Boundary) -> None:
    random, data = Random(6), bundle_case.sealed()
    trust = agree_on_root(c, SIGNED_ROOT, ROOT.public)
    assert isinstance(trust, TrustRoot)
    for bit in random.sample(range(8 * len(data)), 300):
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        assert agree_on_bundle(c, bytes(flipped), trust) is not None
    for end in random.sample(range(len(data)), 60):
        assert agree_on_bundle(c, data[:end], trust) == "malformed"


def test_roots_have_the_same_limits(c: Boundary) -> None:
    def signed(keys: int = 3, revoked: int = 1) -> bytes:
        made = [SigningKey.from_seed(n.to_bytes(32), duty=Duty.LOG).verification() for n in range(keys - 3)]
        revocations = tuple(n.to_bytes(8) for n in range(revoked))
        trust = TrustRoot(1, False, NOW - 1, NOW + 1, (*root().keys, *made), revoked=revocations)
        return cose.sign1(trust.encode(), key=ROOT, duty=Duty.ROOT, content_type=names.ROOT.content_type)

    for at_most in (signed(MAX_KEYS), signed(revoked=MAX_REVOKED)):
        assert isinstance(agree_on_root(c, at_most, ROOT.public), TrustRoot)
    for too_many in (signed(MAX_KEYS + 1), signed(revoked=MAX_REVOKED + 1), bytes(MAX_ROOT + 2)):
        assert agree_on_root(c, too_many, ROOT.public) == "malformed"


def test_item_and_header_limits_are_the_same(c: Boundary) -> None:
    """Below these limits another check applies: the same items in an invalid form are malformed for another reason."""
    trust = agree_on_root(c, SIGNED_ROOT, ROOT.public)
    assert isinstance(trust, TrustRoot)
    for count in (names.FEW - 4, names.FEW - 3, 8 << 20):
        listed = (
            cbor.encode((names.BUNDLE.name, names.BUNDLE.version))[1:] + b"\x9a" + count.to_bytes(4) + b"\x80" * count
        )
        assert agree_on_bundle(c, b"\x83" + listed, trust) == "malformed"
    for name, version, slug in (("rtshcua/other", 1, "unknown-format"), (names.BUNDLE.name, 9, "unknown-version")):
        assert agree_on_bundle(c, cbor.encode((name, version, 1))[:-1] + b"\xff", trust) == slug
    for roles in (names.MANY - 200, names.MANY):
        key = SigningKey.from_seed(bytes([9]) * 32, duty=Duty.MISSION).verification(roles=("r",) * roles)
        large = TrustRoot(1, False, NOW - 1, NOW + 1, (*root().keys, key))
        signed = cose.sign1(large.encode(), key=ROOT, duty=Duty.ROOT, content_type=names.ROOT.content_type)
        found = agree_on_root(c, signed, ROOT.public)
        assert found == "malformed" if roles == names.MANY else isinstance(found, TrustRoot)
    for size in (cose.MAX_PROTECTED, cose.MAX_PROTECTED + 1):
        content_type = "x" * (size - 24)
        signed = cose.sign1(b"", key=ROOT, duty=Duty.ROOT, content_type=content_type)
        expected = "wrong-content-type" if size == cose.MAX_PROTECTED else "malformed"
        assert agree_on_root(c, signed, ROOT.kid + bytes(16)) == expected


def test_mutants_are_refused_alike(c: Boundary) -> None:
    found = compare(c, 7, 1_000)
    expected = {"None", "malformed", "wrong-policy", "binding-mismatch", "id-mismatch", "unknown-key", "wrong-duty",
                "bad-signature", "wrong-vehicle", "key-expired"}  # fmt: skip
    assert expected <= found.keys()
    assert {"root accepted", "root malformed", "root unknown-key", "root shared-key"} <= found.keys()
    assert 70 < found["None"] < 550


@pytest.mark.soak
def test_a_hundred_thousand_mutants_are_refused_alike(c: Boundary) -> None:
    assert compare(c, 8, 100_000).total() >= 100_000
