"""Test vectors for the validity of Ed25519 signatures (docs/log-format.md, section 6), in Wycheproof's form.

`python tests/reference/signature_vectors.py` writes tests/vectors/ed25519.json, always the same octets. Whether each
is valid is known from its construction, without any library.
"""

import hashlib
import json
import sys
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

if __package__ in (None, ""):
    sys.path.insert(0, str(Path(__file__).parents[1]))

from reference.edwards import (
    BASE,
    NEUTRAL,
    L,
    P,
    Point,
    add,
    challenge,
    decoded,
    encoded,
    negative,
    point_of,
    times,
    torsion,
)

FILE = Path(__file__).parents[1] / "vectors" / "ed25519.json"
TORSION = torsion()
#: the meaning of flags
NOTES = {
    "Valid": "made as RFC 8032 has it",
    "MixedOrder": "the key has a part of small order; the equation holds without the cofactor",
    "Cofactor": "the equation holds only after both sides were multiplied by the cofactor 8",
    "Malleability": "s is not below the order L",
    "SmallOrderKey": "the key is of small order: anybody signs for it",
    "SmallOrderR": "R is of small order; the equation may hold",
    "NonCanonical": "a point is not encoded as RFC 8032 encodes it",
    "NotAPoint": "the key is no point of the curve",
    "WrongLength": "a signature has 64 octets",
    "Altered": "one octet of a good signature, of its key or message is another",
    "OtherScheme": "a signature of Ed25519ph or Ed25519ctx",
}


class Vector(NamedTuple):
    """One case."""

    key: bytes
    comment: str
    message: bytes
    signature: bytes
    counts: bool
    flag: str


class Key(NamedTuple):
    """A secret scalar, and the octets of its public key, which may have a small-order component."""

    a: int
    public: bytes

    def signature(self, message: bytes, r: int, part: Point = NEUTRAL) -> bytes:
        """A signature with the nonce r; R also has this component."""
        first = encoded(add(times(r, BASE), part))
        s = (r + challenge(first, self.public, message) * self.a) % L
        return first + s.to_bytes(32, "little")


def key(random: Random, part: Point = NEUTRAL) -> Key:
    """A key with this small-order component."""
    a = random.randrange(1, L)
    return Key(a, encoded(add(times(a, BASE), part)))


def vectors() -> Iterator[Vector]:
    """All cases, grouped by key."""
    random = Random(8032)
    good = key(random)
    yield from _plain(random, good)
    yield from _altered(random, good)
    yield from _small_r(good)
    for n, weak in enumerate(TORSION[1:], 1):
        yield from _mixed(random, key(random, weak), weak, n)
    for n, weak in enumerate(TORSION):
        yield from _weak(random, weak, n)
    yield from _odd_encodings(random)


def _plain(random: Random, of: Key) -> Iterator[Vector]:
    for size in (0, 1, 31, 64, 127, 128, 1_000):
        message = random.randbytes(size)
        yield Vector(of.public, f"{size} octets", message, of.signature(message, random.randrange(1, L)), True, "Valid")


def _altered(random: Random, of: Key) -> Iterator[Vector]:
    message = b"come home"
    signature = of.signature(message, random.randrange(1, L))
    first, s = signature[:32], int.from_bytes(signature[32:], "little")
    for at in (0, 15, 31, 32, 47, 62):
        other = bytearray(signature)
        other[at] ^= 1
        yield Vector(of.public, f"octet {at} altered", message, bytes(other), False, "Altered")
    for text, other_message in (("longer", message + b"\0"), ("shorter", message[:-1]), ("none", b"")):
        yield Vector(of.public, f"the message is {text}", other_message, signature, False, "Altered")
    signed = bytearray(signature)
    signed[31] ^= 0x80
    yield Vector(of.public, "the sign of R", message, bytes(signed), False, "Altered")
    yield Vector(of.public, "its halves exchanged", message, signature[32:] + first, False, "Altered")
    yield Vector(of.public, "s big end first", message, first + signature[:31:-1], False, "Altered")
    yield Vector(of.public, "-s", message, first + (L - s).to_bytes(32, "little"), False, "Altered")
    for more in (1, 2, 7, 14):
        many = f"s + {more} L"
        yield Vector(of.public, many, message, first + (s + more * L).to_bytes(32, "little"), False, "Malleability")
    for text, value in (("L", L), ("2^255 - 1", 2**255 - 1), ("2^256 - 1", 2**256 - 1)):
        yield Vector(of.public, f"s = {text}", message, first + value.to_bytes(32, "little"), False, "Malleability")
    for length in (0, 1, 32, 63, 65, 96):
        cut = (signature + bytes(32))[:length]
        yield Vector(of.public, f"{length} octets", message, cut, False, "WrongLength")
    for text, head in (("ph", b"\1\0"), ("ctx", b"\0\5rtshc")):
        prefix = b"SigEd25519 no Ed25519 collisions" + head
        hashed = hashlib.sha512(message).digest() if text == "ph" else message
        r = random.randrange(1, L)
        nonce = encoded(times(r, BASE))
        k = int.from_bytes(hashlib.sha512(prefix + nonce + of.public + hashed).digest(), "little") % L
        other_scheme = nonce + ((r + k * of.a) % L).to_bytes(32, "little")
        yield Vector(of.public, f"Ed25519{text}", message, other_scheme, False, "OtherScheme")


