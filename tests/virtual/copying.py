"""Copies of vehicles and flights under way: what many tests begin with is flown once, and each goes on from there."""

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
#: What a flight holds and Python does not copy by itself. Of a counter only its text tells where it is.
_WAYS: dict[type, Callable[[Any], Any]] = {
    MappingProxyType: lambda made: (MappingProxyType, (dict(made),)),
    Struct: lambda made: (Struct, (made.format,)),
    count: lambda made: (count, (int(repr(made)[len("count(") : -1]),)),
    type(sha256()): lambda made: (made.copy, ()),
    Readings: lambda made: "kept as it is",  # a flight remembers hundreds, and none changes: text copies nothing
    type(_KEY): lambda key: (Ed25519PrivateKey.from_private_bytes, (key.private_bytes_raw(),)),
}


def copied(original: T) -> T:
    """A copy that goes its own way.

    Functions are not copied: none of what is copied may be one that remembers the original.
    """
    with patch.dict(copyreg.dispatch_table, _WAYS):  # here alone: a key is not to be pickled anywhere else
        return deepcopy(original)
