"""Convert written numbers and moments to whole canonical units, without floats.

Moments are those of RFC 3339 (section 5.6), in microseconds since 1970-01-01T00:00Z.
"""

import re
from datetime import date
from enum import Enum
from functools import lru_cache
from typing import NamedTuple

from rtshcua.model.flat.limits import DAY, MAX_VALUE
from rtshcua.model.quantity import UNITS, Dimension, UnitOfMeasure

LIMIT = 2**63 - 1

PLAIN = UnitOfMeasure(Dimension.COUNT, 1)
DEGREE = UNITS["deg"]

#: The plural names of canonical units; a count has none.
CANONICAL: dict[Dimension, str] = {
    Dimension.LENGTH: "mm",
    Dimension.SPEED: "mm/s",
    Dimension.DURATION: "us",
    Dimension.ANGLE: "steps of 1e-7 degree",
    Dimension.RATIO: "hundredths of 1 %",
    Dimension.VOLTAGE: "mV",
    Dimension.COUNT: "",
}

_DIGITS = 40  # more than any quantity has; bounds the work for a text of a million digits


class Trouble(Enum):
    """The reason why a number has no exact value."""

    UNKNOWN_UNIT = "unknown unit"
    NOT_EXACT = "not exact"
    OUT_OF_BOUNDS = "out of bounds"


class Exact(NamedTuple):
    """`value` in canonical units; if `trouble` is `NOT_EXACT`, the whole number nearest to the written one."""

    value: int
    dimension: Dimension
    trouble: Trouble | None


@lru_cache(maxsize=4096)
def exact(number: str, unit: str | None, negative: bool = False) -> Exact:
    """Return the value of `number` (digits, with `_` and one `.` allowed) in `unit`; without a unit, a plain count."""
    known = PLAIN if unit is None else UNITS.get(unit)
    return Exact(0, Dimension.COUNT, Trouble.UNKNOWN_UNIT) if known is None else exact_in(number, known, negative)


def exact_in(number: str, known: UnitOfMeasure, negative: bool = False) -> Exact:
    """Return the value of `number` in a unit."""
    whole, _, fraction = number.replace("_", "").partition(".")
    fraction = fraction.rstrip("0")
    whole = whole.lstrip("0")
    if len(whole) > _DIGITS:
        return Exact(0, known.dimension, Trouble.OUT_OF_BOUNDS)
    trouble = Trouble.NOT_EXACT if len(fraction) > _DIGITS else None
    fraction = fraction[:_DIGITS]
    numerator = int(whole + fraction or "0") * known.numerator
    denominator = 10 ** len(fraction) * known.denominator
    value, rest = divmod(numerator, denominator)
    if rest:
        value += 2 * rest >= denominator
        trouble = Trouble.NOT_EXACT
    if value > LIMIT:
        trouble = Trouble.OUT_OF_BOUNDS
    return Exact(-value if negative else value, known.dimension, trouble)


_FORM = re.compile(
    r"(\d{4})-(\d{2})-(\d{2})[Tt](\d{2}):(\d{2})(?::(\d{2})(?:\.(\d+))?)?(?:[Zz]|([+-])(\d{2}):(\d{2}))", re.ASCII
)
_EPOCH = date(1970, 1, 1).toordinal()
_SECOND = 1_000_000  # us


def utc_us(text: str) -> int:
    """Return `text` in us since the epoch; the seconds are optional. Raises ValueError with the reason.

    A leap second (`:60`) is refused: the vehicle's time scale has no value for it.
    """
    found = _FORM.fullmatch(text)
    if found is None:
        raise ValueError("expected a date, `T`, a time, and `Z` or an offset from UTC")
    *numbers, fraction, sign, hours, minutes = found.groups("0")
    year, month, day, hour, minute, second, offset_hours, offset_minutes = map(int, (*numbers, hours, minutes))
    fraction = fraction.rstrip("0")
    if len(fraction) > 6:
        raise ValueError("seconds have at most 6 decimals")
    if hour > 23 or minute > 59 or second > 59:
        raise ValueError("times are from `00:00:00` to `23:59:59`")
    if offset_hours > 23 or offset_minutes > 59:
        raise ValueError("the offset from UTC is at most `23:59`")
    try:
        days = date(year, month, day).toordinal() - _EPOCH
    except ValueError:
        raise ValueError("the day does not exist") from None
    offset = (offset_hours * 60 + offset_minutes) * (-1 if sign == "-" else 1)
    seconds = (hour * 60 + minute - offset) * 60 + second
    value = days * DAY + seconds * _SECOND + int(fraction.ljust(6, "0"))
    if not 0 <= value <= MAX_VALUE:
        raise ValueError("the year must be from 1970 to 2255")
    return value
