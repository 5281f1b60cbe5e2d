"""What the vehicle was seen to do: the only ground on which a command counts as done."""

from dataclasses import dataclass
from typing import Any

_ARMED = 128  # MAV_MODE_FLAG_SAFETY_ARMED
_PREARM = 0x1000_0000  # MAV_SYS_STATUS_PREARM_CHECK
_ON_GROUND = 1  # MAV_LANDED_STATE
_IN_AIR = (2, 3, 4)  # IN_AIR, TAKEOFF, LANDING
_FIX_3D = 3
_LONGEST_TEXT = 200


@dataclass(slots=True)
class Observed:
    """The last reports, None or 0 before the first. Angles 1e-7 degree, lengths mm, speeds mm/s, times us."""

    mode: int | None = None
    armed: bool = False
    landed_state: int = 0
    latitude: int = 0
    longitude: int = 0
    height: int = 0
    home_amsl: int | None = None
    speed: int = 0
    fix: int = 0
    prearm: bool = False
    heartbeat_us: int | None = None
    text: str = ""

    def take(self, name: str, message: Any, now_us: int) -> None:
        """Take in one message of the autopilot's component."""
        match name:
            case "HEARTBEAT":
                self.mode = message.custom_mode
                self.armed = bool(message.base_mode & _ARMED)
                self.heartbeat_us = now_us
            case "EXTENDED_SYS_STATE":
                self.landed_state = message.landed_state
            case "GLOBAL_POSITION_INT":
                self.latitude, self.longitude = message.lat, message.lon
                self.height = message.relative_alt
                self.home_amsl = message.alt - message.relative_alt
                self.speed = 10 * max(abs(message.vx), abs(message.vy), abs(message.vz))  # from cm/s
            case "GPS_RAW_INT":
                self.fix = message.fix_type
            case "SYS_STATUS":
                healthy = message.onboard_control_sensors_health & message.onboard_control_sensors_present
                self.prearm = bool(healthy & _PREARM)
            case "STATUSTEXT":
                self._say(message)

    @property
    def airborne(self) -> bool:
        """In the air, as far as it says; an armed vehicle that does not say counts as in the air."""
        return self.landed_state in _IN_AIR or (self.landed_state == 0 and self.armed)

    @property
    def down(self) -> bool:
        """Seen on the ground with its motors off."""
        return self.landed_state == _ON_GROUND and not self.armed

    @property
    def ready(self) -> bool:
        """It has a position and would arm, or it flies already."""
        return self.home_amsl is not None and (self.airborne or self.unready is None)

    @property
    def unready(self) -> str | None:
        """What stands against arming, in words; None: nothing that it tells of."""
        if self.heartbeat_us is None:
            return "no heartbeat of an autopilot"
        if self.landed_state == 0:
            return "it does not say whether it is on the ground"
        if self.fix < _FIX_3D:
            return "no 3D position fix"
        if self.home_amsl is None:
            return "no position estimate"
        return None if self.prearm else f"its own checks before arming fail{f': {self.text}' if self.text else ''}"

    def _say(self, message: Any) -> None:
        """Keep the last text; a long one comes in chunks (MAVLink 2, `id` and `chunk_seq`)."""
        text = message.text if isinstance(message.text, str) else bytes(message.text).decode("utf-8", "replace")
        text = text.rstrip("\0\t ")
        self.text = (self.text + text)[:_LONGEST_TEXT] if message.id and message.chunk_seq else text
