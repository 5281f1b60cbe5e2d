"""Moments as RFC 3339 writes them (section 5.6), exactly, in microseconds since 1970-01-01T00:00Z."""

import re
from datetime import date

from rtshcua.model.flat.limits import DAY, MAX_VALUE

_FORM = re.compile(
    r"(\d{4})-(\d{2})-(\d{2})[Tt](\d{2}):(\d{2})(?::(\d{2})(?:\.(\d+))?)?(?:[Zz]|([+-])(\d{2}):(\d{2}))", re.ASCII
)
_EPOCH = date(1970, 1, 1).toordinal()
_SECOND = 1_000_000  # us


def moment(text: str) -> int:
    """`text` in us since the epoch; the seconds may be left out. Raises ValueError with what is wrong with it.

    A leap second (`:60`) is refused: it has no place of its own in the time that the vehicle keeps.
    """
    found = _FORM.fullmatch(text)
    if found is None:
        raise ValueError("it is not written as a date, `T`, a time, and `Z` or the distance from UTC")
    year, month, day, hour, minute, second, fraction, sign, hours, minutes = found.groups()
    fraction = (fraction or "").rstrip("0")
    if len(fraction) > 6:
        raise ValueError("it has more than 6 decimals, and times are kept in whole us")
    if int(hour) > 23 or int(minute) > 59 or int(second or 0) > 59:
        raise ValueError("times go from `00:00:00` to `23:59:59`")
    if int(hours or 0) > 23 or int(minutes or 0) > 59:
        raise ValueError("the distance from UTC goes up to `23:59`")
    try:
        days = date(int(year), int(month), int(day)).toordinal() - _EPOCH
    except ValueError:
        raise ValueError("there is no such day") from None
    offset = (int(hours or 0) * 60 + int(minutes or 0)) * (-1 if sign == "-" else 1)
    seconds = (int(hour) * 60 + int(minute) - offset) * 60 + int(second or 0)
    value = days * DAY + seconds * _SECOND + int(fraction.ljust(6, "0"))
    if not 0 <= value <= MAX_VALUE:
        raise ValueError("only moments from 1970 to 2255 are kept")
    return value
