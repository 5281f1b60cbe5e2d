"""Time zones by IANA name, from the package `tzdata`, never from the machine.

The compiled result depends on the sources and on the version of that package, which a policy records. A policy carries
the offsets from UTC that its vehicle needs: for eleven years, from one year before that version.
"""

from datetime import UTC, datetime, timedelta
from functools import cache
from importlib.resources import files
from typing import Final
from zoneinfo import ZoneInfo

import tzdata

#: the IANA release of the time-zone data, such as `2026f`
VERSION: Final[str] = tzdata.IANA_VERSION
#: local times are known between the beginnings of these years, UTC; a policy is signed for weeks
FIRST_YEAR: Final = int(VERSION[:4]) - 1
LAST_YEAR: Final = FIRST_YEAR + 11

_STEP = timedelta(days=1)  # no time zone sets its clocks twice within that
_SECOND = timedelta(seconds=1)
_US = timedelta(microseconds=1)
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


@cache
def names() -> frozenset[str]:
    """Return the names of all time zones."""
    return frozenset((files(tzdata) / "zones").read_text(encoding="utf-8").split())


@cache
def offsets(name: str) -> tuple[int, ...]:
    """Return the offsets of a time zone from UTC, in the form of `Vehicle.offsets`. Raises `KeyError` if unknown."""
    if name not in names():
        raise KeyError(name)
    with files(tzdata).joinpath("zoneinfo", *name.split("/")).open("rb") as data:
        zone = ZoneInfo.from_file(data)

    def offset(moment: datetime) -> int:
        found = moment.astimezone(zone).utcoffset()
        assert found is not None
        return found // _US

    at, end = (datetime(year, 1, 1, tzinfo=UTC) for year in (FIRST_YEAR, LAST_YEAR))
    found = [_us(at), offset(at)]
    while at < end:
        after = min(at + _STEP, end)
        if offset(after) != found[-1] and after < end:
            low, high = at, after
            while high - low > _SECOND:
                half = low + (high - low) // _SECOND // 2 * _SECOND
                low, high = (half, high) if offset(half) == found[-1] else (low, half)
            found += (_us(high), offset(high))
        at = after
    return (*found, _us(end))


def _us(moment: datetime) -> int:
    return (moment - _EPOCH) // _US
