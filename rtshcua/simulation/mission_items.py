"""What the items of a mission mean to the simulated vehicle, and what a flavour decides about missions."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.simulation.modes import Mode
from rtshcua.simulation.place import Home, Point
from rtshcua.simulation.plan import Item
from rtshcua.simulation.vehicle import Vehicle

WAYPOINT = mavlink.MAV_CMD_NAV_WAYPOINT
LOITER = mavlink.MAV_CMD_NAV_LOITER_UNLIM
LOITER_TIME = mavlink.MAV_CMD_NAV_LOITER_TIME
RETURN = mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH
LAND = mavlink.MAV_CMD_NAV_LAND
TAKEOFF = mavlink.MAV_CMD_NAV_TAKEOFF
DELAY = mavlink.MAV_CMD_NAV_DELAY
SPEED = mavlink.MAV_CMD_DO_CHANGE_SPEED
JUMP = mavlink.MAV_CMD_DO_JUMP
WAYPOINTS = frozenset({WAYPOINT, LOITER, LOITER_TIME})
"""Items that fly to a place."""
NAVIGATION = WAYPOINTS | frozenset({RETURN, LAND, TAKEOFF, DELAY})
"""Items that take time."""
PASSED_BY = frozenset(
    {
        mavlink.MAV_CMD_CONDITION_YAW,
        mavlink.MAV_CMD_DO_LAND_START,
        mavlink.MAV_CMD_DO_SET_ROI_LOCATION,
        mavlink.MAV_CMD_DO_SET_ROI_NONE,
        mavlink.MAV_CMD_DO_SET_ROI,
        mavlink.MAV_CMD_DO_DIGICAM_CONTROL,
        mavlink.MAV_CMD_DO_MOUNT_CONTROL,
        mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST,
        mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW,
        mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE,
        mavlink.MAV_CMD_IMAGE_START_CAPTURE,
        mavlink.MAV_CMD_IMAGE_STOP_CAPTURE,
        mavlink.MAV_CMD_VIDEO_START_CAPTURE,
        mavlink.MAV_CMD_VIDEO_STOP_CAPTURE,
        mavlink.MAV_CMD_SET_CAMERA_MODE,
        mavlink.MAV_CMD_SET_CAMERA_ZOOM,
        mavlink.MAV_CMD_SET_CAMERA_FOCUS,
    }
)
"""Items for cameras and gimbals, of which this vehicle has none: they are done at once."""
FLOWN = NAVIGATION | PASSED_BY | {SPEED, JUMP}


class State(IntEnum):
    """MISSION_CURRENT.mission_state (MISSION_STATE)."""

    UNKNOWN = 0
    NO_MISSION = 1
    NOT_STARTED = 2
    ACTIVE = 3
    PAUSED = 4
    COMPLETE = 5


@dataclass(frozen=True, slots=True)
class MissionRules:
    """What a flavour does its own way."""

    first: int
    """The slot of the first item that is flown."""
    judge: Callable[[tuple[Item, ...], Vehicle, Home, Callable[[Point], bool]], bool]
    """Whether a mission can be flown; the last argument says what the fence allows."""
    may_enter: Callable[[tuple[Item, ...], Vehicle], bool]
    """Whether the mode may be entered, the mission being one that can be flown."""
    judged_us: int
    """How long after an upload the judgement comes; until then the one before stands."""
    waits_for_start: bool
    """Whether on the ground only MISSION_START begins it, not the mode alone."""
    return_is_mode: bool
    """Whether an item that returns changes the mode."""
    after: Mode | None
    """The mode after the last item, in the air; None keeps the mode and holds."""
    accept_m: float
    """How near a waypoint counts as reached, if it does not say so itself."""
    tells_all: bool
    """Whether MISSION_ITEM_REACHED is sent for items too that take no time."""
    text: Callable[[int, Item], str | None]
    """What is said when an item that takes time begins."""
