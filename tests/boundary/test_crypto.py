"""Both implementations agree on hashes and MACs, and on the validity of Ed25519 keys and signatures."""

import ctypes
import hashlib
import hmac
from random import Random

import pytest
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

from reference.edwards import BASE, L, P, add, challenge, encoded, times, torsion
from rtshcua.wire.keys import is_strong, verified

# RFC 8032, section 7.1: seed, key, message, signature
RFC_8032 = (
    (
        "9d61b19deffd5a60ba844af492ec2cc44449c5697b326919703bac031cae7f60",
        "d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a",
        "",
        "e5564300c360ac729086e2cc806e828a84877f1eb8e5d974d873e065224901555fb8821590a33bacc61e39701cf9b46bd25bf5f0595bbe24655141438e7a100b",
    ),
    (
        "4ccd089b28ff96da9db6c346ec114e0f5b8a319f35aba624da8cf6ed4fb8a6fb",
        "3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c",
        "72",
        "92a009a9f0d4cab8720e820b5f642540a2b27b5416503f8fb3762223ebdb69da085ac1e43e15996e458f3613d0f11d8c387b2eaeb4302aeeb00d291612bb0c00",
    ),
    (
        "c5aa8df43f9f837bedb7442f31dcb7b166d38535076f094b85ce3a2e0b4458f7",
        "fc51cd8e6218a1a38da47ed00230f0580816ed13ba3303ac5deb911548908025",
        "af82",
        "6291d657deec24024827e69c3abe01a30ce548a284743a445e3680d7db5ac3ac18ff9b538d16f290ae67f760984dc6594a7c15e9716ed28dc027beceea1ec40a",
    ),
)


TORSION = torsion()


def agreed(boundary: ctypes.CDLL, key: bytes, signature: bytes, message: bytes) -> bool:
    """The common verdict on a signature."""
    here = verified(key, signature, message)
    assert bool(boundary.rt_test_verify(key, signature, message, len(message)) & 1) is here
    return here


def openssl(key: bytes, signature: bytes, message: bytes) -> bool:
    try:
        Ed25519PublicKey.from_public_bytes(key).verify(signature, message)
    except InvalidSignature:
        return False
    return True


@pytest.mark.parametrize("size", [0, 1, 31, 55, 56, 63, 64, 65, 127, 128, 1000])
def test_hashes_and_macs_are_those_of_python(boundary: ctypes.CDLL, size: int) -> None:
    data = Random(size).randbytes(size)
    out = ctypes.create_string_buffer(32)
    for step in (1, 7, 64, 4096):
        boundary.rt_test_sha256(data, size, step, out)
        assert out.raw == hashlib.sha256(data).digest()
    for key in (b"", b"k" * 32, b"k" * 64):
        boundary.rt_test_hmac(key, len(key), data, size, out)
        assert out.raw == hmac.digest(key, data, "sha256")


def test_byte_strings_are_compared_completely(boundary: ctypes.CDLL) -> None:
    assert boundary.rt_test_equal(bytes(32), bytes(32), 32) & 1
    for at in (0, 15, 31):
        other = bytearray(32)
        other[at] = 0x80
        assert not boundary.rt_test_equal(bytes(32), bytes(other), 32) & 1


@pytest.mark.parametrize(("seed", "key", "message", "signature"), RFC_8032)
def test_examples_of_rfc_8032(boundary: ctypes.CDLL, seed: str, key: str, message: str, signature: str) -> None:
    data, public, made = bytes.fromhex(message), ctypes.create_string_buffer(32), ctypes.create_string_buffer(64)
    boundary.rt_test_sign(bytes.fromhex(seed), data, len(data), public, made)
    assert (public.raw.hex(), made.raw.hex()) == (key, signature)
    assert agreed(boundary, public.raw, made.raw, data)


def test_altered_signature_is_refused(boundary: ctypes.CDLL) -> None:
    random = Random(1)
    for size in (0, 1, 100, 300):
        message, seed = random.randbytes(size), random.randbytes(32)
        private = Ed25519PrivateKey.from_private_bytes(seed)
        key, signature = private.public_key().public_bytes_raw(), private.sign(message)
        made, public = ctypes.create_string_buffer(64), ctypes.create_string_buffer(32)
        boundary.rt_test_sign(seed, message, size, public, made)
        assert (made.raw, public.raw) == (signature, key)
        assert agreed(boundary, key, signature, message)
        for bit in random.sample(range(512), 32):
            altered = bytearray(signature)
            altered[bit // 8] ^= 1 << bit % 8
            assert not agreed(boundary, key, bytes(altered), message)
        assert not agreed(boundary, key, signature, message + b"\0")
        # s + L satisfies the same equation, if it fits
        s = int.from_bytes(signature[32:], "little")
        for more in range(1, 16):
            if s + more * L < 1 << 256:
                assert not agreed(boundary, key, signature[:32] + (s + more * L).to_bytes(32, "little"), message)


def test_points_of_small_order_and_other_encodings_are_refused(boundary: ctypes.CDLL) -> None:
    """These satisfy the equation, and OpenSSL accepts some: anybody can make them."""
    taken_by_openssl = 0
    assert len(set(TORSION)) == 8
    for weak in TORSION:
        assert not is_strong(encoded(weak))
        assert not is_strong((weak[1] | 1 << 255).to_bytes(32, "little"))
        for base in (weak[1], weak[1] + P):
            for sign in (0, 1):
                if base >= 1 << 255:
                    continue
                key = (base | sign << 255).to_bytes(32, "little")
                for r in map(encoded, TORSION):
                    for n in range(4):
                        message = bytes([n])
                        taken_by_openssl += openssl(key, r + bytes(32), message)
                        assert not agreed(boundary, key, r + bytes(32), message)
    assert taken_by_openssl > 0
    for y in range(P, 1 << 255):
        for sign in (0, 1):
            assert not is_strong((y | sign << 255).to_bytes(32, "little"))


def test_verification_is_without_cofactor(boundary: ctypes.CDLL) -> None:
    """A key or an R with a part of small order is only valid if the equation holds without the cofactor."""
    random, outcomes = Random(2), set()
    for weak in TORSION[1:]:
        for case in range(4):
            a, r = random.randrange(1, L), random.randrange(1, L)
            mixed_key, mixed_r = case & 1, case >> 1
            key = encoded(add(times(a, BASE), weak) if mixed_key else times(a, BASE))
            first = encoded(add(times(r, BASE), weak) if mixed_r else times(r, BASE))
            for n in range(8):
                message = bytes([n])
                s = (r + challenge(first, key, message) * a) % L
                signature = first + s.to_bytes(32, "little")
                taken = agreed(boundary, key, signature, message)
                assert taken is openssl(key, signature, message)
                outcomes.add((case, taken))
    assert {(0, True), (1, True), (1, False), (2, False)} <= outcomes


def test_invalid_curve_point_verifies_nothing(boundary: ctypes.CDLL) -> None:
    random, signature = Random(3), bytes.fromhex(RFC_8032[0][3])
    for _ in range(64):
        assert not agreed(boundary, random.randbytes(32), signature, b"")
        assert not agreed(boundary, bytes.fromhex(RFC_8032[0][1]), random.randbytes(32) + signature[32:], b"")
