"""The strict decoder: it accepts only the bytes that our encoder would have made (RFC 8949, section 4.2.1).

It is the only decoder, written to be read, and to say where and why bytes are refused. A second implementation must
agree with it in every refusal: reason and place.
"""

from typing import Final, TypeAlias

#: what a decoded item is; arrays come back as tuples
Value: TypeAlias = "bool | int | bytes | str | tuple[Value, ...] | dict[str | int, Value] | None"

#: how deep arrays and maps may nest
MAX_DEPTH: Final = 32

#: the most bytes that `decode` takes unless told otherwise
LIMIT: Final = 16 << 20

#: the least argument that needs 1, 2, 4 or 8 bytes after the initial byte
_LEAST: Final = (24, 1 << 8, 1 << 16, 1 << 32)
_INT64_MAX: Final = (1 << 63) - 1
#: the integers that are their own head: most of what a bundle holds
_SMALL: Final = {bytes([n]): n for n in range(24)} | {bytes([0x20 | n]): ~n for n in range(24)}
_SIMPLE: Final[dict[int, bool | None]] = {0xF4: False, 0xF5: True, 0xF6: None}


class CborError(ValueError):
    """Bytes that are not canonical, or a value that has no canonical bytes (then `offset` is None)."""

    def __init__(self, reason: str, offset: int | None = None) -> None:
        super().__init__(reason if offset is None else f"{reason} (byte {offset})")
        self.reason = reason
        self.offset = offset


def decode(data: bytes, *, limit: int = LIMIT) -> Value:
    """The value of `data`, provided that `encode(value) == data`; else raises `CborError`. Arrays become tuples."""
    if len(data) > limit:
        raise CborError(f"longer than the limit of {limit} bytes", limit)
    value, end = _item(data, 0, 0)
    if end != len(data):
        raise CborError("bytes left over after the item", end)
    return value


def head(data: bytes, at: int) -> tuple[int, int, int]:
    """Major type, argument, and where the head at `at` ends. Raises `CborError`."""
    if at >= len(data):
        raise CborError("ends where an item should begin", at)
    major, info = data[at] >> 5, data[at] & 0x1F
    if info < 24:
        return major, info, at + 1
    if info == 31:
        raise CborError("indefinite length", at)
    if info > 27:
        raise CborError("reserved initial byte", at)
    end = at + 1 + (1 << (info - 24))
    if end > len(data):
        raise CborError("ends within the head of an item", at)
    argument = int.from_bytes(data[at + 1 : end])
    if argument < _LEAST[info - 24]:
        raise CborError("not in the shortest form", at)
    return major, argument, end


def _item(data: bytes, at: int, depth: int) -> tuple[Value, int]:
    if data[at : at + 1] >= b"\xe0":
        return _simple(data, at), at + 1
    major, argument, end = head(data, at)
    match major:
        case 0 | 1:
            if argument > _INT64_MAX:
                raise CborError("integer outside 64 bits", at)
            return argument if major == 0 else ~argument, end
        case 2:
            return _string(data, at, end, argument), end + argument
        case 3:
            return _text(data, at, end, argument), end + argument
        case 4:
            return _array(data, at, end, argument, depth + 1)
        case 5:
            return _map(data, at, end, argument, depth + 1)
    raise CborError(f"tag {argument} is not part of the format", at)


def _simple(data: bytes, at: int) -> bool | None:
    initial = data[at]
    if initial in _SIMPLE:
        return _SIMPLE[initial]
    if 0xF9 <= initial <= 0xFB:
        raise CborError("floating-point number", at)
    raise CborError("simple value other than false, true and null", at)


def _string(data: bytes, at: int, start: int, length: int) -> bytes:
    if length > len(data) - start:
        raise CborError("string longer than the bytes that follow", at)
    return data[start : start + length]


def _text(data: bytes, at: int, start: int, length: int) -> str:
    try:
        return _string(data, at, start, length).decode()
    except UnicodeDecodeError as error:
        raise CborError("text is not UTF-8", start + error.start) from None


def _array(data: bytes, at: int, start: int, count: int, depth: int) -> tuple[tuple[Value, ...], int]:
    _room(data, at, start, count, depth)
    items: list[Value] = []
    for _ in range(count):
        value: Value = _SMALL.get(data[start : start + 1])
        if value is None:
            value, start = _item(data, start, depth)
        else:
            start += 1
        items.append(value)
    return tuple(items), start


def _map(data: bytes, at: int, start: int, count: int, depth: int) -> tuple[dict[str | int, Value], int]:
    _room(data, at, start, 2 * count, depth)
    pairs: dict[str | int, Value] = {}
    previous = b""
    for _ in range(count):
        key, end = _item(data, start, depth)
        if type(key) is not str and type(key) is not int:
            raise CborError("map key is neither text nor an integer", start)
        encoded = data[start:end]
        if encoded == previous:
            raise CborError("map key repeated", start)
        if encoded < previous:
            raise CborError("map keys out of order", start)
        previous = encoded
        pairs[key], start = _item(data, end, depth)
    return pairs, start


def _room(data: bytes, at: int, start: int, items: int, depth: int) -> None:
    """Refuse a container before anything is spent on it: nested too deep, or with more items than bytes."""
    if depth > MAX_DEPTH:
        raise CborError(f"nested deeper than {MAX_DEPTH}", at)
    if items > len(data) - start:
        raise CborError("more items than bytes that follow", at)
