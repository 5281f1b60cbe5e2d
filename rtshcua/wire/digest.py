"""SHA-256 with domain separation, so that digests of different kinds of data never coincide."""

from hashlib import sha256
from typing import Any, Final, NewType

#: the kind of data in a digest; a label contains no NUL, so that label and data cannot be confused
Domain = NewType("Domain", bytes)

POLICY: Final = Domain(b"rtshcua/policy")  # the payload of a policy envelope
MISSION: Final = Domain(b"rtshcua/mission")  # the payload of a mission envelope
BUNDLE: Final = Domain(b"rtshcua/bundle")  # a whole bundle
BINDING: Final = Domain(b"rtshcua/binding")  # paper symbol `B`: an invocation and all that it depends on
ROOT: Final = Domain(b"rtshcua/root")  # the payload of a trust root
KEY: Final = Domain(b"rtshcua/key")  # a duty and a public key
PARAMETERS: Final = Domain(b"rtshcua/parameters")  # names of a vehicle's parameters, and their values

#: length of a digest in bytes
DIGEST_BYTES: Final = 32

_BLOCK: Final = 64  # of SHA-256


def digest(domain: Domain, data: bytes) -> bytes:
    """SHA-256 over label, 0x00 and data: 32 bytes."""
    return sha256(domain + b"\0" + data).digest()


def hmac_halves(key: bytes) -> tuple[Any, Any]:
    """The inner and outer hash of HMAC-SHA256 (RFC 2104) under a key, before any message.

    Copying these takes half the time of `hmac.digest` where one key is used for many messages.
    """
    padded = (sha256(key).digest() if len(key) > _BLOCK else key).ljust(_BLOCK, b"\0")
    return sha256(bytes(octet ^ 0x36 for octet in padded)), sha256(bytes(octet ^ 0x5C for octet in padded))
