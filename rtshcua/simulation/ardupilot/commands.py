"""ArduCopter's commands. Altitudes are relative to home unless the frame says otherwise; a refusal is FAILED."""

from collections.abc import Mapping
from math import isfinite, radians

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.model.faults import FlightMode
from rtshcua.simulation.ardupilot.payload_commands import PAYLOAD_COMMANDS
from rtshcua.simulation.autopilot import Autopilot, Handler
from rtshcua.simulation.command import VehicleCommand, whole
from rtshcua.simulation.commands import ACCEPTED, DENIED, FAILED, arm_disarm, shared
from rtshcua.simulation.mission_protocol import AMSL_FRAMES, RELATIVE_FRAMES
from rtshcua.simulation.place import Point

_RELATIVE_FRAMES = RELATIVE_FRAMES | {None}
"""None stands for COMMAND_LONG, which has no frame: its altitudes are relative."""


def above_home(a: Autopilot, frame: int | None, altitude: float) -> float | None:
    """Return metres above home; None for an unsupported frame (above terrain) or an altitude that is not finite."""
    if not isfinite(altitude):
        return None
    if frame in AMSL_FRAMES:
        return altitude - a.home.amsl_mm / 1000
    return altitude if frame in _RELATIVE_FRAMES else None


def _takeoff(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
    """Handle NAV_TAKEOFF: requires a relative frame, armed, landed, GUIDED; in LOITER it is accepted without effect."""
    if command.frame not in _RELATIVE_FRAMES:
        return (DENIED,)
    vehicle, up = a.vehicle, command.altitude
    if not vehicle.armed or vehicle.in_air or not isfinite(up) or up <= vehicle.body.up:
        return (FAILED,)
    if vehicle.mode is FlightMode.LOITER:
        return (ACCEPTED,)
    if vehicle.mode is not FlightMode.GUIDED:
        return (FAILED,)
    vehicle.takeoff_up = up
    vehicle.climb()
    return (ACCEPTED,)


def _reposition(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
    up = above_home(a, command.frame, command.altitude)
    if command.latitude is None or command.longitude is None or up is None:
        return (DENIED,)
    vehicle, target = a.vehicle, Point(*a.home.local(command.latitude, command.longitude), up)
    if vehicle.mode is not FlightMode.GUIDED:
        if whole(command.p2) & mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE == 0:
            return (DENIED,)
        if not a.can_enter(FlightMode.GUIDED):
            return (FAILED,)
        vehicle.set_mode(FlightMode.GUIDED)
    if not a.fence.allows(target):
        return (FAILED,)
    vehicle.go_to(target)
    if command.p1 > 0:
        vehicle.speed = command.p1
    return (ACCEPTED,)


def _pause(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
    """Handle DO_PAUSE_CONTINUE in GUIDED (`ModeGuided::pause`): a target that arrives during a pause is kept.

    Pausing AUTO, which ArduCopter supports, is not simulated.
    """
    if a.vehicle.mode is not FlightMode.GUIDED:
        return (FAILED,)
    if whole(command.p1) == 0:
        a.vehicle.pause()
    elif whole(command.p1) == 1:
        a.vehicle.go_on()
    else:
        return (DENIED,)
    return (ACCEPTED,)


def _yaw(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
    """Handle CONDITION_YAW. Parameter 4: the angle is from north or from the heading, then parameter 3 is the sense."""
    vehicle = a.vehicle
    if vehicle.mode is not FlightMode.GUIDED:
        return (FAILED,)
    if isfinite(command.p1):
        relative = command.p4 == 1
        nose = radians(-command.p1 if relative and command.p3 < 0 else command.p1)
        vehicle.turn_to(nose + (vehicle.body.yaw if relative else 0.0))
    return (ACCEPTED,)


def _set_mode(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
    if whole(command.p1) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED == 0:
        return (DENIED,)
    return enter_number(a, whole(command.p2))


def enter_number(a: Autopilot, number: int) -> tuple[int, ...]:
    """Enter the mode with this `custom_mode`, or send a text with the reason; return the result."""
    mode = a.flavour.modes.mode(number)
    if mode is None:
        a.say(mavlink.MAV_SEVERITY_WARNING, f"No such mode {number}")
        return (FAILED,)
    if not a.can_enter(mode):
        a.say(mavlink.MAV_SEVERITY_WARNING, f"Mode change to {a.flavour.modes.name(mode)} failed: requires position")
        return (FAILED,)
    a.vehicle.set_mode(mode)
    return (ACCEPTED,)


def _mission_start(a: Autopilot, _: VehicleCommand) -> tuple[int, ...]:
    """Handle MISSION_START: enter AUTO and start the mission without arming. As recorded, the first item's text is sent
    twice.
    """
    if not a.can_enter(FlightMode.MISSION) or not a.mission.start():
        return (FAILED,)
    if a.vehicle.armed:
        a.mission.tell_current()
    a.vehicle.set_mode(FlightMode.MISSION)
    return (ACCEPTED,)


def _set_current(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
    return (ACCEPTED,) if a.mission.select(whole(command.p1)) else (FAILED,)


def _fence_enable(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
    """Handle DO_FENCE_ENABLE like setting FENCE_ENABLE."""
    if whole(command.p1) not in (0, 1):
        return (FAILED,)
    a.send(a.parameters.assign("FENCE_ENABLE", whole(command.p1)))
    a.fence.settings_changed()
    return (ACCEPTED,)


COMMANDS: Mapping[int, Handler] = shared(mode=FAILED, stream=DENIED, says_why=True, message=FAILED, needs_one=False) | {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: arm_disarm(FAILED, "Arm", "{} mode not armable", ""),
    mavlink.MAV_CMD_NAV_TAKEOFF: _takeoff,
    mavlink.MAV_CMD_DO_REPOSITION: _reposition,
    mavlink.MAV_CMD_DO_PAUSE_CONTINUE: _pause,
    mavlink.MAV_CMD_CONDITION_YAW: _yaw,
    mavlink.MAV_CMD_DO_SET_MODE: _set_mode,
    mavlink.MAV_CMD_MISSION_START: _mission_start,
    mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: _set_current,
    mavlink.MAV_CMD_DO_FENCE_ENABLE: _fence_enable,
    **PAYLOAD_COMMANDS,
}
