"""Mutated bytes: flipped bits, removed and inserted pieces, integers of other sizes, other values."""

from random import Random
from typing import Any

from rtshcua.wire import cbor
from rtshcua.wire.cbor import head

INTEGERS = (0, 1, -1, 23, 24, 255, 256, 1 << 16, 1 << 32, (1 << 63) - 1, -(1 << 63), 1 << 53)


def damaged(data: bytes, random: Random) -> bytes:
    """Some bytes are changed, added or removed."""
    out = bytearray(data)
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        at = random.randrange(len(out) + 1)
        match random.randrange(6):
            case 0 if at < len(out):
                out[at] ^= 1 << random.randrange(8)
            case 1 if at < len(out):
                out[at] = random.choice(
                    (0, 0x18, 0x1F, 0x7F, 0x80, 0xA0, 0xC0, 0xF4, 0xF6, 0xF9, 0xFF, random.randrange(256))
                )
            case 2:
                del out[at : at + random.randrange(1, 9)]
            case 3:
                out[at:at] = random.randbytes(random.randrange(1, 5))
            case 4:
                start = random.randrange(len(out) + 1)
                out[at:at] = out[start : start + random.randrange(1, 40)]
            case 5:
                out = bytearray(widened(bytes(out), random))
    return bytes(out)


def widened(data: bytes, random: Random) -> bytes:
    """One head is written longer than necessary, if a walk from the beginning finds one."""
    heads, at = [], 0
    try:
        while at < len(data) and len(heads) < 400:
            major, argument, end = head(data, at)
            heads.append((major, argument, at, end))
            at = end + (argument if major in (2, 3) and random.random() < 0.5 else 0)
    except ValueError:
        pass
    if not heads:
        return data
    major, argument, at, end = random.choice(heads)
    for info, size in ((24, 1), (25, 2), (26, 4), (27, 8)):
        if size >= end - at and argument < 1 << 8 * size:
            return data[:at] + bytes([major << 5 | info]) + argument.to_bytes(size) + data[end:]
    return data


def changed(value: Any, random: Random) -> Any:
    """A decoded value with one part changed, removed or duplicated."""
    if isinstance(value, tuple) and value and random.random() < 0.93:
        at = random.randrange(len(value))
        if random.random() < 0.06:
            return value[:at] + value[at + 1 :] if random.random() < 0.5 else (*value[:at], value[at], *value[at:])
        return (*value[:at], changed(value[at], random), *value[at + 1 :])
    if isinstance(value, dict) and value and random.random() < 0.93:
        key = random.choice(list(value))
        if random.random() < 0.05:
            return {name: each for name, each in value.items() if name != key}
        return value | {key: changed(value[key], random)}
    return other(value, random)


def other(value: Any, random: Random) -> Any:
    """Another value, often of the same type."""
    same: list[Any] = [None, True, b"", "", (), 0]
    match value:
        case bool() | None:
            pass
        case int():
            same += 4 * [value + 1, value - 1, random.choice(INTEGERS)]
        case bytes():
            same += 4 * [value + b"\0", value[:-1], random.randbytes(len(value))]
        case str():
            same += 4 * [value + "x", value[1:], "\u00e9", "*"]
        case tuple():
            same += 3 * [(*value, 0), value * 2, value[::-1]]
    return random.choice(same)


def in_range(value: Any) -> Any:
    """The value with its integers limited to 64 bits, as in our CBOR."""
    match value:
        case bool():
            return value
        case int():
            return max(-(1 << 63), min(value, (1 << 63) - 1))
        case tuple():
            return tuple(in_range(each) for each in value)
        case dict():
            return {key: in_range(each) for key, each in value.items()}
    return value


def altered(data: bytes, random: Random) -> bytes:
    """Canonical bytes of a value that differs in one or two places."""
    value = cbor.decode(data)
    for _ in range(random.choice((1, 1, 2))):
        value = changed(value, random)
    return cbor.encode(in_range(value))
