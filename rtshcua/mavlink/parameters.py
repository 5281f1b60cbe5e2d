"""The encoding of an autopilot's parameter in PARAM_SET and PARAM_VALUE, and its text.

Both messages contain a 32-bit float. PX4 stores the octets of an integer there, ArduPilot its number
(https://mavlink.io/en/services/parameter.html, "Parameter encoding").
"""

from math import isfinite
from struct import error as struct_error
from struct import pack, unpack
from typing import Final

from rtshcua.mavlink.modes import PX4

#: octets of a parameter's name
NAME_OCTETS: Final = 16

#: MAV_PARAM_TYPE of integers, and their format in place of a float
_INTEGERS: Final = {1: "<Bxxx", 2: "<bxxx", 3: "<Hxx", 4: "<hxx", 5: "<I", 6: "<i"}


def is_bytewise(autopilot: int) -> bool:
    """Whether this MAV_AUTOPILOT sends integers as their bytes."""
    return autopilot == PX4


def decode(raw: float, kind: int, *, bytewise: bool) -> float:
    """The value in a message, by its MAV_PARAM_TYPE."""
    shape = _INTEGERS.get(kind) if bytewise else None
    return float(raw) if shape is None else float(unpack(shape, pack("<f", raw))[0])


def fits(value: float, kind: int) -> bool:
    """Whether a parameter of this MAV_PARAM_TYPE can represent the value exactly."""
    shape = _INTEGERS.get(kind)
    if shape is None:
        return True
    if not float(value).is_integer():
        return False
    try:
        pack(shape, int(value))
    except struct_error:
        return False
    return True


def encode(value: float, kind: int, *, bytewise: bool) -> float | None:
    """The encoded value; None if it does not fit."""
    shape = _INTEGERS.get(kind) if bytewise else None
    if shape is None:
        return value
    return float(unpack("<f", pack(shape, int(value)))[0]) if fits(value, kind) else None


def bits_of(value: float) -> int | None:
    """A value as the 32 bits of the nearest float; None for a value that is not a number or too large."""
    if not isfinite(value):
        return None
    try:
        (bits,) = unpack("<I", pack("<f", value + 0.0))  # -0 is 0
    except OverflowError:
        return None
    return int(bits)


def value_of(bits: int) -> float:
    """The value of 32 bits as a float."""
    return float(unpack("<f", pack("<I", bits))[0])


#: the bits of the float that is not a number, as everybody writes it
NAN: Final = 0x7FC00000


def nearest_bits(numerator: int, denominator: int) -> int:
    """The bits of the 32-bit float nearest to a fraction, ties to even: exactly, without computing with floats.

    The magnitude of the numerator is at most 2**53, the denominator from 1 to 2**30.
    """
    mantissa, rest = divmod(abs(numerator), denominator)
    if not mantissa and not rest:
        return 0
    exponent = 150
    while mantissa < 1 << 23:
        mantissa, rest = 2 * mantissa + (2 * rest >= denominator), 2 * rest % denominator
        exponent -= 1
    cut = max(mantissa.bit_length() - 24, 0)
    half, low = denominator << cut, 2 * ((mantissa & (1 << cut) - 1) * denominator + rest)
    mantissa >>= cut
    mantissa += low > half or (low == half and mantissa & 1)
    exponent += cut
    if mantissa == 1 << 24:
        mantissa, exponent = mantissa >> 1, exponent + 1
    return (numerator < 0) << 31 | exponent << 23 | mantissa & 0x7FFFFF


def shown(bits: int) -> str:
    """The value of 32 bits as a float in the fewest digits that identify it: 0.1, and not 0.100000001."""
    value = value_of(bits)
    for digits in range(6, 9):
        text = f"{value:.{digits}g}"
        if bits_of(float(text)) == bits:
            return text
    return f"{value:.9g}"
