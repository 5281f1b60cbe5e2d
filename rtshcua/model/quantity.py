"""Dimensions, units and datum. Every quantity is an integer in the canonical unit of its dimension."""

from enum import Enum
from typing import NamedTuple


class Dimension(Enum):
    """The dimension of a number, with its canonical unit.

    An altitude is a length with a datum; the datum is part of the type (`Datum`), so two altitudes of different
    datum cannot be combined.
    """

    LENGTH = "length"  # mm
    ALTITUDE = "altitude"  # mm above its datum
    SPEED = "speed"  # mm/s
    DURATION = "duration"  # us
    ANGLE = "angle"  # 1e-7 degree
    RATIO = "ratio"  # 1/10000
    VOLTAGE = "voltage"  # mV
    COUNT = "count"  # 1


class Datum(Enum):
    """The reference of an altitude. `HOME` is the vehicle's home position, `SEA` mean sea level (AMSL)."""

    HOME = "home"
    SEA = "sea"


class UnitOfMeasure(NamedTuple):
    """`value * numerator / denominator` is the canonical integer; a literal without an integral result is refused."""

    dimension: Dimension
    numerator: int
    denominator: int = 1


#: Units in sources. `m` is a length; where an altitude is expected it means metres above home.
UNITS: dict[str, UnitOfMeasure] = {
    "mm": UnitOfMeasure(Dimension.LENGTH, 1),
    "cm": UnitOfMeasure(Dimension.LENGTH, 10),
    "m": UnitOfMeasure(Dimension.LENGTH, 1_000),
    "km": UnitOfMeasure(Dimension.LENGTH, 1_000_000),
    "mm/s": UnitOfMeasure(Dimension.SPEED, 1),
    "cm/s": UnitOfMeasure(Dimension.SPEED, 10),
    "m/s": UnitOfMeasure(Dimension.SPEED, 1_000),
    "km/h": UnitOfMeasure(Dimension.SPEED, 2_500, 9),
    "us": UnitOfMeasure(Dimension.DURATION, 1),
    "ms": UnitOfMeasure(Dimension.DURATION, 1_000),
    "s": UnitOfMeasure(Dimension.DURATION, 1_000_000),
    "min": UnitOfMeasure(Dimension.DURATION, 60_000_000),
    "h": UnitOfMeasure(Dimension.DURATION, 3_600_000_000),
    "%": UnitOfMeasure(Dimension.RATIO, 100),
    "deg": UnitOfMeasure(Dimension.ANGLE, 10_000_000),
    "mV": UnitOfMeasure(Dimension.VOLTAGE, 1),
    "V": UnitOfMeasure(Dimension.VOLTAGE, 1_000),
}

#: The units for display of each dimension, largest first.
DISPLAY: dict[Dimension, tuple[str, ...]] = {
    Dimension.LENGTH: ("m", "mm"),
    Dimension.ALTITUDE: ("m", "mm"),
    Dimension.SPEED: ("m/s", "mm/s"),
    Dimension.DURATION: ("min", "s", "ms", "us"),
    Dimension.ANGLE: ("deg",),
    Dimension.RATIO: ("%",),
    Dimension.VOLTAGE: ("V", "mV"),
}
#: the smallest value that is displayed in a unit with decimals, in tenths; else one whole unit
_LEAST_TENTHS: dict[str, int] = {"m": 1, "m/s": 1}


def display(value: int, dimension: Dimension) -> str:
    """A canonical value for display, exactly: `20000` of LENGTH is `20 m`, 1500 `1.5 m`, 20 `20 mm`; 2550 of RATIO is
    `25.5 %`.
    """
    names = DISPLAY.get(dimension)
    if names is None:
        return str(value)
    for name in names[:-1]:
        unit = UNITS[name]
        scaled = value * unit.denominator
        if scaled % unit.numerator == 0 and (value or name != "min"):
            return f"{scaled // unit.numerator} {name}"
        decimal = str(unit.numerator).strip("0") == "1"  # seconds have exact decimals, minutes have none
        if decimal and 10 * abs(scaled) >= _LEAST_TENTHS.get(name, 10) * unit.numerator:
            return f"{_decimal(scaled, unit.numerator)} {name}"
    unit = UNITS[names[-1]]
    return f"{_decimal(value * unit.denominator, unit.numerator)} {names[-1]}"


def _decimal(value: int, denominator: int) -> str:
    """`value / denominator` in decimals, for a denominator that is a power of ten."""
    digits = len(str(denominator)) - 1
    whole, rest = divmod(abs(value), denominator)
    fraction = str(rest).zfill(digits).rstrip("0")
    return f"{'-' if value < 0 else ''}{whole}{'.' + fraction if fraction else ''}"


def micrometres(value: int) -> str:
    """Return a length in um as text, in mm where it is at least as large: exact up to the um."""
    return f"{value} um" if value < 1_000 else f"{_decimal(value, 1_000)} mm"