def _small_r(of: Key) -> Iterator[Vector]:
    """R neutral: the holder of the key made this, and the equation holds. R of small order: only with the cofactor."""
    for n, weak in enumerate(TORSION):
        first = encoded(weak)
        s = challenge(first, of.public, b"R") * of.a % L
        text = f"R is {n} times a point of order 8" if n else "R is neutral; the equation holds"
        yield Vector(of.public, text, b"R", first + s.to_bytes(32, "little"), False, "SmallOrderR")
    s = challenge(encoded(NEUTRAL), of.public, b"R") * of.a % L
    for text, first in (("y + p", (P + 1).to_bytes(32, "little")), ("x = -0", (1 | 1 << 255).to_bytes(32, "little"))):
        yield Vector(of.public, f"R neutral as {text}", b"R", first + s.to_bytes(32, "little"), False, "NonCanonical")


def _mixed(random: Random, of: Key, weak: Point, n: int) -> Iterator[Vector]:
    """By how often k the part of small order is taken, the equation holds without the cofactor or only with it."""
    seen = set()
    for number in range(64):
        message = number.to_bytes(2)
        signature = of.signature(message, random.randrange(1, L))
        k = challenge(signature[:32], of.public, message)
        holds = times(k % 8, weak) == NEUTRAL
        if holds not in seen:
            seen.add(holds)
            text = f"the key has {n} times a point of order 8 besides"
            yield Vector(of.public, text, message, signature, holds, "MixedOrder" if holds else "Cofactor")
        # R takes away what the key adds: without the cofactor it holds again
        first = encoded(add(times(number + 1, BASE), weak))
        k = challenge(first, of.public, message)
        if weak == negative(times(k % 8, weak)) and "both" not in seen:
            seen.add("both")
            s = ((number + 1) + k * of.a) % L
            text = f"key and R have parts of small order ({n}) that add up to nothing"
            yield Vector(of.public, text, message, first + s.to_bytes(32, "little"), True, "MixedOrder")
    r = key(random)
    signature = r.signature(b"mixed", random.randrange(1, L), weak)
    yield Vector(r.public, f"R has {n} times a point of order 8 besides", b"mixed", signature, False, "Cofactor")


def _weak(random: Random, weak: Point, n: int) -> Iterator[Vector]:
    public = encoded(weak)
    for number in range(64):
        r = random.randrange(1, L)
        first, message = encoded(times(r, BASE)), number.to_bytes(2)
        if times(challenge(first, public, message) % 8, weak) == NEUTRAL:
            text = f"the key is {n} times a point of order 8; the equation holds"
            yield Vector(public, text, message, first + r.to_bytes(32, "little"), False, "SmallOrderKey")
            break
    yield Vector(public, f"all zero, the key {n} times a point of order 8", b"", bytes(64), False, "SmallOrderKey")
    yield Vector(public, "R is neutral, s 0", b"", encoded(NEUTRAL) + bytes(32), False, "SmallOrderKey")
    text, signature = f"{n} times a point of order 8", encoded(NEUTRAL) + bytes(32)
    for number in (weak[1] | (1 - (weak[0] & 1)) << 255, weak[1] + P):
        if number % (1 << 255) in (weak[1], weak[1] + P):
            odd = number.to_bytes(32, "little")
            flag = "SmallOrderKey" if decoded(odd) is not None else "NonCanonical"
            yield Vector(odd, f"another encoding: {text}", b"", signature, False, flag)


def _odd_encodings(random: Random) -> Iterator[Vector]:
    """Each of the 19 values of y that have two encodings, where they are points; and values that are no points."""
    signature = key(random).signature(b"", random.randrange(1, L))
    for y in range(19):
        for sign in (0, 1):
            if point_of(y, sign) is not None:
                public = (y + P | sign << 255).to_bytes(32, "little")
                yield Vector(public, f"the key is y = {y} + p", b"", signature, False, "NonCanonical")
    found = 0
    for y in range(2, 99):
        if point_of(y, 0) is None and found < 4:
            found += 1
            yield Vector(y.to_bytes(32, "little"), f"no point has y = {y}", b"", signature, False, "NotAPoint")


def made() -> bytes:
    """The file."""
    groups: list[dict[str, Any]] = []
    number = 0
    for public, cases in groupby(vectors(), key=lambda each: each.key):
        tests = []
        for each in cases:
            number += 1
            result = "valid" if each.counts else "invalid"
            tests.append({
                "tcId": number, "comment": each.comment, "flags": [each.flag], "msg": each.message.hex(),
                "sig": each.signature.hex(), "result": result,
            })  # fmt: skip
        groups.append({"publicKey": {"curve": "edwards25519", "pk": public.hex()}, "tests": tests})
    whole = {"algorithm": "EDDSA", "numberOfTests": number, "notes": NOTES, "testGroups": groups}
    return json.dumps(whole, indent=1).encode() + b"\n"


if __name__ == "__main__":
    FILE.write_bytes(made())
