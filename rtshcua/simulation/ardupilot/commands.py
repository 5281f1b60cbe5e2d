"""ArduCopter's commands. Altitudes are relative to home unless the frame says otherwise; a refusal is FAILED."""

from collections.abc import Mapping
from math import isfinite, radians

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Message
from rtshcua.simulation.ardupilot.modes import MODES
from rtshcua.simulation.ardupilot.streams import GROUPS
from rtshcua.simulation.autopilot import Autopilot, Handler
from rtshcua.simulation.command import Command, whole
from rtshcua.simulation.command_rules import (
    ACCEPTED,
    DENIED,
    FAILED,
    FORCE,
    UNSUPPORTED,
    change_speed,
    enter,
    get_home,
    request_message,
    request_version,
    run_checks,
    set_message_interval,
)
from rtshcua.simulation.modes import Mode
from rtshcua.simulation.place import Point

_AMSL_FRAMES = {mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT}
_RELATIVE_FRAMES = {None, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT}
"""None is COMMAND_LONG, which has no frame: its altitudes are relative."""


def _up(a: Autopilot, frame: int | None, altitude: float) -> float | None:
    """Metres above home; None for a frame that this vehicle cannot follow (above terrain), or no number."""
    if not isfinite(altitude):
        return None
    if frame in _AMSL_FRAMES:
        return altitude - a.home.amsl_mm / 1000
    return altitude if frame in _RELATIVE_FRAMES else None


def _arm_disarm(a: Autopilot, command: Command) -> tuple[int, ...]:
    vehicle, forced = a.vehicle, whole(command.p2) == FORCE
    if whole(command.p1) == 1:
        if vehicle.armed or forced or (a.ready and vehicle.mode in MODES.armable):
            vehicle.arm()
            return (ACCEPTED,)
        for reason in a.flavour.arming(a) or (f"{MODES.name(vehicle.mode)} mode not armable",):
            a.say(mavlink.MAV_SEVERITY_CRITICAL, f"Arm: {reason}")
        return (FAILED,)
    if whole(command.p1) != 0:
        return (UNSUPPORTED,)
    if vehicle.in_air and not forced:
        return (FAILED,)
    vehicle.disarm()
    return (ACCEPTED,)


def _takeoff(a: Autopilot, command: Command) -> tuple[int, ...]:
    """Needs a relative frame, and to be armed, landed and in GUIDED; in LOITER it is accepted and does nothing."""
    if command.frame not in _RELATIVE_FRAMES:
        return (DENIED,)
    vehicle, up = a.vehicle, command.altitude
    if not vehicle.armed or vehicle.in_air or not isfinite(up) or up <= vehicle.body.up:
        return (FAILED,)
    if vehicle.mode is Mode.LOITER:
        return (ACCEPTED,)
    if vehicle.mode is not Mode.GUIDED:
        return (FAILED,)
    vehicle.takeoff_up = up
    vehicle.climb()
    return (ACCEPTED,)


def _reposition(a: Autopilot, command: Command) -> tuple[int, ...]:
    up = _up(a, command.frame, command.altitude)
    if command.latitude is None or command.longitude is None or up is None:
        return (DENIED,)
    vehicle, target = a.vehicle, Point(*a.home.local(command.latitude, command.longitude), up)
    if vehicle.mode is not Mode.GUIDED:
        if whole(command.p2) & mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE == 0:
            return (DENIED,)
        if not a.can_enter(Mode.GUIDED):
            return (FAILED,)
        vehicle.set_mode(Mode.GUIDED)
    if not a.fence.allows(target):
        return (FAILED,)
    vehicle.go_to(target)
    if command.p1 > 0:
        vehicle.speed = command.p1
    return (ACCEPTED,)


def _pause(a: Autopilot, command: Command) -> tuple[int, ...]:
    """DO_PAUSE_CONTINUE, in GUIDED (`ModeGuided::pause`): a target that comes while it stands is kept for later.

    AUTO, which the real one pauses too, is left out.
    """
    if a.vehicle.mode is not Mode.GUIDED:
        return (FAILED,)
    if whole(command.p1) == 0:
        a.vehicle.pause()
    elif whole(command.p1) == 1:
        a.vehicle.go_on()
    else:
        return (DENIED,)
    return (ACCEPTED,)


