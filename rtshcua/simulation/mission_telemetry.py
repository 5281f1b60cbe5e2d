"""MISSION_CURRENT, of both flavours alike."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Message
from rtshcua.simulation.autopilot import Autopilot
from rtshcua.simulation.modes import Mode

_IN_MISSION, _SUSPENDED = 1, 2


def mission_current(a: Autopilot) -> Message:
    """MISSION_CURRENT. `total` counts the items that are flown, home left out; PX4 tells no `mission_mode`."""
    mission, first = a.mission, a.flavour.missions.first
    mode = (_IN_MISSION if a.vehicle.mode is Mode.MISSION else _SUSPENDED) if first else 0
    total = max(0, len(mission.items) - first)
    return mavlink.MAVLink_mission_current_message(mission.current, total, mission.state, mode)
