"""The mark in AUTOPILOT_VERSION by which a simulated vehicle identifies itself and its speed.

PX4 and ArduPilot put hashes of their sources into `middleware_custom_version`; the simulated vehicle puts a name
there, and its speed times 100 into `os_custom_version`.
"""

from typing import Any, Final

MARK: Final = b"rtshcua\0"


def marked(speed: int) -> tuple[list[int], list[int]]:
    """Return `middleware_custom_version` and `os_custom_version` of a vehicle simulated at `speed`/100."""
    return list(MARK), list(speed.to_bytes(len(MARK), "little"))


def marked_speed(version: Any) -> int | None:
    """Return the speed in an AUTOPILOT_VERSION, times 100; None if the vehicle is not simulated by this program."""
    if bytes(version.middleware_custom_version) != MARK:
        return None
    return int.from_bytes(bytes(version.os_custom_version), "little")


def hundredths(speed: float) -> int:
    """Return simulated seconds per second, times 100."""
    return max(1, round(speed * 100))
