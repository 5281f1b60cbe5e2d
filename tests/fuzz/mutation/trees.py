"""Near-valid nested values of JSON and CBOR, with one changed leaf or branch."""

import json
from random import Random
from typing import Any

_LEAVES: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, 2, 7, 255, 2**31, 2**53, 2**63 - 1, -(2**63), "", "a", "any", "quad", "20 m", "lib:x",
    "\u202e", "\ud800", "\x00", "height - 1 m > 2 m", "1e400",
)  # fmt: skip
_FRACTIONS = (0.5, -0.0, 1e-9, 1e308, 8.5455, 47.3978, -180.0, 90.0)


def changed(value: Any, of: Random, leaves: tuple[Any, ...] = _LEAVES) -> Any:
    """A copy of a value with one change somewhere inside."""
    if isinstance(value, dict) and value and of.random() < 0.9:
        return _in_map(value, of, leaves)
    if isinstance(value, list | tuple) and value and of.random() < 0.93:
        return _in_list(list(value), of, leaves)
    return _leaf(value, of, leaves)


def _in_map(value: dict[Any, Any], of: Random, leaves: tuple[Any, ...]) -> dict[Any, Any]:
    key = of.choice(list(value))
    kind = of.randrange(12)
    if kind == 0:
        return {each: value[each] for each in value if each != key}
    if kind == 1:
        return {**value, of.choice([key + "x" if isinstance(key, str) else key, "name", "type"]): value[key]}
    return {**value, key: changed(value[key], of, leaves)}


def _in_list(items: list[Any], of: Random, leaves: tuple[Any, ...]) -> list[Any]:
    at, other = of.randrange(len(items)), of.randrange(len(items))
    match of.randrange(16):
        case 0:
            del items[at]
        case 1:
            items.insert(other, items[at])
        case 2:
            items[at], items[other] = items[other], items[at]
        case _:
            items[at] = changed(items[at], of, leaves)
    return items


def _leaf(value: Any, of: Random, leaves: tuple[Any, ...]) -> Any:
    if isinstance(value, bool) or of.random() < 0.2:
        return of.choice(leaves)
    match value:
        case int():
            return of.choice([value + 1, value - 1, -value, value * 2, value // 2, value ^ (1 << of.randrange(48))])
        case float():
            return of.choice([value + 1e-4, value - 1e-4, value + 1e-7, -value, value * 2, of.choice(_FRACTIONS)])
        case str() if value:
            at = of.randrange(len(value))
            return of.choice([value[:at], value + value[at], value[:at] + value[at + 1 :], value[::-1]])
        case bytes() if value:
            at = of.randrange(len(value))
            return value[:at] + bytes([value[at] ^ (1 << of.randrange(8))]) + value[at + 1 :]
    return of.choice(leaves)


def mutated_json(data: bytes, of: Random) -> bytes:
    """A JSON text after one to three changes; other text gets an extra byte."""
    try:
        value = json.loads(data)
    except (ValueError, RecursionError):
        return data + b" "
    for _ in range(of.choice([1, 1, 2, 3])):
        value = changed(value, of, (*_LEAVES, *_FRACTIONS))
    return json.dumps(value, indent=of.choice([None, 1]), ensure_ascii=of.random() < 0.5).encode(errors="replace")
