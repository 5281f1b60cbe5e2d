"""PX4's commands. Altitudes are above sea level in any frame; an ACK confirms the mode, not the effect."""

from collections.abc import Mapping
from math import isfinite

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.mavlink.modes import Px4Mode
from rtshcua.model.faults import FlightMode
from rtshcua.simulation.autopilot import Autopilot, Handler
from rtshcua.simulation.command import VehicleCommand, whole
from rtshcua.simulation.commands import (
    ACCEPTED,
    DENIED,
    FAILED,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
    arm_disarm,
    shared,
)
from rtshcua.simulation.place import Point

_STREAM_US = 500_000
"""OFFBOARD can be entered only while position targets arrive faster than this (2 Hz)."""
_AUTO, _ = Px4Mode.HOLD.parameters
_ORBIT_M = 10.0
"""The default radius of an orbit."""
_ANSWERS_BY_MODE = 1, 18
"""The first release that answers a DO_REPOSITION without its flag according to its effect."""
_KEPT_US = 500_000
"""How long its target is kept for entering Hold (`Loiter::on_activation`)."""


def _takeoff(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
    """Handle NAV_TAKEOFF. While disarmed, arming then starts the climb. The place is ignored: it climbs straight up."""
    if not a.can_enter(FlightMode.TAKEOFF):
        return (TEMPORARILY_REJECTED,)
    vehicle = a.vehicle
    up = command.altitude - a.home.amsl_mm / 1000
    vehicle.takeoff_up = up if isfinite(up) else vehicle.body.up + vehicle.handling.takeoff_up
    if vehicle.in_air and vehicle.takeoff_up <= vehicle.body.up:
        a.say(mavlink.MAV_SEVERITY_WARNING, "Already higher than takeoff altitude")
        vehicle.set_mode(FlightMode.LOITER)
    elif vehicle.mode is FlightMode.TAKEOFF:
        vehicle.climb()  # already taking off: climb to the new height
    else:
        vehicle.set_mode(FlightMode.TAKEOFF)
    return (ACCEPTED,)


def _target(a: Autopilot, command: VehicleCommand) -> Point:
    """Return the commanded place and height; the vehicle's own where the command has none."""
    here, up = a.here, command.altitude - a.home.amsl_mm / 1000
    north, east = here.north, here.east
    if command.latitude is not None and command.longitude is not None:
        north, east = a.home.local(command.latitude, command.longitude)
    return Point(north, east, up if isfinite(up) else here.up)


def _reposition(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
    """Handle DO_REPOSITION as `Navigator::run` and `Commander::handle_command` of v1.16. The ACK is for the mode only.

    Without the flag that changes the mode the commander answers "unsupported", but the navigator keeps the target for
    half a second, and Hold flies to it (`Loiter::on_active`; recorded: answer 3, then target and motion follow). From
    1.18 on the answer matches the effect (PX4-Autopilot pull request 27563).
    """
    vehicle, changes = a.vehicle, bool(whole(command.p2) & mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE)
    if not changes and vehicle.mode is not FlightMode.LOITER:
        if vehicle.armed and a.release < _ANSWERS_BY_MODE:
            a.kept = a.now_us + a.since_us + _KEPT_US, command
        return (UNSUPPORTED if a.release < _ANSWERS_BY_MODE else TEMPORARILY_REJECTED,)
    if not a.can_enter(FlightMode.LOITER):
        return (TEMPORARILY_REJECTED,)
    kept, taking_off = vehicle.destination, vehicle.mode is FlightMode.TAKEOFF
    vehicle.set_mode(FlightMode.LOITER)
    result = (ACCEPTED if changes or a.release >= _ANSWERS_BY_MODE else UNSUPPORTED,)
    if not vehicle.in_air:
        a.say(mavlink.MAV_SEVERITY_WARNING, "Reposition ignored: not flying")
        return result
    _fly(a, command, kept, taking_off=taking_off)
    return result


def fly_kept(a: Autopilot) -> None:
    """On entering Hold, fly to the kept target of a DO_REPOSITION, if it is recent enough."""
    kept, a.kept = a.kept, None
    if kept is not None and a.vehicle.mode is FlightMode.LOITER and a.now_us + a.since_us < kept[0]:
        _fly(a, kept[1], a.vehicle.destination, taking_off=False)


def _fly(a: Autopilot, command: VehicleCommand, kept: Point | None, *, taking_off: bool) -> None:
    """Fly to the commanded target. Without a place, keep the current target (`kept`) at the commanded height; without
    place, height and heading, stop ("pause").
    """
    vehicle = a.vehicle
    target = _target(a, command)  # without a place, the vehicle's own place is checked against the fence
    placed, raised = None not in (command.latitude, command.longitude), isfinite(command.altitude)
    if not a.fence.allows(target):
        a.say(mavlink.MAV_SEVERITY_CRITICAL, "Reposition is outside geofence\t")
        return
    if command.p1 > 0:
        vehicle.speed = command.p1
    if not placed and not raised and not isfinite(command.p4):
        if taking_off:  # returns to the place of the command, without a braking distance
            vehicle.go_to(target)
        else:
            vehicle.hold()
        return
    if not placed and kept is not None:
        target = Point(kept.north, kept.east, target.up)
    vehicle.go_to(target)
    if isfinite(command.p4):
        vehicle.turn_to(command.p4)


def _change_altitude(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
    """Handle DO_CHANGE_ALTITUDE: stop on the way and climb there, as recorded."""
    up = command.p1 - a.home.amsl_mm / 1000
    if not isfinite(up) or not a.can_enter(FlightMode.LOITER):
        return (TEMPORARILY_REJECTED,)
    a.vehicle.set_mode(FlightMode.LOITER)
    a.vehicle.hold(up)
    return (ACCEPTED,)


def _orbit(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
    """Handle DO_ORBIT around the commanded place or the vehicle. As recorded, the fence is not checked."""
    vehicle = a.vehicle
    if not a.can_enter(FlightMode.ORBIT) or not vehicle.in_air:
        return (TEMPORARILY_REJECTED,)
    vehicle.set_mode(FlightMode.ORBIT)
    if command.p2 > 0:
        vehicle.speed = command.p2
    vehicle.circle(_target(a, command), command.p1 if isfinite(command.p1) and command.p1 else _ORBIT_M)
    return (ACCEPTED,)


def _set_mode(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
    """Handle DO_SET_MODE. The first ACK is for the message, the second for the mode; an unknown mode gets 0, 0."""
    main, sub = whole(command.p2), whole(command.p3)
    if main not in {number >> 16 & 0xFF for number in a.flavour.modes.numbers.values()}:
        return (ACCEPTED, ACCEPTED)
    number = main << 16 | (sub & 0xFF if main == _AUTO else 0) << 24
    return (ACCEPTED, ACCEPTED if enter_number(a, number) else TEMPORARILY_REJECTED)


def enter_number(a: Autopilot, number: int) -> bool:
    """Enter the mode with this `custom_mode`; return False if it cannot be entered."""
    mode = a.flavour.modes.mode(number)
    if mode is None or not a.can_enter(mode):
        return False
    if mode is FlightMode.GUIDED and (a.last_target_us is None or a.now_us - a.last_target_us > _STREAM_US):
        a.say(mavlink.MAV_SEVERITY_WARNING, "Offboard denied: no offboard signal")
        return False
    vehicle = a.vehicle
    if mode is FlightMode.TAKEOFF and vehicle.takeoff_up is None:
        vehicle.takeoff_up = vehicle.body.up + vehicle.handling.takeoff_up
    vehicle.set_mode(mode)
    return True


def _mission_start(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
    """Handle MISSION_START, which also arms. Denied, without a text, until the mission has passed its check."""
    if not a.mission.start(whole(command.p1) if command.p1 > 0 else None):
        return (DENIED,)
    if not a.can_enter(FlightMode.MISSION) or not (a.vehicle.armed or a.ready):
        return (TEMPORARILY_REJECTED,)
    a.vehicle.set_mode(FlightMode.MISSION)
    a.vehicle.arm()
    return (ACCEPTED,)


def _silent(_: Autopilot, __: VehicleCommand) -> tuple[int, ...]:
    """Do not answer: the command is for a camera or a gimbal (recorded)."""
    return ()


def _accept(_: Autopilot, __: VehicleCommand) -> tuple[int, ...]:
    """Accept without effect: a region of interest does not turn the vehicle, and nothing is connected (recorded)."""
    return (ACCEPTED,)


def _grip(a: Autopilot, _: VehicleCommand) -> tuple[int, ...]:
    """Handle DO_GRIPPER, which is acknowledged without any gripper (recorded)."""
    return (ACCEPTED,) if a.vehicle.in_air else (mavlink.MAV_RESULT_IN_PROGRESS, ACCEPTED)


_PAYLOAD: Mapping[int, Handler] = {
    **dict.fromkeys(
        (
            mavlink.MAV_CMD_REQUEST_CAMERA_INFORMATION, mavlink.MAV_CMD_SET_CAMERA_MODE,
            mavlink.MAV_CMD_SET_CAMERA_ZOOM, mavlink.MAV_CMD_DO_DIGICAM_CONTROL, mavlink.MAV_CMD_DO_TRIGGER_CONTROL,
            mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST, mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE,
            mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, mavlink.MAV_CMD_DO_MOUNT_CONTROL,
            mavlink.MAV_CMD_DO_MOUNT_CONFIGURE, mavlink.MAV_CMD_DO_WINCH,
        ),
        _silent,
    ),
    **dict.fromkeys(
        (
            mavlink.MAV_CMD_DO_SET_ROI_LOCATION, mavlink.MAV_CMD_DO_SET_ROI, mavlink.MAV_CMD_DO_SET_ROI_NONE,
            mavlink.MAV_CMD_DO_SET_ACTUATOR,
        ),
        _accept,
    ),
    mavlink.MAV_CMD_DO_GRIPPER: _grip,
}  # fmt: skip
"""Commands for payloads, as recorded; those that are missing here are unsupported. A camera and a gimbal are
components of their own (`simulation.payload_components`), and change nothing of these answers.
"""
_SHARED = shared(mode=TEMPORARILY_REJECTED, stream=FAILED, says_why=False, message=DENIED, needs_one=True)
COMMANDS: Mapping[int, Handler] = _SHARED | {
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM: arm_disarm(
        TEMPORARILY_REJECTED, "Arming denied", "mode {}", "Disarming denied: not landed"
    ),
    mavlink.MAV_CMD_NAV_TAKEOFF: _takeoff,
    mavlink.MAV_CMD_DO_REPOSITION: _reposition,
    mavlink.MAV_CMD_DO_CHANGE_ALTITUDE: _change_altitude,
    mavlink.MAV_CMD_DO_ORBIT: _orbit,
    mavlink.MAV_CMD_DO_SET_MODE: _set_mode,
    mavlink.MAV_CMD_MISSION_START: _mission_start,
    **_PAYLOAD,
}
