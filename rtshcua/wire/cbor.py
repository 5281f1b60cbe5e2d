"""Deterministic CBOR (RFC 8949, section 4.2.1): each value has exactly one encoding.

Values are 64-bit integers, byte and text strings, booleans, null, arrays, and maps with text or integer keys.
Floats, tags, indefinite lengths and other simple values are excluded. Map keys are in the bytewise order of their
encodings (the canonical mode of cbor2 sorts by length first, the older rule of RFC 7049, and its encoder is slower
than this one).

The decoder accepts only the bytes that the encoder produces. It reports the reason and the place of each refusal,
and a second implementation must report the same. It can limit the number of items: each array and map announces
its size, so an excess is refused before it is decoded.
"""

from collections.abc import Mapping, Sequence
from struct import Struct
from typing import Final, TypeAlias, cast

#: the type of a decoded item; arrays are decoded as tuples
Value: TypeAlias = "bool | int | bytes | str | tuple[Value, ...] | dict[str | int, Value] | None"

#: how deep arrays and maps may nest
MAX_DEPTH: Final = 32

#: the default limit of `decode`, in bytes
LIMIT: Final = 16 << 20


class CborError(ValueError):
    """Bytes that are not canonical, or a value that cannot be encoded (then `offset` is None)."""

    def __init__(self, reason: str, offset: int | None = None) -> None:
        super().__init__(reason if offset is None else f"{reason} (byte {offset})")
        self.reason = reason
        self.offset = offset


# ---------------------------------------------------------------- encoding

_WITH_2 = Struct(">BH").pack
_WITH_4 = Struct(">BI").pack
_WITH_8 = Struct(">BQ").pack


def encode(value: object) -> bytes:
    """The canonical bytes of `value`; lists and tuples encode as the same array. Raises `CborError` for any other
    type.

    Types are matched exactly: an `IntEnum` or a `bytearray` is refused, so that equal bytes mean equal values.
    """
    return _encoded(value, 0)


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


_SHORT: Final = {n: _head(0, n) for n in range(256)} | {~n: _head(1, n) for n in range(256)}


def _encoded(value: object, depth: int) -> bytes:
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
        return _encoded_array(cast("Sequence[object]", value), depth + 1)
    if kind is dict:
        return _encoded_map(cast("Mapping[object, object]", value), depth + 1)
    raise CborError(f"`{kind.__name__}` cannot be encoded")


def _integer(n: int) -> bytes:
    if not -(1 << 63) <= n < 1 << 63:
        raise CborError("integer does not fit in 64 bits")
    return _head(0, n) if n >= 0 else _head(1, ~n)


def _encoded_array(items: Sequence[object], depth: int) -> bytes:
    _check_depth(depth)
    parts = [_head(4, len(items))]
    add = parts.append
    for item in items:
        # Lowered code is mostly integers: the common widths need one call at most.
        if type(item) is not int:
            add(_encoded(item, depth))
        elif -257 < item < 256:
            add(_SHORT[item])
        elif 65535 < item < 4294967296:
            add(_WITH_4(0x1A, item))
        elif 255 < item < 65536:
            add(_WITH_2(0x19, item))
        else:
            add(_integer(item))
    return b"".join(parts)


def _encoded_map(pairs: Mapping[object, object], depth: int) -> bytes:
    _check_depth(depth)
    # No two keys have the same encoding, so the sort never compares values.
    encoded = sorted((_key(key), _encoded(value, depth)) for key, value in pairs.items())
    return _head(5, len(encoded)) + b"".join([part for pair in encoded for part in pair])


def _key(key: object) -> bytes:
    if type(key) is not str and type(key) is not int:
        raise CborError("map key is neither text nor an integer")
    return _encoded(key, 0)


def _check_depth(depth: int) -> None:
    if depth > MAX_DEPTH:
        raise CborError(f"nested deeper than {MAX_DEPTH}")


def _utf8(text: str) -> bytes:
    try:
        return text.encode()
    except UnicodeEncodeError:
        raise CborError("text contains lone surrogates") from None


# ---------------------------------------------------------------- decoding

#: the least argument that needs 1, 2, 4 or 8 bytes after the initial byte
_LEAST: Final = (24, 1 << 8, 1 << 16, 1 << 32)
_INT64_MAX: Final = (1 << 63) - 1
#: the integers that are encoded in the head itself, which are most of a bundle
_SMALL: Final = {bytes([n]): n for n in range(24)} | {bytes([0x20 | n]): ~n for n in range(24)}
_SIMPLE: Final[dict[int, bool | None]] = {0xF4: False, 0xF5: True, 0xF6: None}


