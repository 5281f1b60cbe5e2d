"""Deterministic CBOR (RFC 8949, section 4.2.1): one value, one encoding.

Values are 64-bit integers, byte and text strings, booleans, null, arrays, and maps with text or integer keys; there are
no floats, tags, indefinite lengths or other simple values. Map keys are in the bytewise order of their encodings (the
canonical mode of cbor2 sorts by length first, the older rule of RFC 7049, and its encoder is slower than this one).
The encoder is here, the decoder in `cbor_strict`.
"""

from collections.abc import Mapping, Sequence
from struct import Struct
from typing import Final, cast

from rtshcua.wire.cbor_strict import LIMIT, MAX_DEPTH, CborError, Value, decode

__all__ = ["LIMIT", "MAX_DEPTH", "CborError", "Value", "decode", "encode"]

_WITH_2 = Struct(">BH").pack
_WITH_4 = Struct(">BI").pack
_WITH_8 = Struct(">BQ").pack


def encode(value: object) -> bytes:
    """The canonical bytes of `value`; lists and tuples are the same array. Raises `CborError` for what has none.

    Types are taken exactly: an `IntEnum` or a `bytearray` is refused, so that equal bytes mean equal values.
    """
    return _item(value, 0)


def _head(major: int, argument: int) -> bytes:
    """The shortest head (RFC 8949, section 3): three bits of major type, then the argument."""
    initial = major << 5
    if argument < 24:
        return bytes((initial | argument,))
    if argument < 1 << 8:
        return bytes((initial | 24, argument))
    if argument < 1 << 16:
        return _WITH_2(initial | 25, argument)
    if argument < 1 << 32:
        return _WITH_4(initial | 26, argument)
    return _WITH_8(initial | 27, argument)


_SMALL: Final = {n: _head(0, n) for n in range(256)} | {~n: _head(1, n) for n in range(256)}


def _item(value: object, depth: int) -> bytes:
    match value:
        case None:
            return b"\xf6"
        case True:
            return b"\xf5"
        case False:
            return b"\xf4"
    kind = type(value)
    if kind is int:
        return _integer(cast("int", value))
    if kind is bytes:
        return _head(2, len(cast("bytes", value))) + cast("bytes", value)
    if kind is str:
        text = _utf8(cast("str", value))
        return _head(3, len(text)) + text
    if kind is tuple or kind is list:
        return _array(cast("Sequence[object]", value), depth + 1)
    if kind is dict:
        return _map(cast("Mapping[object, object]", value), depth + 1)
    raise CborError(f"`{kind.__name__}` has no encoding")


def _integer(n: int) -> bytes:
    if not -(1 << 63) <= n < 1 << 63:
        raise CborError("integer outside 64 bits")
    return _head(0, n) if n >= 0 else _head(1, ~n)


def _array(items: Sequence[object], depth: int) -> bytes:
    _check_depth(depth)
    parts = [_head(4, len(items))]
    add = parts.append
    for item in items:
        # Lowered code is mostly integers: the common widths are written with one call at most.
        if type(item) is not int:
            add(_item(item, depth))
        elif -257 < item < 256:
            add(_SMALL[item])
        elif 65535 < item < 4294967296:
            add(_WITH_4(0x1A, item))
        elif 255 < item < 65536:
            add(_WITH_2(0x19, item))
        else:
            add(_integer(item))
    return b"".join(parts)


def _map(pairs: Mapping[object, object], depth: int) -> bytes:
    _check_depth(depth)
    # No two keys encode alike, so the order never comes down to the values.
    encoded = sorted((_key(key), _item(value, depth)) for key, value in pairs.items())
    return _head(5, len(encoded)) + b"".join([part for pair in encoded for part in pair])


def _key(key: object) -> bytes:
    if type(key) is not str and type(key) is not int:
        raise CborError("map key is neither text nor an integer")
    return _item(key, 0)


def _check_depth(depth: int) -> None:
    if depth > MAX_DEPTH:
        raise CborError(f"nested deeper than {MAX_DEPTH}")


def _utf8(text: str) -> bytes:
    try:
        return text.encode()
    except UnicodeEncodeError:
        raise CborError("text is not Unicode scalar values") from None
