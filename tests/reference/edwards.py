"""Ed25519 by its definition (RFC 8032, section 5.1), slow and simple: points, signatures, verification."""

import hashlib

P = 2**255 - 19
L = 2**252 + 27742317777372353535851937790883648493
D = -121665 * pow(121666, -1, P) % P
ROOT = pow(2, (P - 1) // 4, P)  # of -1
Point = tuple[int, int]
NEUTRAL: Point = (0, 1)


def add(a: Point, b: Point) -> Point:
    """Return the sum of two points (RFC 8032, section 5.1.4, in affine coordinates)."""
    k = D * a[0] * b[0] * a[1] * b[1]
    return (
        (a[0] * b[1] + b[0] * a[1]) * pow(1 + k, -1, P) % P,
        (a[1] * b[1] + a[0] * b[0]) * pow(1 - k, -1, P) % P,
    )


def negative(point: Point) -> Point:
    """Return the inverse of a point."""
    return -point[0] % P, point[1]


def times(n: int, point: Point) -> Point:
    """Return a multiple of a point, by that sum with a common denominator Z (section 5.1.4: X, Y, Z, T = XY / Z)."""
    x, y = point
    total, doubled = (0, 1, 1, 0), (x, y, 1, x * y % P)
    while n:
        if n & 1:
            total = _sum(total, doubled)
        doubled = _sum(doubled, doubled)
        n >>= 1
    inverse = pow(total[2], -1, P)
    return total[0] * inverse % P, total[1] * inverse % P


_Extended = tuple[int, int, int, int]


def _sum(a: _Extended, b: _Extended) -> _Extended:
    less, more = (a[1] - a[0]) * (b[1] - b[0]) % P, (a[1] + a[0]) * (b[1] + b[0]) % P
    product, z = 2 * D * a[3] * b[3] % P, 2 * a[2] * b[2] % P
    e, f, g, h = more - less, z - product, z + product, more + less
    return e * f % P, g * h % P, f * g % P, e * h % P


def point_of(y: int, odd: int) -> Point | None:
    """The point with that y and with x odd or even (section 5.1.3)."""
    square = (y * y - 1) * pow(D * y * y + 1, -1, P) % P
    x = pow(square, (P + 3) // 8, P)
    if x * x % P != square:
        x = x * ROOT % P
    if x * x % P != square:
        return None
    return (x if x % 2 == odd else -x % P), y


def encoded(point: Point) -> bytes:
    """Encode a point in 32 octets (section 5.1.2)."""
    return (point[1] | (point[0] & 1) << 255).to_bytes(32, "little")


def decoded(octets: bytes) -> Point | None:
    """Decode 32 octets; None if they are not a point or not its canonical encoding (section 5.1.3)."""
    number = int.from_bytes(octets, "little")
    y, odd = number & ((1 << 255) - 1), number >> 255
    point = point_of(y, odd) if y < P else None
    return point if point is not None and encoded(point) == octets else None


def _base() -> Point:
    found = point_of(4 * pow(5, -1, P) % P, 0)
    assert found is not None
    return found


BASE = _base()


def torsion() -> list[Point]:
    """The eight points of small order, the multiples of one of order 8."""
    point = next(times(L, found) for y in range(2, 99) if (found := point_of(y, 0)) and times(4 * L, found) != NEUTRAL)
    return [times(n, point) for n in range(8)]


def challenge(r: bytes, key: bytes, message: bytes) -> int:
    """k of section 5.1.7."""
    return int.from_bytes(hashlib.sha512(r + key + message).digest(), "little") % L


def equation_holds(key: bytes, signature: bytes, message: bytes) -> bool:
    """Whether [s]B = R + [k]A, without the cofactor, whatever the points are and however large s is."""
    a, r, s = decoded(key), decoded(signature[:32]), int.from_bytes(signature[32:], "little")
    if a is None or r is None:
        return False
    return times(s, BASE) == add(r, times(challenge(signature[:32], key, message), a))


def counts(key: bytes, signature: bytes, message: bytes) -> bool:
    """Whether a signature is valid by the rule of docs/log-format.md, section 6, taken literally."""
    if len(key) != 32 or len(signature) != 64:
        return False
    a, r, s = decoded(key), decoded(signature[:32]), int.from_bytes(signature[32:], "little")
    if a is None or r is None or s >= L:
        return False
    if NEUTRAL in (times(8, a), times(8, r)):
        return False
    return times(s, BASE) == add(r, times(challenge(signature[:32], key, message), a))
