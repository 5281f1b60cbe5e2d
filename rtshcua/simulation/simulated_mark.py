"""How a simulated vehicle says that it is one, and how fast it lives: in AUTOPILOT_VERSION, as no autopilot does.

PX4 and ArduPilot put hashes of their sources into `middleware_custom_version`; this program's vehicle says its name
there, and in `os_custom_version` how many hundredths of a second of flight pass in a second.
"""

from typing import Any, Final

MARK: Final = b"rtshcua\0"


def marked(speed: int) -> tuple[list[int], list[int]]:
    """`middleware_custom_version` and `os_custom_version` of a vehicle that lives at `speed`/100 of life's pace."""
    return list(MARK), list(speed.to_bytes(len(MARK), "little"))


def marked_speed(version: Any) -> int | None:
    """The pace that an AUTOPILOT_VERSION tells, times 100; None where it is not of a vehicle that this program
    simulates.
    """
    if bytes(version.middleware_custom_version) != MARK:
        return None
    return int.from_bytes(bytes(version.os_custom_version), "little")


def hundredths(speed: float) -> int:
    """Seconds of flight in a second, times 100."""
    return max(1, round(speed * 100))
