"""Copies of vehicles and flights under way: what many tests begin with is flown once, and each goes on from there."""

import copyreg
from copy import deepcopy
from hashlib import sha256
from itertools import count
from struct import Struct
from typing import TypeVar

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

T = TypeVar("T")

# What a flight holds and Python does not copy by itself. Of a counter only its text tells where it is.
_KEY = Ed25519PrivateKey.from_private_bytes(bytes(32))
copyreg.pickle(Struct, lambda made: (Struct, (made.format,)))
copyreg.pickle(count, lambda made: (count, (int(repr(made)[len("count(") : -1]),)))
copyreg.pickle(type(sha256()), lambda made: (made.copy, ()))
copyreg.pickle(type(_KEY), lambda key: (Ed25519PrivateKey.from_private_bytes, (key.private_bytes_raw(),)))


def copied(original: T) -> T:
    """A copy that goes its own way.

    Functions are not copied: none of what is copied may be one that remembers the original.
    """
    return deepcopy(original)
