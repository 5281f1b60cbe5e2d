"""Copies of vehicles and flights: a common beginning is flown once, and each test continues from a copy."""

import copyreg
from collections.abc import Callable
from copy import deepcopy
from hashlib import sha256
from itertools import count
from struct import Struct
from types import MappingProxyType
from typing import Any, TypeVar
from unittest.mock import patch

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from rtshcua.onboard.ports import Readings

T = TypeVar("T")

_KEY = Ed25519PrivateKey.from_private_bytes(bytes(32))
#: Parts of a flight that Python cannot copy. A counter's position is only in its text.
_WAYS: dict[type, Callable[[Any], Any]] = {
    MappingProxyType: lambda made: (MappingProxyType, (dict(made),)),
    Struct: lambda made: (Struct, (made.format,)),
    count: lambda made: (count, (int(repr(made)[len("count(") : -1]),)),
    type(sha256()): lambda made: (made.copy, ()),
    Readings: lambda made: "kept as it is",  # hundreds of immutable objects need no copy
    type(_KEY): lambda key: (Ed25519PrivateKey.from_private_bytes, (key.private_bytes_raw(),)),
}


def copied(original: T) -> T:
    """Return an independent copy.

    Functions are not copied, so no copied object may hold a closure over the original.
    """
    with patch.dict(copyreg.dispatch_table, _WAYS):  # only here: keys must not be pickled elsewhere
        return deepcopy(original)
