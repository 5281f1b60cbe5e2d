"""Which frames carry out a command: the same rules for every adapter, read next to what autopilots make of a frame.

A frame carries out a command if every field that the autopilot acts on has the value that the command gives it: the
number, each parameter, the frame of reference, the point, the height, the speed, the mode. Nothing is "about right" but
for what a 32-bit float rounds off, and for the height of home, which the autopilot's own estimate moves.
"""

from collections.abc import Mapping
from math import cos, hypot, isfinite, isnan, radians
from types import MappingProxyType
from typing import Any, Final

from rtshcua.mavlink import enums, layouts
from rtshcua.mavlink.layouts import COMMAND_INT, COMMAND_LONG, LAYOUTS, SET_POSITION_TARGET_GLOBAL_INT
from rtshcua.mavlink.modes import ARDUPILOT, PX4, CopterMode, Px4Mode
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.zone import meridian
from rtshcua.onboard.enforcement.frame_shape import Frame
from rtshcua.onboard.ports import Command

#: mm: how far home's height above sea may have moved between the frame that told it and the one that uses it; in the
#: recorded flight of PX4 it moves by 0.7 m
DATUM_MOVES: Final = 2_000
_ROUNDING: Final = 2  # mm, mm/s
#: m: how near to a point of its path the vehicle must have been seen before it is sent to the next; the adapters count
#: it as arrived within 2 m
NEAR: Final = 5.0
_METRES: Final = 0.011_131_9  # one 1e-7 degree of latitude

#: command, frame of reference (heights above mean sea level) and flags of a DO_REPOSITION
_REPOSITION: Final = (enums.MAV_CMD_DO_REPOSITION, enums.MAV_FRAME_GLOBAL, enums.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE)
_NOWHERE: Final = (enums.NO_PLACE, enums.NO_PLACE)

_places: Final = {
    COMMAND_INT: LAYOUTS[COMMAND_INT].getter("x y"),
    SET_POSITION_TARGET_GLOBAL_INT: LAYOUTS[SET_POSITION_TARGET_GLOBAL_INT].getter("lat_int lon_int"),
}
_armings: Final = {number: LAYOUTS[number].getter("command param2") for number in (COMMAND_LONG, COMMAND_INT)}

#: parameters 2 and 3 of DO_SET_MODE that a kind of motion is made with
_MODES: Final[Mapping[int, Mapping[int, tuple[int, int]]]] = MappingProxyType(
    {
        PX4: {
            MotionKind.CLIMB: Px4Mode.HOLD.parameters,  # it is armed in Hold
            MotionKind.HOME: Px4Mode.RETURN.parameters,
            MotionKind.LAND: Px4Mode.LAND.parameters,
        },
        ARDUPILOT: {
            MotionKind.CLIMB: CopterMode.GUIDED.parameters,
            MotionKind.FLY: CopterMode.GUIDED.parameters,
            MotionKind.COVER: CopterMode.GUIDED.parameters,
            MotionKind.HOLD: CopterMode.BRAKE.parameters,
            MotionKind.HOME: CopterMode.RTL.parameters,
            MotionKind.LAND: CopterMode.LAND.parameters,
        },
    }
)
_TRAVELS: Final = (MotionKind.FLY, MotionKind.COVER)


def is_forced_arming(frame: Frame) -> bool:
    """Whether it would arm or disarm past the autopilot's own checks: parameter 2 of COMPONENT_ARM_DISARM is 21196.

    Any value but 0 counts, for what an autopilot makes of another one is its own affair.
    """
    number, force = _armings[frame.message](frame.fields) if frame.message in _armings else (0, 0)
    return bool(number == enums.MAV_CMD_COMPONENT_ARM_DISARM and force != 0)


def carries_out(frame: Frame, command: Command, autopilot: int, home_amsl: int | None) -> bool:
    """Whether an autopilot that obeys the frame does what the command says, or a part of it.

    `home_amsl` is how high home lies above mean sea level in mm, None where that is not known.
    """
    match frame.message:
        case layouts.COMMAND_LONG:
            return _long(frame.fields, command, autopilot, home_amsl)
        case layouts.COMMAND_INT if autopilot == PX4 and command.kind == MotionKind.HOLD:
            return _stop(frame.fields)
        case layouts.COMMAND_INT:
            return autopilot == PX4 and _reposition(frame.fields, command, home_amsl)
        case layouts.SET_POSITION_TARGET_GLOBAL_INT:
            return autopilot == ARDUPILOT and _position_target(frame.fields, command)
    return False


