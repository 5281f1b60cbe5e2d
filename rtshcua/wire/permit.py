"""Permits: what `enforce` hands out and the executor checks before anything is sent (design section 4.5).

A permit is `_BODY` packed big-endian, then an HMAC-SHA256 (RFC 2104) over it under a session key. It names one command
of the loaded bundle by kind, step and link, and never carries the command itself, so there is nothing in it to alter.
A step's permit is the standing permit for the links behind it too, so that one MAC covers all that an `allow` grants.
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

#: How long a permit for a link that was just decided may be used, in us.
LINK_VALID_US = 1_000_000
#: How often a standing permit lets the last link of the contingency be sent again, each under a serial of its own:
#: landing twice harms nothing, and nothing else is left to a vehicle whose boundary does not answer any more.
AGAIN = 16
#: Why nothing is sent by a permit that was given up, of which nothing was sent: its step may be decided again.
WITHDRAWN = "permit/unsent"


class Permit(msgspec.Struct, frozen=True):
    """One permission to dispatch one command once, and for a step also each link that may have to follow it.

    `kind`, `step` and `link` are those of the request, but for a degrade rule's target `link` is `-1 - rule`. `serial`
    is the command's token and never reused in a session. The next `fallbacks` serials stand for the links of the step's
    chain until its skill ends, the `contingencies` after them for the links of the contingency until landing, and
    `AGAIN` more for its last; a permit for a link has none. `not_after_us` (monotonic) bounds the command itself, not
    what stands behind it.
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
    """Remembered, for a permit is opened right after it was sealed."""
    inner, outer = _begun(key)
    inner, outer = inner.copy(), outer.copy()
    inner.update(body)
    outer.update(inner.digest())
    mac: bytes = outer.digest()
    return mac


@lru_cache(maxsize=4)
def _begun(key: bytes) -> tuple[Any, Any]:
    """The two hashes of the MAC, as far as they are the same for all permits: that takes longer than the rest."""
    inner, outer = hmac_halves(key)
    inner.update(_DOMAIN)
    return inner, outer
