"""Documents that take long to decode, verify or hash if that happens before their signature is checked."""

from rtshcua.wire import cose, names
from rtshcua.wire.document import MAX_DOCUMENT
from rtshcua.wire.keys import Duty, SigningKey

STRANGER = SigningKey.from_seed(bytes([77]) * 32, duty=Duty.MISSION, development=True)


def head(major: int, count: int) -> bytes:
    """A head of five octets (RFC 8949, section 3)."""
    return bytes([major << 5 | 26]) + count.to_bytes(4)


def enveloped(protected: bytes, payload: bytes) -> bytes:
    """An unsigned envelope."""
    return b"\xd2\x84" + _string(protected) + b"\xa0" + _string(payload) + _string(bytes(64))


def _string(octets: bytes) -> bytes:
    size = len(octets)
    if size < 256:
        return (bytes([0x40 | size]) if size < 24 else bytes([0x58, size])) + octets
    return (b"\x59" + size.to_bytes(2) if size < 1 << 16 else head(2, size)) + octets


def nonsense(key: SigningKey) -> bytes:
    """As many tiny items as fit, signed as a replacement."""
    count = MAX_DOCUMENT - 300
    payload = b"\x83\x73" + names.REPLACEMENT.name.encode() + b"\x02" + head(4, count) + b"\x80" * count
    return cose.sign1(payload, key=key, duty=Duty.MISSION, content_type=names.REPLACEMENT.content_type)


def hostile(key: SigningKey) -> dict[str, tuple[bytes, str]]:
    """Documents by name, with the slugs of their refusals. `key` is trusted for missions."""
    return {
        "a header of tiny items": (enveloped(head(4, 260_000) + b"\x80" * 260_000, b""), "malformed"),
        "a header of pairs": (enveloped(head(5, 60_000) + b"\x00\x80" * 60_000, b""), "malformed"),
        "tiny items by a mission key": (nonsense(key), "malformed"),
        "tiny items by a stranger": (nonsense(STRANGER), "unknown-key"),
        "by a key that did not sign it": (nonsense(key)[:-64] + bytes(64), "bad-signature"),
        "no envelope": (b"\xd2\x84" + b"\x80" * (MAX_DOCUMENT - 2), "malformed"),
    }
