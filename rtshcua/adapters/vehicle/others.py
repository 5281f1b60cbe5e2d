"""Commands of others over their own links, as far as the autopilot's answers are heard on ours."""

from collections.abc import Mapping
from typing import Final

from rtshcua.mavlink import enums

#: commands that change how the vehicle flies, in words (MAV_CMD)
STEERS: Final[Mapping[int, str]] = {
    enums.MAV_CMD_NAV_RETURN_TO_LAUNCH: "a return",
    enums.MAV_CMD_NAV_LAND: "a landing",
    enums.MAV_CMD_NAV_TAKEOFF: "a takeoff",
    enums.MAV_CMD_DO_ORBIT: "an orbit",
    enums.MAV_CMD_DO_SET_MODE: "a mode",
    enums.MAV_CMD_DO_CHANGE_SPEED: "a speed",
    enums.MAV_CMD_DO_CHANGE_ALTITUDE: "a height",
    enums.MAV_CMD_DO_REPOSITION: "a place",
    enums.MAV_CMD_DO_PAUSE_CONTINUE: "a pause, or its end",
    enums.MAV_CMD_MISSION_START: "a mission",
    enums.MAV_CMD_COMPONENT_ARM_DISARM: "arming or disarming",
}
#: MAV_RESULT: accepted, in progress
GRANTED: Final = (0, 5)
WARNING: Final = 4  # MAV_SEVERITY
#: for ground stations, in at most 50 octets
CROSSED: Final = "our command crossed yours: check and repeat it"


def crossed(what: str, ago_us: int) -> str:
    """That a frame of ours left this long before something showed, in words."""
    return (
        f"a frame of ours left {ago_us // 1_000} ms before this was seen: {what}; if the vehicle does not "
        "do it, repeat the command"
    )
