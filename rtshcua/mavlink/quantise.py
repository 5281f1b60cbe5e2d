"""Converts telemetry to integers where frames arrive; no float goes further.

Canonical units: length mm, speed mm/s, duration us, angle (latitude and longitude too) 1e-7 degree, ratio 1/10000,
voltage mV, count 1.
"""

from collections.abc import Container, Mapping
from math import isfinite, isqrt
from types import MappingProxyType

from rtshcua.model.quantity import Dimension

#: by dimension: the units of the dialect that a signal may have, as spelled in the XML, with their size in
#: canonical units as numerator and denominator
UNITS: Mapping[Dimension, Mapping[str, tuple[int, int]]] = MappingProxyType(
    {
        Dimension.LENGTH: {"mm": (1, 1), "cm": (10, 1), "dm": (100, 1), "m": (1000, 1), "dam": (10_000, 1)},
        Dimension.SPEED: {
            "mm/s": (1, 1),
            "cm/s": (10, 1),
            "dm/s": (100, 1),
            "m/s": (1000, 1),
            "m/s*5": (200, 1),  # HIGH_LATENCY2: the value is five times the speed in m/s
        },
        Dimension.DURATION: {
            "ns": (1, 1000),
            "us": (1, 1),
            "ms": (1000, 1),
            "cs": (10_000, 1),
            "ds": (100_000, 1),
            "s": (1_000_000, 1),
        },
        Dimension.ANGLE: {
            "degE7": (1, 1),
            "degE5": (100, 1),
            "cdeg": (100_000, 1),
            "deg": (10_000_000, 1),
            "deg/2": (20_000_000, 1),  # HIGH_LATENCY2: the value is half the angle in degrees
            # 180/pi to 15 digits: off by less than one part in 10^15, far below one canonical unit in a whole turn.
            "rad": (572_957_795_130_823, 1_000_000),
        },
        Dimension.VOLTAGE: {"mV": (1, 1), "cV": (10, 1), "V": (1000, 1)},
        Dimension.RATIO: {"%": (100, 1), "d%": (10, 1), "c%": (1, 1)},
        Dimension.COUNT: {"": (1, 1)},
    }
)


def quantise(raw: int | float, numerator: int, denominator: int, unknown: Container[int] = ()) -> int | None:
    """`raw * numerator / denominator`, rounded to the nearest integer, halves away from zero.

    `denominator` is positive. A float counts as the exact fraction that it represents, so the result is the same
    on every machine. None, meaning unknown, for NaN, for an infinity and for a value in `unknown` (the message's
    own marks: battery -1, voltage 65535).
    """
    if raw in unknown:
        return None
    if isinstance(raw, float):
        if not isfinite(raw):
            return None
        raw, scale = raw.as_integer_ratio()
        denominator *= scale
    scaled = raw * numerator
    magnitude = (2 * abs(scaled) + denominator) // (2 * denominator)
    return magnitude if scaled >= 0 else -magnitude


def hypot_mm(a: int, b: int) -> int:
    """The length of the vector (a, b), in the unit of both, rounded down."""
    return isqrt(a * a + b * b)
