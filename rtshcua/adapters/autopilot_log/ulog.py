"""Extract the track of a PX4 log (ULog, docs.px4.io/main/en/dev_log/ulog_file_format) with pyulog.

The fields are those of PX4's messages. `vehicle_global_position` has `lat` and `lon` as doubles in degrees and `alt` as
a float in m above mean sea level in all releases; later ones add `lat_lon_valid` and `alt_valid`. A receiver's report
has `lat`, `lon` (1e-7 degree) and `alt` (mm) in old releases, then `latitude_deg`, `longitude_deg` and `altitude_msl_m`
in degrees and m; the topics `vehicle_gnss` and `sensor_gnss` of 2026 have `latitude`, `longitude` and `altitude_msl`.
"""

from collections.abc import Callable
from typing import Any, BinaryIO, Final

import numpy
from pyulog import ULog

from rtshcua.adapters.autopilot_log.reports import NO_TRACK, ReadFailed, ReadLog
from rtshcua.adapters.store.reading import open_regular

_POSITION: Final = "vehicle_global_position"
_RECEIVERS: Final = ("vehicle_gps_position", "vehicle_gnss", "sensor_gps", "sensor_gnss")
#: names of latitude, longitude and height, with the factors to 1e-7 degree and mm
_FIELDS: Final = (
    ("lat", "lon", "alt", 1, 1),
    ("latitude_deg", "longitude_deg", "altitude_msl_m", 10_000_000, 1_000),
    ("latitude", "longitude", "altitude_msl", 10_000_000, 1_000),
)
_FIX_3D: Final = 3
#: a report is read again by pyulog where it looks for its place in a damaged file; more is not worth its time
_MOST_TIMES: Final = 8
_STEP: Final = 1 << 20


class TooDamaged(Exception):
    """The file is damaged so often that reading it takes too long."""


class CountedFile:
    """A file that counts what is read of it, so that a cut file and an endless search are noticed."""

    def __init__(self, file: BinaryIO, size: int, progress: Callable[[int], None]) -> None:
        self._file, self._progress = file, progress
        self._left, self._told = _MOST_TIMES * size + _STEP, 0
        self.cut = False

    def read(self, count: int) -> bytes:
        """The next octets. Raises `TooDamaged`."""
        data = self._file.read(count)
        self._left -= max(len(data), 1)
        if self._left < 0:
            raise TooDamaged("it is damaged in too many places")
        self.cut = len(data) < count and not (count == _HEADER and not data)
        if (at := self._file.tell()) - self._told >= _STEP:
            self._told = at
            self._progress(at)
        return data

    def seek(self, offset: int, whence: int = 0) -> int:
        """Move in the file."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """The place in the file."""
        return self._file.tell()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


_HEADER: Final = 3  # octets of a message's header


def read_log(path: str, size: int, progress: Callable[[int], None]) -> ReadLog | ReadFailed:
    """Read a log, as far as it can be read. Raises `TooDamaged`, and what pyulog raises for a damaged file."""
    with open_regular(path) as file:
        return _read(CountedFile(file, size, progress))


def _read(counted: CountedFile) -> ReadLog | ReadFailed:
    log = ULog(counted, [_POSITION, *_RECEIVERS])
    condition = "damaged" if log.file_corruption else "cut" if counted.cut else "whole"
    topics = {each.name: each.data for each in reversed(log.data_list)}  # the first instance of each
    receivers = [(name, topics[name]) for name in _RECEIVERS if name in topics]
    utc = next((found for _, data in receivers if (found := _utc(data))), [])
    candidates = [(_POSITION, _estimate(topics[_POSITION]))] if _POSITION in topics else []
    candidates += [(name, _received(data)) for name, data in receivers]
    for name, track in candidates:
        if track:
            return ReadLog(condition, name, track, utc)
    return ReadFailed(NO_TRACK, f"it has no position: neither `{_POSITION}` nor a report of a GNSS receiver")


def _estimate(data: dict[str, Any]) -> list[tuple[int, int, int, int]]:
    """The points of the estimator."""
    return _points(data, ("lat", "lon", "alt"), 10_000_000, 1_000, ("lat_lon_valid", "alt_valid"))


def _received(data: dict[str, Any]) -> list[tuple[int, int, int, int]]:
    """The points of a receiver with a fix in three dimensions."""
    for *names, degree, metre in _FIELDS:
        if names[0] in data:
            data = dict(data)
            if "fix_type" in data:
                data["fixed"] = data["fix_type"] >= _FIX_3D
            return _points(data, names, degree, metre, ("fixed",))
    return []


def _points(
    data: dict[str, Any], names: Any, degree: int, metre: int, valid: tuple[str, ...]
) -> list[tuple[int, int, int, int]]:
    fields = [data.get(name) for name in ("timestamp", *names)]
    if any(each is None for each in fields):
        return []
    at, latitude, longitude, height = (numpy.asarray(each) for each in fields)
    with numpy.errstate(all="ignore"):
        factors = ((latitude, degree), (longitude, degree), (height, metre))
        scaled = [each.astype(numpy.float64) * by for each, by in factors]
        kept = numpy.isfinite(scaled[0]) & numpy.isfinite(scaled[1]) & numpy.isfinite(scaled[2])
        for name in valid:
            if name in data:
                kept &= numpy.asarray(data[name]) != 0
        columns = [each[kept].clip(-(2.0**53), 2.0**53).round().astype(numpy.int64).tolist() for each in scaled]
    return list(zip(at[kept].tolist(), *columns, strict=True))


def _utc(data: dict[str, Any]) -> list[tuple[int, int]]:
    """Pairs of a time since the boot and its UTC."""
    if "time_utc_usec" not in data or "timestamp" not in data:
        return []
    count = len(data["timestamp"])
    relative = data["timestamp_time_relative"].tolist() if "timestamp_time_relative" in data else [0] * count
    pairs = zip(data["timestamp"].tolist(), relative, data["time_utc_usec"].tolist(), strict=True)
    return [(int(at) + int(apart), int(utc)) for at, apart, utc in pairs if utc]
