"""The supported autopilots and their flight modes: `custom_mode` of HEARTBEAT, and the parameters of DO_SET_MODE."""

from collections.abc import Mapping
from enum import IntEnum
from typing import Final

from rtshcua.mavlink import enums

PX4: Final = enums.MAV_AUTOPILOT_PX4
ARDUPILOT: Final = enums.MAV_AUTOPILOT_ARDUPILOTMEGA
KNOWN: Final = (PX4, ARDUPILOT)


def is_vehicle(kind: int, autopilot: int) -> bool:
    """Whether a HEARTBEAT of this MAV_TYPE and MAV_AUTOPILOT is from a vehicle with a supported autopilot.

    A ground station, a gimbal or a companion computer is not, whatever autopilot it reports.
    """
    return autopilot in KNOWN and kind in enums.VEHICLES


def is_another(kind: int, autopilot: int) -> bool:
    """Whether a HEARTBEAT is from a vehicle, with any autopilot."""
    return autopilot != enums.MAV_AUTOPILOT_INVALID and kind in enums.VEHICLES


class Px4Mode(IntEnum):
    """PX4's modes (`px4_custom_mode.h`), with the names shown to people: `main << 16 | sub << 24`."""

    MANUAL = 1 << 16
    ALTITUDE = 2 << 16
    POSITION = 3 << 16
    ORBIT = 3 << 16 | 1 << 24
    TAKEOFF = 4 << 16 | 2 << 24
    HOLD = 4 << 16 | 3 << 24
    MISSION = 4 << 16 | 4 << 24
    RETURN = 4 << 16 | 5 << 24
    LAND = 4 << 16 | 6 << 24
    FOLLOW = 4 << 16 | 8 << 24
    PRECISION_LAND = 4 << 16 | 9 << 24
    ACRO = 5 << 16
    OFFBOARD = 6 << 16
    STABILIZED = 7 << 16

    @property
    def parameters(self) -> tuple[int, int]:
        """Parameters 2 and 3 of DO_SET_MODE: main mode and sub-mode."""
        return self >> 16 & 0xFF, self >> 24


class CopterMode(IntEnum):
    """ArduCopter's modes (`mode.h`, COPTER_MODE of the dialect)."""

    STABILIZE = 0
    ACRO = 1
    ALT_HOLD = 2
    AUTO = 3
    GUIDED = 4
    LOITER = 5
    RTL = 6
    CIRCLE = 7
    LAND = 9
    DRIFT = 11
    SPORT = 13
    FLIP = 14
    AUTOTUNE = 15
    POSHOLD = 16
    BRAKE = 17
    THROW = 18
    AVOID_ADSB = 19
    GUIDED_NOGPS = 20
    SMART_RTL = 21
    FOLLOW = 23
    AUTO_RTL = 27

    @property
    def parameters(self) -> tuple[int, int]:
        """Parameters 2 and 3 of DO_SET_MODE: the number, and 0."""
        return self.value, 0


#: the names that the autopilots display
PX4_NAMES: Final[Mapping[int, str]] = {mode: mode.name.replace("_", " ").title() for mode in Px4Mode}
COPTER_NAMES: Final[Mapping[int, str]] = {mode: mode.name for mode in CopterMode}
