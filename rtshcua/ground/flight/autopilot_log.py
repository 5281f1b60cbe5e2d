"""What an autopilot's own log says of its flight: its track, by the time since the autopilot's boot, and its UTC.

The log is a PX4 ULog or an ArduPilot DataFlash log. Nothing in it is signed.
"""

from enum import StrEnum
from typing import NamedTuple


class AutopilotLogKind(StrEnum):
    """The format of an autopilot's log."""

    ULOG = "ulog"
    DATAFLASH = "dataflash"


class LogCondition(StrEnum):
    """How much of an autopilot's log can be read."""

    WHOLE = "whole"
    CUT = "cut"  # it breaks off inside a message
    DAMAGED = "damaged"  # messages in it cannot be read


class AutopilotPoint(NamedTuple):
    """Where the autopilot recorded that it was, `boot_us` after its boot: WGS 84 in 1e-7 degree, and mm above mean sea
    level.
    """

    boot_us: int
    latitude: int
    longitude: int
    above_sea: int


class UtcOfBoot(NamedTuple):
    """The UTC of the autopilot's boot in us since the Unix epoch, by its GNSS receiver, and the spread of its reports
    of it: 95 of 100 differ by no more.
    """

    utc_us: int
    error_us: int


class AutopilotLog(NamedTuple):
    """The content of an autopilot's log. `source` is the message of the track; the points are in order of their times,
    each later than the one before. `utc_of_boot` is None if the receiver reported no time.
    """

    kind: AutopilotLogKind
    condition: LogCondition
    source: str
    track: tuple[AutopilotPoint, ...]
    utc_of_boot: UtcOfBoot | None


def utc_of_boot(reports: list[tuple[int, int]]) -> UtcOfBoot | None:
    """The UTC of the boot by pairs of a time since the boot and its UTC, in us: the median."""
    if not reports:
        return None
    found = sorted(utc_us - boot_us for boot_us, utc_us in reports)
    middle = found[len(found) // 2]
    apart = sorted(abs(each - middle) for each in found)
    return UtcOfBoot(middle, nearest_rank(apart, 95))


def nearest_rank(ascending: list[int], percent: int) -> int:
    """The percentile of a list that is not empty, by the nearest rank."""
    return ascending[max(0, -(-len(ascending) * percent // 100) - 1)]