def _yaw(a: Autopilot, command: Command) -> tuple[int, ...]:
    """Parameter 4: whether the angle is from north, or from where the nose points; then parameter 3 says which way."""
    vehicle = a.vehicle
    if vehicle.mode is not Mode.GUIDED:
        return (FAILED,)
    if isfinite(command.p1):
        relative = command.p4 == 1
        nose = radians(-command.p1 if relative and command.p3 < 0 else command.p1)
        vehicle.turn_to(nose + (vehicle.body.yaw if relative else 0.0))
    return (ACCEPTED,)


def _set_mode(a: Autopilot, command: Command) -> tuple[int, ...]:
    if whole(command.p1) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED == 0:
        return (DENIED,)
    return _enter_number(a, whole(command.p2))


def _enter_number(a: Autopilot, number: int) -> tuple[int, ...]:
    mode = MODES.mode(number)
    if mode is None:
        a.say(mavlink.MAV_SEVERITY_WARNING, f"No such mode {number}")
        return (FAILED,)
    if not a.can_enter(mode):
        a.say(mavlink.MAV_SEVERITY_WARNING, f"Mode change to {MODES.name(mode)} failed: requires position")
        return (FAILED,)
    a.vehicle.set_mode(mode)
    return (ACCEPTED,)


def on_set_mode(a: Autopilot, number: int) -> tuple[int, ...]:
    """SET_MODE: acknowledged with the message's own number as the command."""
    return _enter_number(a, number)


def on_position_target(a: Autopilot, message: Message) -> None:
    """SET_POSITION_TARGET_GLOBAL_INT: flown to in GUIDED and in the air, ignored in silence else.

    Targets of velocity alone are ignored too: this vehicle does not fly them.
    """
    up = _up(a, message.coordinate_frame, message.alt)
    if a.vehicle.mode is Mode.GUIDED and up is not None and not message.type_mask & 0b111:
        target = Point(*a.home.local(message.lat_int, message.lon_int), up)
        if a.fence.allows(target):
            a.vehicle.go_to(target)


def on_data_stream(a: Autopilot, stream: int, rate_hz: int) -> None:
    """REQUEST_DATA_STREAM: sets every message of the group, whatever SET_MESSAGE_INTERVAL said before."""
    for number in GROUPS.get(stream, ()):
        a.streams.set(number, 1_000_000 // rate_hz if rate_hz > 0 else -1)


def _mission_start(a: Autopilot, _: Command) -> tuple[int, ...]:
    """Enters AUTO and lets the mission leave the ground; as recorded, its first item is told twice. It does not arm."""
    if not a.can_enter(Mode.MISSION) or not a.mission.start():
        return (FAILED,)
    if a.vehicle.armed:
        a.mission.tell_current()
    a.vehicle.set_mode(Mode.MISSION)
    return (ACCEPTED,)


def _set_current(a: Autopilot, command: Command) -> tuple[int, ...]:
    return (ACCEPTED,) if a.mission.select(whole(command.p1)) else (FAILED,)


def _fence_enable(a: Autopilot, command: Command) -> tuple[int, ...]:
    """DO_FENCE_ENABLE: the same as setting FENCE_ENABLE."""
    if whole(command.p1) not in (0, 1):
        return (FAILED,)
    a.send(a.parameters.assign("FENCE_ENABLE", whole(command.p1)))
    a.fence.settings_changed()
    return (ACCEPTED,)


COMMANDS: Mapping[int, Handler] = {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: _arm_disarm,
    mavlink.MAV_CMD_NAV_TAKEOFF: _takeoff,
    mavlink.MAV_CMD_NAV_LAND: enter(Mode.LAND, FAILED),
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: enter(Mode.RETURN, FAILED),
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: enter(Mode.LOITER, FAILED),
    mavlink.MAV_CMD_DO_REPOSITION: _reposition,
    mavlink.MAV_CMD_DO_CHANGE_SPEED: change_speed,
    mavlink.MAV_CMD_DO_PAUSE_CONTINUE: _pause,
    mavlink.MAV_CMD_CONDITION_YAW: _yaw,
    mavlink.MAV_CMD_DO_SET_MODE: _set_mode,
    mavlink.MAV_CMD_MISSION_START: _mission_start,
    mavlink.MAV_CMD_DO_SET_MISSION_CURRENT: _set_current,
    mavlink.MAV_CMD_DO_FENCE_ENABLE: _fence_enable,
    mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: set_message_interval(DENIED, say_why=True),
    mavlink.MAV_CMD_REQUEST_MESSAGE: request_message(FAILED, needs_one=False),
    mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: request_version,
    mavlink.MAV_CMD_GET_HOME_POSITION: get_home,
    mavlink.MAV_CMD_RUN_PREARM_CHECKS: run_checks,
}
