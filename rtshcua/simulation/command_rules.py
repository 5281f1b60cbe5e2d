"""Commands that both flavours obey alike, but for the results they refuse with."""

from math import isnan

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.simulation.autopilot import Autopilot, Handler
from rtshcua.simulation.command import Command, whole
from rtshcua.simulation.modes import Mode
from rtshcua.simulation.questions import AVAILABLE_MODES, available_modes

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
TEMPORARILY_REJECTED = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
DENIED = mavlink.MAV_RESULT_DENIED
UNSUPPORTED = mavlink.MAV_RESULT_UNSUPPORTED
FAILED = mavlink.MAV_RESULT_FAILED

FORCE = 21196
"""Parameter 2 of COMPONENT_ARM_DISARM that overrides every check."""


def request_message(refused: int, needs_one: bool) -> Handler:
    """MAV_CMD_REQUEST_MESSAGE; `refused` answers for a message that the vehicle does not have.

    `needs_one`: for one that it has nothing to tell in, too.
    """

    def handle(a: Autopilot, command: Command) -> tuple[int, ...]:
        if whole(command.p1) == AVAILABLE_MODES:
            return (ACCEPTED if available_modes(a, whole(command.p2)) else refused,)
        number = whole(command.p1)
        known = number in a.reports and number not in a.flavour.only_streamed
        message = a.reports.message(number) if known else None
        a.send(message)
        return (ACCEPTED if message is not None or (known and not needs_one) else refused,)

    return handle


def set_message_interval(refused: int, say_why: bool) -> Handler:
    """MAV_CMD_SET_MESSAGE_INTERVAL; `refused` answers for a stream that the vehicle does not have."""

    def handle(a: Autopilot, command: Command) -> tuple[int, ...]:
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


def request_version(a: Autopilot, _: Command) -> tuple[int, ...]:
    """MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES."""
    a.send(a.flavour.builders[mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION](a))
    return (ACCEPTED,)


def run_checks(a: Autopilot, _: Command) -> tuple[int, ...]:
    """MAV_CMD_RUN_PREARM_CHECKS: refused while armed; what stands against arming comes as texts."""
    if a.vehicle.armed:
        return (TEMPORARILY_REJECTED,)
    for reason in a.flavour.arming(a):
        a.say(mavlink.MAV_SEVERITY_CRITICAL, f"{a.flavour.check_text}: {reason}")
    return (ACCEPTED,)


def get_home(a: Autopilot, _: Command) -> tuple[int, ...]:
    """MAV_CMD_GET_HOME_POSITION."""
    a.send(a.flavour.builders[mavlink.MAVLINK_MSG_ID_HOME_POSITION](a))
    return (ACCEPTED,)


def change_speed(a: Autopilot, command: Command) -> tuple[int, ...]:
    """MAV_CMD_DO_CHANGE_SPEED of the ground speed."""
    if command.p2 > 0:
        a.vehicle.speed = command.p2
    return (ACCEPTED,)


def enter(mode: Mode, refused: int) -> Handler:
    """A command that changes the mode and nothing else; `refused` answers when the mode cannot be entered."""

    def handle(a: Autopilot, _: Command) -> tuple[int, ...]:
        if not a.can_enter(mode):
            a.say(mavlink.MAV_SEVERITY_WARNING, f"Mode change to {a.flavour.modes.name(mode)} failed: no position")
            return (refused,)
        a.vehicle.set_mode(mode)
        return (ACCEPTED,)

    return handle
