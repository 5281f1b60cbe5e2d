"""Commands that both flavours handle alike, apart from the result codes and texts of a refusal."""

from math import isnan

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.model.faults import FlightMode
from rtshcua.simulation.autopilot import Autopilot, Handler
from rtshcua.simulation.command import VehicleCommand, whole
from rtshcua.simulation.telemetry import AVAILABLE_MODES, available_modes

ACCEPTED: int = mavlink.MAV_RESULT_ACCEPTED
TEMPORARILY_REJECTED: int = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
DENIED: int = mavlink.MAV_RESULT_DENIED
UNSUPPORTED: int = mavlink.MAV_RESULT_UNSUPPORTED
FAILED: int = mavlink.MAV_RESULT_FAILED

FORCE = 21196
"""Parameter 2 of COMPONENT_ARM_DISARM that overrides every check."""


def _request_message(refused: int, needs_one: bool) -> Handler:
    """Handle MAV_CMD_REQUEST_MESSAGE; `refused` is the result for an unknown message.

    `needs_one`: also refuse a message that has no content now.
    """

    def handle(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
        if whole(command.p1) == AVAILABLE_MODES:
            return (ACCEPTED if available_modes(a, whole(command.p2)) else refused,)
        number = whole(command.p1)
        known = number in a.reports and number not in a.flavour.only_streamed
        message = a.reports.message(number) if known else None
        a.send(message)
        return (ACCEPTED if message is not None or (known and not needs_one) else refused,)

    return handle


def _set_message_interval(refused: int, say_why: bool) -> Handler:
    """Handle MAV_CMD_SET_MESSAGE_INTERVAL; `refused` is the result for an unknown stream."""

    def handle(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
        number = whole(command.p1)
        if number not in a.flavour.builders or number in a.flavour.constant or isnan(command.p2):
            if say_why:
                a.say(mavlink.MAV_SEVERITY_INFO, f"No ap_message for mavlink id ({number})")
            return (refused,)
        interval_us = whole(command.p2)
        if interval_us > 0:
            interval_us = max(interval_us, a.flavour.least_us.get(number, 0))
        a.streams.set(number, interval_us)
        return (ACCEPTED,)

    return handle


def _request_version(a: Autopilot, _: VehicleCommand) -> tuple[int, ...]:
    """Handle MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES."""
    a.send(a.flavour.builders[mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION](a))
    return (ACCEPTED,)


def _run_checks(a: Autopilot, _: VehicleCommand) -> tuple[int, ...]:
    """Handle MAV_CMD_RUN_PREARM_CHECKS: refused while armed; failed checks are sent as texts."""
    if a.vehicle.armed:
        return (TEMPORARILY_REJECTED,)
    for reason in a.flavour.arming(a):
        a.say(mavlink.MAV_SEVERITY_CRITICAL, f"{a.flavour.check_text}: {reason}")
    return (ACCEPTED,)


def _get_home(a: Autopilot, _: VehicleCommand) -> tuple[int, ...]:
    """Handle MAV_CMD_GET_HOME_POSITION."""
    a.send(a.flavour.builders[mavlink.MAVLINK_MSG_ID_HOME_POSITION](a))
    return (ACCEPTED,)


def _change_speed(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
    """Handle MAV_CMD_DO_CHANGE_SPEED for the ground speed."""
    if command.p2 > 0:
        a.vehicle.speed = command.p2
    return (ACCEPTED,)


def _enter(mode: FlightMode, refused: int) -> Handler:
    """Handle a command that only changes the mode; `refused` is the result if the mode cannot be entered."""

    def handle(a: Autopilot, _: VehicleCommand) -> tuple[int, ...]:
        if not a.can_enter(mode):
            a.say(mavlink.MAV_SEVERITY_WARNING, f"Mode change to {a.flavour.modes.name(mode)} failed: no position")
            return (refused,)
        a.vehicle.set_mode(mode)
        return (ACCEPTED,)

    return handle


def arm_disarm(refused: int, arming: str, mode: str, landing: str) -> Handler:
    """Handle MAV_CMD_COMPONENT_ARM_DISARM.

    `arming` is the prefix of refusal texts, `mode` the text for a mode that cannot be armed in, `landing` the text for
    a refused disarm in the air (no text if empty).
    """

    def handle(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
        vehicle, forced, modes = a.vehicle, whole(command.p2) == FORCE, a.flavour.modes
        if whole(command.p1) == 1:
            if vehicle.armed or forced or (a.ready and vehicle.mode in modes.armable):
                vehicle.arm()
                return (ACCEPTED,)
            for reason in a.flavour.arming(a) or (mode.format(modes.name(vehicle.mode)),):
                a.say(mavlink.MAV_SEVERITY_CRITICAL, f"{arming}: {reason}")
            return (refused,)
        if whole(command.p1) != 0:
            return (UNSUPPORTED,)
        if vehicle.in_air and not forced:
            if landing:
                a.say(mavlink.MAV_SEVERITY_CRITICAL, landing)
            return (refused,)
        vehicle.disarm()
        return (ACCEPTED,)

    return handle


def shared(*, mode: int, stream: int, says_why: bool, message: int, needs_one: bool) -> dict[int, Handler]:
    """Return the shared handlers by command. `mode`, `stream` and `message` are the results for an unknown one.

    `says_why`: send a text that names the stream; `needs_one`: also refuse a message that has no content now.
    """
    return {
        mavlink.MAV_CMD_NAV_LAND: _enter(FlightMode.LAND, mode),
        mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: _enter(FlightMode.RETURN, mode),
        mavlink.MAV_CMD_NAV_LOITER_UNLIM: _enter(FlightMode.LOITER, mode),
        mavlink.MAV_CMD_DO_CHANGE_SPEED: _change_speed,
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: _set_message_interval(stream, says_why),
        mavlink.MAV_CMD_REQUEST_MESSAGE: _request_message(message, needs_one),
        mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: _request_version,
        mavlink.MAV_CMD_GET_HOME_POSITION: _get_home,
        mavlink.MAV_CMD_RUN_PREARM_CHECKS: _run_checks,
    }
