"""Who speaks on the link under the vehicle's own ids and is not the vehicle: a gimbal that was given its component id,
a second autopilot, somebody who forges frames on an unsigned link.
"""

from typing import Final

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec, Message
from rtshcua.model.faults import FlightMode, Voice
from rtshcua.simulation.autopilot import Autopilot
from rtshcua.simulation.telemetry import heartbeat

#: whom the answers are for that are not for us: the component that we are, of another system
_ANOTHER: Final = (77, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER)
_ANSWERED: Final = (
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_DO_SET_MODE,
    mavlink.MAV_CMD_DO_REPOSITION, mavlink.MAV_CMD_DO_CHANGE_SPEED,
)  # fmt: skip


class SecondSender:
    """One of them: says the same each `each_us`, from a time on, and counts its own frames."""

    def __init__(self, says: Voice, each_us: int, at_us: int) -> None:
        self._says = says
        self._each_us = max(each_us, 1)
        self._due_us = at_us
        self._codec: Codec | None = None

    def due(self, autopilot: Autopilot, system: int, now_us: int) -> list[bytes]:
        """What it says by now."""
        if now_us < self._due_us:
            return []
        self._due_us = now_us + self._each_us
        if self._codec is None:
            self._codec = Codec(system, mavlink.MAV_COMP_ID_AUTOPILOT1)
        return [self._codec.pack(each) for each in self._messages(autopilot)]

    def _messages(self, autopilot: Autopilot) -> list[Message]:
        beat = heartbeat(autopilot)
        match self._says:
            case Voice.GIMBAL:
                kind, none = mavlink.MAV_TYPE_GIMBAL, mavlink.MAV_AUTOPILOT_INVALID
                return [mavlink.MAVLink_heartbeat_message(kind, none, 0, 0, mavlink.MAV_STATE_ACTIVE, 3)]
            case Voice.DISARMED:
                beat.base_mode &= ~mavlink.MAV_MODE_FLAG_SAFETY_ARMED
                return [beat]
            case Voice.STRAYED:
                beat.custom_mode = autopilot.flavour.modes.numbers[FlightMode.LAND]
                return [beat]
            case Voice.ANSWERS:
                denied, refused = mavlink.MAV_RESULT_DENIED, mavlink.MAV_MISSION_DENIED
                fence = mavlink.MAVLink_mission_ack_message(*_ANOTHER, refused, mavlink.MAV_MISSION_TYPE_FENCE)
                answers = [mavlink.MAVLink_command_ack_message(each, denied, 0, 0, *_ANOTHER) for each in _ANSWERED]
                return [*answers, fence]
