"""An autopilot's own log of a track, as PX4 and as ArduPilot write it."""

from collections.abc import Sequence

from reference import dataflash_writer, ulog_writer
from rtshcua.ground.flight.autopilot_log import AutopilotPoint

_WEEK_MS = 604_800_000
_GPS_BEGINS_MS = 315_964_800_000


def px4_log(track: Sequence[AutopilotPoint], utc_of_boot_us: int | None = None) -> bytes:
    """A ULog with `vehicle_global_position`, and a receiver's report each second."""
    formats = {"vehicle_global_position": ulog_writer.POSITION["new"], "sensor_gps": ulog_writer.RECEIVER["sensor_gps"]}
    data: list[tuple[str, tuple[float, ...]]] = []
    for at in track:
        place = (at.latitude / 1e7, at.longitude / 1e7, at.above_sea / 1e3)
        data.append(("vehicle_global_position", (at.boot_us, at.boot_us, *place, True, True)))
        if utc_of_boot_us is not None:
            data.append(("sensor_gps", (at.boot_us, *place, utc_of_boot_us + at.boot_us - 70_000, -70_000, 3)))
    return ulog_writer.ulog(formats, data, track[0].boot_us if track else 0)


def ardupilot_log(track: Sequence[AutopilotPoint], utc_of_boot_us: int | None = None) -> bytes:
    """A DataFlash log with POS, and GPS if the UTC is known."""
    data: list[tuple[str, tuple[float, ...]]] = []
    for at in track:
        metres = at.above_sea / 1e3
        data.append(("POS", (at.boot_us, at.latitude, at.longitude, metres, 0, 0)))
        if utc_of_boot_us is not None:
            gps_ms = (utc_of_boot_us + at.boot_us) // 1_000 - _GPS_BEGINS_MS + 18_000
            place = (at.latitude, at.longitude, at.above_sea // 10, 0, 0, 0, 0, 1)
            data.append(("GPS", (at.boot_us, 0, 3, gps_ms % _WEEK_MS, gps_ms // _WEEK_MS, 12, 80, *place)))
    return dataflash_writer.dataflash(dataflash_writer.KINDS, data)
