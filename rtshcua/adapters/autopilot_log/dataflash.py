"""Extract the track of an ArduPilot log (DataFlash) with pymavlink.

The fields are those of ArduPilot's messages since Copter 3.3 (2015), whose `TimeUS` is the time since the boot in us.
`POS` is the estimator's position: `Lat` and `Lng` in 1e-7 degree, `Alt` a float in m above mean sea level. `GPS` is a
receiver's report: `Status` is its fix, `Alt` in cm, `GMS` ms in GPS week `GWk`; since 4.1 `I` is the receiver's number.
"""

from collections.abc import Callable
from math import isfinite
from typing import Any, Final

from pymavlink.DFReader import DFReader_binary

from rtshcua.adapters.autopilot_log.reports import NO_TRACK, ReadFailed, ReadLog

_FIX_3D: Final = 3
_WEEK_MS: Final = 604_800_000
#: GPS time begins on 6 January 1980; since 2017 it is 18 s ahead of UTC, which ArduPilot assumes too
_GPS_BEGINS_MS: Final = 315_964_800_000 - 18_000
#: octets at the end of a log that may belong to no message: logs in blocks have up to a page
_PAGE: Final = 528
_FIRST: Final = b"\xa3"  # the first octet of a message


class _Reader(DFReader_binary):  # type: ignore[misc]
    """The reader without its search for a time of day, which reads a log without GPS whole."""

    def init_clock(self) -> None:
        """Do without: each message has its `TimeUS`."""


def read_log(path: str, size: int, progress: Callable[[int], None]) -> ReadLog | ReadFailed:
    """Read a log, as far as it can be read. Raises what pymavlink raises for a damaged file."""
    log = _Reader(path, progress_callback=lambda percent: progress(size * percent // 100))
    end = _end(log)
    unread = size - end
    skipped = end - sum(count * log.formats[number].len for number, count in enumerate(log.counts) if count)
    cut = unread < 0 or log.data_map[end : end + 1] == _FIRST
    condition = "damaged" if skipped or unread > _PAGE else "cut" if cut else "whole"
    content = _Content()
    try:
        # pymavlink's index ends at the first message of an unknown type, so what follows is read one by one
        while (message := _next(log) if unread <= _PAGE else log.recv_msg()) is not None:
            content.take(message)
    except Exception:  # noqa: BLE001  it can be read no further
        condition = "damaged"
    for name, track in (("POS", content.estimated), ("GPS", content.received)):
        if track:
            return ReadLog(condition, name, track, content.utc)
    return ReadFailed(NO_TRACK, "it has no position: neither `POS` nor `GPS` with the time since the boot")


def _next(log: Any) -> Any:
    return log.recv_match(type=["POS", "GPS"], strict=True)


def _end(log: Any) -> int:
    """Where the last indexed message ends, which a cut file does not reach."""
    ends = ((places[-1], number) for number, places in enumerate(log.offsets) if len(places))
    last, number = max(ends, default=(0, -1))
    return int(last) + int(log.formats[number].len if number in log.formats else 0)


class _Content:
    def __init__(self) -> None:
        self.estimated: list[tuple[int, int, int, int]] = []
        self.received: list[tuple[int, int, int, int]] = []
        self.utc: list[tuple[int, int]] = []

    def take(self, message: Any) -> None:
        kind, at_us = message.get_type(), getattr(message, "TimeUS", None)
        if not isinstance(at_us, int):
            return
        if kind == "POS":
            _add(self.estimated, at_us, message)
        elif kind == "GPS" and not getattr(message, "I", 0):
            if getattr(message, "Status", 0) >= _FIX_3D:
                _add(self.received, at_us, message)
            week, of_week = getattr(message, "GWk", 0), getattr(message, "GMS", 0)
            if week:
                self.utc.append((at_us, 1_000 * (_GPS_BEGINS_MS + week * _WEEK_MS + of_week)))


def _add(track: list[tuple[int, int, int, int]], at_us: int, message: Any) -> None:
    latitude, longitude, height = (getattr(message, name, None) for name in ("Lat", "Lng", "Alt"))
    if all(isinstance(each, (int, float)) and isfinite(each) for each in (latitude, longitude, height)):
        assert latitude is not None
        assert longitude is not None
        assert height is not None
        track.append((at_us, round(latitude * 10_000_000), round(longitude * 10_000_000), round(height * 1_000)))
