"""What the vehicle does, what it tells of that, and what happens to it."""

from enum import Enum, IntEnum, auto

from rtshcua.mavlink import enums


class Landed(IntEnum):
    """EXTENDED_SYS_STATE.landed_state (MAV_LANDED_STATE)."""

    ON_GROUND = enums.MAV_LANDED_STATE_ON_GROUND
    IN_AIR = enums.MAV_LANDED_STATE_IN_AIR
    TAKEOFF = enums.MAV_LANDED_STATE_TAKEOFF
    LANDING = enums.MAV_LANDED_STATE_LANDING


class Event(Enum):
    """What happened that the autopilot has a text for."""

    ARMED = auto()
    DISARMED = auto()
    TAKEOFF = auto()
    RETURN = auto()
    RETURN_CLIMB = auto()
    HOME = auto()
    TOUCHED = auto()
    LANDED = auto()
    AUTO_DISARMED = auto()
    TIPPED = auto()
    CRASHED = auto()


class Activity(Enum):
    """What it does at present; `REST` is to stand on the ground, `TOUCHED` not to know it yet, `WRECK` to lie there."""

    REST = auto()
    CLIMB = auto()
    TRACK = auto()
    RETURN_CLIMB = auto()
    RETURN_CROSS = auto()
    RETURN_WAIT = auto()
    CIRCLE = auto()
    DESCEND = auto()
    TOUCHED = auto()
    FALL = auto()
    WRECK = auto()
