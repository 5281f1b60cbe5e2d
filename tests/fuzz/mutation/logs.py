"""Changes of an evidence log without a key: of bytes, lines and fields, with recomputed hashes."""

from collections.abc import Callable, Sequence
from random import Random

from fuzz.mutation.trees import mutated_json
from reference.forgery import read, rehashed, renumbered, rewritten, write

Lines = Sequence[bytes]
_ODD = (
    b"\n", b"\r\n", b"\x00", b" ", b'"', b"\\", b"{", b"}", b",", b"\xff", b"\xef\xbb\xbf", b"0", b"-", b"1e9", b"null",
    b"\\u0000",
)  # fmt: skip


def _place(data: bytes, of: Random) -> int:
    return of.randrange(len(data))


def _flipped(data: bytes, of: Random) -> bytes:
    at = _place(data, of)
    return data[:at] + bytes([data[at] ^ 1 << of.randrange(8)]) + data[at + 1 :]


def _overwritten(data: bytes, of: Random) -> bytes:
    at = _place(data, of)
    junk = of.randbytes(of.randrange(1, 9)) if of.random() < 0.5 else of.choice(_ODD)
    return data[:at] + junk + data[at + len(junk) :]


def _inserted(data: bytes, of: Random) -> bytes:
    at = _place(data, of)
    return data[:at] + (of.choice(_ODD) if of.random() < 0.7 else of.randbytes(4)) + data[at:]


def _taken_out(data: bytes, of: Random) -> bytes:
    at = _place(data, of)
    return data[:at] + data[at + of.choice((1, 2, 5, 64, 300)) :]


def _repeated(data: bytes, of: Random) -> bytes:
    at, length = _place(data, of), of.choice((1, 10, 64, 500))
    return data[: at + length] + data[at : at + length] + data[at + length :]


def _exchanged(data: bytes, of: Random) -> bytes:
    one, other = sorted((_place(data, of), _place(data, of)))
    length = min(of.choice((1, 8, 64)), other - one)
    first, second = data[one : one + length], data[other : other + length]
    return data[:one] + second + data[one + length : other] + first + data[other + length :]


def _swollen(data: bytes, of: Random) -> bytes:
    """Rarely insert a megabyte."""
    if of.random() < 0.98:
        return _flipped(data, of)
    at = _place(data, of)
    piece = of.choice((b"[", b'{"a":', b"\n", b"9", b"\\u0000", b"\x00", b'"', data[: at + 1]))
    return data[:at] + piece * ((1 << 20) // len(piece)) + data[at:]


OF_OCTETS: tuple[Callable[[bytes, Random], bytes], ...] = (
    _flipped, _flipped, _overwritten, _inserted, _taken_out, _repeated, _exchanged, _swollen,
)  # fmt: skip


def _of_lines(lines: Lines, others: Lines, of: Random) -> list[bytes]:
    """Delete, duplicate or move lines, or take them from another log."""
    changed = list(lines)
    at, to = of.randrange(len(changed)), of.randrange(len(changed))
    match of.randrange(6):
        case 0:
            del changed[at]
        case 1:
            changed.insert(to, changed[at])
        case 2:
            changed[at], changed[to] = changed[to], changed[at]
        case 3:
            changed.insert(to, changed.pop(at))
        case 4:
            changed[at] = of.choice(others)
        case _:
            changed.insert(at, of.choice(others))
    return changed


def _of_fields(lines: Lines, of: Random) -> list[bytes]:
    """Change a field, exchange it with another record's, or change the JSON of a line."""
    changed = list(lines)
    at = of.randrange(len(changed))
    fields = read(changed[at])
    name = of.choice(list(fields))
    value = fields[name]
    match of.randrange(4):
        case 0 if isinstance(value, int):
            fields[name] = value + of.choice((-1, 1, 1 << 20, -(1 << 53), 1 << 53))
        case 1:
            fields[name] = read(of.choice(list(lines))).get(name)
        case 2:
            del fields[name]
        case _:
            return [*changed[:at], mutated_json(changed[at], of), *changed[at + 1 :]]
    return [*changed[:at], write(fields), *changed[at + 1 :]]


def _followed_up(lines: list[bytes], of: Random) -> list[bytes]:
    """Recompute some of the values that an attacker can."""
    try:
        return of.choice((list, list, rehashed, renumbered, rewritten))(lines)
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError):
        return lines


def mutated(lines: Lines, others: Lines, of: Random) -> bytes:
    """Return the log with one to four changes."""
    draw = of.random()
    if draw < 0.55:
        data = b"".join(lines)
        for _ in range(of.choice((1, 1, 1, 2, 4))):
            data = of.choice(OF_OCTETS)(data, of) or b"\n"
        return data
    changed = _of_lines(lines, others, of) if draw < 0.8 else _of_fields(lines, of)
    return b"".join(_followed_up(changed, of))
