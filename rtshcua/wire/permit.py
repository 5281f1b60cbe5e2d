"""Permits: `enforce` issues them, and the executor checks them before anything is sent (design section 4.5).

A permit is `_BODY` packed big-endian, then an HMAC-SHA256 (RFC 2104) over it under a session key. It names one
command of the loaded bundle by kind, step and link, and does not contain the command itself. A step's permit is
also the standing permit for the links behind it, so that one MAC covers everything that an `allow` grants.
"""

from functools import lru_cache
from hmac import compare_digest
from struct import Struct
from typing import Any

import msgspec

from rtshcua.wire.digest import hmac_halves

VERSION = 1
_DOMAIN = b"rtshcua/permit\x00"
_BODY = Struct(">BBhhQBBq")
_MAC = 32
SIZE = _BODY.size + _MAC

#: The validity of a permit for a link that was just decided, in us.
LINK_VALID_US = 1_000_000
#: How often a standing permit allows the last link of the contingency to be repeated, each time under a serial of
#: its own: repeated landing commands are harmless, and a vehicle whose boundary no longer answers has no other
#: option.
AGAIN = 16
#: The reason when an unused permit is withdrawn: its step may be decided again.
WITHDRAWN = "permit/unsent"


class Permit(msgspec.Struct, frozen=True):
    """Permission to dispatch one command once, and for a step also each link that may have to follow it.

    `kind`, `step` and `link` are those of the request, but for a degrade rule's target `link` is `-1 - rule`.
    `serial` is the command's token and unique within a session. The next `fallbacks` serials stand for the links
    of the step's chain until its skill ends, the following `contingencies` for the links of the contingency until
    landing, and `AGAIN` more for its last link; a permit for a link has none of these. `not_after_us` (monotonic)
    limits the command itself, not the links behind it.
    """

    kind: int
    step: int
    link: int
    serial: int
    fallbacks: int
    contingencies: int
    not_after_us: int


def seal(permit: Permit, key: bytes) -> bytes:
    """The permit's bytes with their MAC."""
    body = _BODY.pack(
        VERSION,
        permit.kind,
        permit.step,
        permit.link,
        permit.serial,
        permit.fallbacks,
        permit.contingencies,
        permit.not_after_us,
    )
    return body + _mac(key, body)


def open_permit(data: bytes, key: bytes) -> Permit | None:
    """The permit, or None for bytes that this key did not seal. The MAC is compared in constant time."""
    if len(data) != SIZE:
        return None
    body = data[:-_MAC]
    if not compare_digest(data[-_MAC:], _mac(key, body)):
        return None
    _, *fields = _BODY.unpack(body)
    return Permit(*fields)


@lru_cache(maxsize=4)
def _mac(key: bytes, body: bytes) -> bytes:
    """The MAC, cached, because a permit is opened right after it was sealed."""
    inner, outer = _begun(key)
    inner, outer = inner.copy(), outer.copy()
    inner.update(body)
    outer.update(inner.digest())
    mac: bytes = outer.digest()
    return mac


@lru_cache(maxsize=4)
def _begun(key: bytes) -> tuple[Any, Any]:
    """The two hashes of the MAC before any message, cached because they take longer than the rest."""
    inner, outer = hmac_halves(key)
    inner.update(_DOMAIN)
    return inner, outer
