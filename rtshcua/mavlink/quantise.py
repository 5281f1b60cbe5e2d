"""Telemetry becomes integers here, once, where frames arrive; no float goes further.

Canonical units: length mm, speed mm/s, duration us, angle (latitude and longitude too) 1e-7 degree, ratio 1/10000,
count 1, voltage mV, acceleration mm/s^2, temperature 1/100 degree Celsius.
"""

from collections.abc import Container, Mapping
from dataclasses import dataclass
from math import isfinite, isqrt
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit of the dialect: the dimension it measures, and the canonical units in one of it, as a fraction."""

    dimension: str
    numerator: int
    denominator: int


UNITS: Mapping[str, Unit] = MappingProxyType(
    {
        "": Unit("count", 1, 1),
        "mm": Unit("length", 1, 1),
        "cm": Unit("length", 10, 1),
        "dm": Unit("length", 100, 1),
        "m": Unit("length", 1000, 1),
        "dam": Unit("length", 10_000, 1),
        "mm/s": Unit("speed", 1, 1),
        "cm/s": Unit("speed", 10, 1),
        "dm/s": Unit("speed", 100, 1),
        "m/s": Unit("speed", 1000, 1),
        "m/s*5": Unit("speed", 200, 1),  # HIGH_LATENCY2: the value is five times the speed in m/s
        "ns": Unit("duration", 1, 1000),
        "us": Unit("duration", 1, 1),
        "ms": Unit("duration", 1000, 1),
        "cs": Unit("duration", 10_000, 1),
        "ds": Unit("duration", 100_000, 1),
        "s": Unit("duration", 1_000_000, 1),
        "degE7": Unit("angle", 1, 1),
        "degE5": Unit("angle", 100, 1),
        "cdeg": Unit("angle", 100_000, 1),
        "deg": Unit("angle", 10_000_000, 1),
        "deg/2": Unit("angle", 20_000_000, 1),  # HIGH_LATENCY2: the value is half the angle in degrees
        # 180/pi to 15 digits: off by less than one part in 10^15, far below one canonical unit in a whole turn.
        "rad": Unit("angle", 572_957_795_130_823, 1_000_000),
        "%": Unit("ratio", 100, 1),
        "d%": Unit("ratio", 10, 1),
        "c%": Unit("ratio", 1, 1),
        "mV": Unit("voltage", 1, 1),
        "cV": Unit("voltage", 10, 1),
        "V": Unit("voltage", 1000, 1),
        "mG": Unit("acceleration", 980_665, 100_000),  # standard gravity
        "m/s/s": Unit("acceleration", 1000, 1),
        "cdegC": Unit("temperature", 1, 1),
        "degC": Unit("temperature", 100, 1),
    }
)
"""The units of the dialect that a signal may have, by their spelling in the XML. What is not here measures nothing
that the language has a dimension for (`mAh`, `rpm`, `rad/s`, ...)."""


def quantise(raw: int | float, numerator: int, denominator: int, unknown: Container[int] = ()) -> int | None:
    """`raw * numerator / denominator`, rounded to the nearest integer, halves away from zero.

    `denominator` is positive. A float is taken for exactly the fraction it stands for, so the result is the same on
    every machine. None, meaning unknown, for NaN, for an infinity and for a value in `unknown` (the message's own
    marks: battery -1, voltage 65535).
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