class _Room:
    """The number of items that may still be announced, out of `most`."""

    __slots__ = ("left", "most")

    def __init__(self, most: int) -> None:
        self.most = most
        self.left = most - 1  # the outermost item is not announced


def decode(data: bytes, *, limit: int = LIMIT, items: int = LIMIT) -> Value:
    """The value of `data`, provided that `encode(value) == data`; else raises `CborError`. Arrays become tuples.

    The limits are `limit` bytes and `items` items. Every element of an array or a map counts as an item, as do map
    keys and the outermost item.
    """
    if len(data) > limit:
        raise CborError(f"longer than the limit of {limit} bytes", limit)
    value, end = _item(data, 0, 0, _Room(items))
    if end != len(data):
        raise CborError("unexpected bytes after the item", end)
    return value


def head(data: bytes, at: int) -> tuple[int, int, int]:
    """Major type, argument, and where the head at `at` ends. Raises `CborError`."""
    if at >= len(data):
        raise CborError("unexpected end before an item", at)
    major, info = data[at] >> 5, data[at] & 0x1F
    if info < 24:
        return major, info, at + 1
    if info == 31:
        raise CborError("indefinite length", at)
    if info > 27:
        raise CborError("reserved initial byte", at)
    end = at + 1 + (1 << (info - 24))
    if end > len(data):
        raise CborError("unexpected end in the head of an item", at)
    argument = int.from_bytes(data[at + 1 : end])
    if argument < _LEAST[info - 24]:
        raise CborError("not in the shortest form", at)
    return major, argument, end


def _item(data: bytes, at: int, depth: int, room: _Room) -> tuple[Value, int]:
    if data[at : at + 1] >= b"\xe0":
        return _simple(data, at), at + 1
    major, argument, end = head(data, at)
    match major:
        case 0 | 1:
            if argument > _INT64_MAX:
                raise CborError("integer does not fit in 64 bits", at)
            return argument if major == 0 else ~argument, end
        case 2:
            return _string(data, at, end, argument), end + argument
        case 3:
            return _text(data, at, end, argument), end + argument
        case 4:
            return _array(data, at, end, argument, depth + 1, room)
        case 5:
            return _map(data, at, end, argument, depth + 1, room)
    raise CborError(f"tag {argument} is not allowed", at)


def _simple(data: bytes, at: int) -> bool | None:
    initial = data[at]
    if initial in _SIMPLE:
        return _SIMPLE[initial]
    if 0xF9 <= initial <= 0xFB:
        raise CborError("floating-point numbers are not allowed", at)
    raise CborError("simple value other than false, true and null", at)


def _string(data: bytes, at: int, start: int, length: int) -> bytes:
    if length > len(data) - start:
        raise CborError("string is longer than the remaining bytes", at)
    return data[start : start + length]


def _text(data: bytes, at: int, start: int, length: int) -> str:
    try:
        return _string(data, at, start, length).decode()
    except UnicodeDecodeError as error:
        raise CborError("text is not UTF-8", start + error.start) from None


def _array(data: bytes, at: int, start: int, count: int, depth: int, room: _Room) -> tuple[tuple[Value, ...], int]:
    _take_room(data, at, start, count, depth, room)
    items: list[Value] = []
    for _ in range(count):
        value: Value = _SMALL.get(data[start : start + 1])
        if value is None:
            value, start = _item(data, start, depth, room)
        else:
            start += 1
        items.append(value)
    return tuple(items), start


def _map(data: bytes, at: int, start: int, count: int, depth: int, room: _Room) -> tuple[dict[str | int, Value], int]:
    _take_room(data, at, start, 2 * count, depth, room)
    pairs: dict[str | int, Value] = {}
    previous = b""
    for _ in range(count):
        key, end = _item(data, start, depth, room)
        if type(key) is not str and type(key) is not int:
            raise CborError("map key is neither text nor an integer", start)
        encoded = data[start:end]
        if encoded == previous:
            raise CborError("map key repeated", start)
        if encoded < previous:
            raise CborError("map keys out of order", start)
        previous = encoded
        pairs[key], start = _item(data, end, depth, room)
    return pairs, start


def _take_room(data: bytes, at: int, start: int, items: int, depth: int, room: _Room) -> None:
    """Refuse a container before any work on it: nested too deep, or with more items than bytes or `room`."""
    if depth > MAX_DEPTH:
        raise CborError(f"nested deeper than {MAX_DEPTH}", at)
    if items > len(data) - start:
        raise CborError("more items than remaining bytes", at)
    room.left -= items
    if room.left < 0:
        raise CborError(f"more than {room.most} items", at)
