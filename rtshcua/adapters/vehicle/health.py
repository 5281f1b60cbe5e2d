"""SYS_STATUS: whether the autopilot would let itself be armed, and what it finds unwell."""

from typing import Any, Final

_PREARM: Final = 0x1000_0000  # MAV_SYS_STATUS_PREARM_CHECK

#: MAV_SYS_STATUS_SENSOR, as far as arming rests on them
_NAMES: Final = {
    0x01: "gyroscope",
    0x02: "accelerometer",
    0x04: "magnetometer",
    0x08: "barometer",
    0x20: "GPS",
    0x8000: "motor outputs",
    0x1_0000: "remote control",
    0x10_0000: "geofence",
    0x20_0000: "attitude and heading",
    0x100_0000: "logging",
    0x200_0000: "battery",
    0x4000_0000: "propulsion",
}


def would_arm(message: Any) -> bool:
    """The health bit of the pre-arm check. PX4 1.16 sets it without saying that there is such a check (recorded)."""
    return bool(message.onboard_control_sensors_health & _PREARM)


def unwell(message: Any) -> tuple[str, ...]:
    """The sensors that are there and in use, and not healthy."""
    used = message.onboard_control_sensors_present & message.onboard_control_sensors_enabled
    ill = used & ~message.onboard_control_sensors_health
    return tuple([name for bit, name in _NAMES.items() if ill & bit])