def point_of(frame: Frame) -> tuple[int, int] | None:
    """Where a frame that carries out a command sends the vehicle, in 1e-7 degree; None if it leaves it where it is."""
    place = _places.get(frame.message)
    point: tuple[int, int] | None = None if place is None else place(frame.fields)
    return None if point == _NOWHERE else point


def is_near(here: tuple[int, int] | None, point: tuple[int, int]) -> bool:
    """Whether a place that was reported is so near to a point of a path that the next leg may begin; 1e-7 degree."""
    if here is None:
        return False
    latitude, longitude = point
    east = (meridian(here[1], longitude) - longitude) * cos(radians(latitude / 1e7))
    return hypot(here[0] - latitude, east) * _METRES <= NEAR


def _long(fields: tuple[Any, ...], command: Command, autopilot: int, home_amsl: int | None) -> bool:
    one, two, three, four, five, six, seven, number = layouts.of_command_long(fields)
    match number:
        case enums.MAV_CMD_DO_SET_MODE:
            mode = _MODES[autopilot].get(command.kind)
            return (
                (two, three) == mode
                and one == enums.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
                and _zero(four, five, six, seven)
            )
        case enums.MAV_CMD_COMPONENT_ARM_DISARM:
            return command.kind == MotionKind.CLIMB and one == 1 and _zero(two, three, four, five, six, seven)
        case enums.MAV_CMD_NAV_TAKEOFF if command.kind == MotionKind.CLIMB:
            if autopilot == PX4:  # it climbs at a finite place, turned to a finite heading, to metres above sea
                here = isnan(four) and isnan(five) and isnan(six)
                pitch = isnan(one) or one == 0  # nothing to a multirotor
                return here and pitch and _zero(two, three) and _is_above_sea(seven, command, home_amsl)
            return _zero(one, two, three, four, five, six) and _is(seven, command.altitude)
        case enums.MAV_CMD_DO_CHANGE_SPEED if command.kind in _TRAVELS:
            ground_speed = one == enums.SPEED_TYPE_GROUNDSPEED and three == -1  # throttle as it is
            return ground_speed and _is_speed(two, command) and _zero(four, five, six, seven)
    return False


def _reposition(fields: tuple[Any, ...], command: Command, home_amsl: int | None) -> bool:
    """DO_REPOSITION: a circle's radius, or a heading of its own, would be another manoeuvre."""
    speed, flags, radius, yaw, x, y, z, number, reference = layouts.of_command_int(fields)
    return (
        (number, reference, flags) == _REPOSITION
        and command.kind in _TRAVELS
        and radius == 0
        and isnan(yaw)
        and (_is_speed(speed, command) if command.speed else speed == -1)
        and _is_point(x, y, command)
        and _is_above_sea(z, command, home_amsl)
    )


def _stop(fields: tuple[Any, ...]) -> bool:
    """DO_REPOSITION to no place, height or heading: PX4 brakes, and stays where it comes to stand.

    A finite one of them would make PX4 keep the target that it flies to.
    """
    speed, flags, radius, yaw, x, y, z, number, reference = layouts.of_command_int(fields)
    return (
        (number, reference, flags) == _REPOSITION
        and (speed, radius) == (-1, 0)
        and (x, y) == _NOWHERE
        and isnan(yaw)
        and isnan(z)
    )


def _position_target(fields: tuple[Any, ...], command: Command) -> bool:
    """SET_POSITION_TARGET_GLOBAL_INT; what the mask tells the autopilot to ignore may be anything."""
    x, y, z, mask, reference = layouts.of_position_target(fields)
    return (
        (mask, reference) == (enums.POSITION_ONLY, enums.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
        and command.kind in _TRAVELS
        and _is_point(x, y, command)
        and _is(z, command.altitude)
    )


def _is_point(x: int, y: int, command: Command) -> bool:
    """A point of the command's path, in 1e-7 degree."""
    return (x, y) in zip(command.geo[::2], command.geo[1::2], strict=True)


def _is_speed(metres_per_second: float, command: Command) -> bool:
    return command.speed > 0 and _is(metres_per_second, command.speed)


def _is_above_sea(metres: float, command: Command, home_amsl: int | None) -> bool:
    return home_amsl is not None and _is(metres, home_amsl + command.altitude, DATUM_MOVES)


def _is(metres: float, millimetres: int, within: int = _ROUNDING) -> bool:
    return isfinite(metres) and abs(round(metres * 1_000) - millimetres) <= within


def _zero(*parameters: float) -> bool:
    return not any(parameters)
