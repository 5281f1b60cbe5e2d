"""The preparation permit: the parameters of the vehicle that may be set on the ground, with their values.

Its body is `_HEAD`, then `_WRITE` for each parameter, packed big-endian, followed by an HMAC-SHA256 (RFC 2104)
over it under the session key. Values are the 32 bits of the parameter's float. A request for the permit is the
same body without a MAC.
"""

from hmac import compare_digest, digest
from struct import Struct
from typing import Final, NamedTuple

import msgspec

VERSION: Final = 1
_DOMAIN: Final = b"rtshcua/preparation\x00"
_HEAD: Final = Struct(">B?QqB")
_WRITE: Final = Struct(">16sII")
MAC_BYTES: Final = 32
#: how many parameters one permit may list
MOST: Final = 32


class ParameterWrite(NamedTuple):
    """One parameter: its name (ASCII, 16 octets at most), its present value and its new value."""

    name: str
    before: int
    value: int


class Preparation(msgspec.Struct, frozen=True):
    """Permission to set exactly these parameters, once, up to a monotonic time. `restoring` sets the previous values.

    `serial` is unique within a session; it is 0 in a request.
    """

    serial: int
    restoring: bool
    not_after_us: int
    writes: tuple[ParameterWrite, ...]


def encode(preparation: Preparation) -> bytes:
    """The body. Raises ValueError for more writes than the limit."""
    if len(preparation.writes) > MOST:
        raise ValueError(f"a preparation lists at most {MOST} parameters")
    writes = preparation.writes
    head = _HEAD.pack(VERSION, preparation.restoring, preparation.serial, preparation.not_after_us, len(writes))
    return head + b"".join(_WRITE.pack(each.name.encode("ascii"), each.before, each.value) for each in writes)


def decode(body: bytes) -> Preparation | None:
    """The preparation in a body; None for malformed octets. Raises nothing."""
    if len(body) < _HEAD.size:
        return None
    version, restoring, serial, not_after_us, count = _HEAD.unpack_from(body)
    if version != VERSION or count > MOST or len(body) != _HEAD.size + count * _WRITE.size:
        return None
    writes = []
    for octets, before, value in _WRITE.iter_unpack(body[_HEAD.size :]):
        name = octets.rstrip(b"\0")
        if not name.isascii() or b"\0" in name:
            return None
        writes.append(ParameterWrite(name.decode(), before, value))
    return Preparation(serial, restoring, not_after_us, tuple(writes))


def seal(preparation: Preparation, key: bytes) -> bytes:
    """The permit's bytes with their MAC."""
    body = encode(preparation)
    return body + digest(key, _DOMAIN + body, "sha256")


def open_preparation(data: bytes, key: bytes) -> Preparation | None:
    """The permit, or None for bytes that this key did not seal. The MAC is compared in constant time."""
    body, mac = data[:-MAC_BYTES], data[-MAC_BYTES:]
    return decode(body) if compare_digest(mac, digest(key, _DOMAIN + body, "sha256")) else None
