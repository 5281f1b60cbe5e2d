"""Whether a frame is part of flying a command of the bundle: a table of the auditor's own, by autopilot and motion.

| motion | PX4 | ArduCopter |
|---|---|---|
| climb | mode Hold, arm, take off to the height above sea | mode GUIDED, arm, take off to the height above home |
| fly, cover | reposition to a point of the path, at its height | mode GUIDED, speed, position target on the path |
| hold | reposition to no place, height or heading, which stops it | mode BRAKE |
| home | mode Return | mode RTL |
| land | mode Land | mode LAND |

Heights above sea are judged by what the vehicle reported of its home.
"""

from math import isfinite, isnan
from typing import Any, Final, NamedTuple

from rtshcua.ground.audit.sent import Frame
from rtshcua.mavlink import enums, layouts
from rtshcua.mavlink.layouts import COMMAND_INT, COMMAND_LONG, SET_POSITION_TARGET_GLOBAL_INT
from rtshcua.mavlink.modes import ARDUPILOT, PX4, CopterMode, Px4Mode
from rtshcua.model.flat.contract import PLACE, Contract, Link, MotionKind
from rtshcua.model.flat.mission import Invocation
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import unproject

_TRAVELS: Final = frozenset({MotionKind.FLY, MotionKind.COVER})
#: the modes (as parameters 2 and 3 of DO_SET_MODE) that an autopilot is put in, and for which motions
_MODES: Final = {
    (PX4, *Px4Mode.HOLD.parameters): frozenset({MotionKind.CLIMB}),
    (PX4, *Px4Mode.RETURN.parameters): frozenset({MotionKind.HOME}),
    (PX4, *Px4Mode.LAND.parameters): frozenset({MotionKind.LAND}),
    (ARDUPILOT, *CopterMode.GUIDED.parameters): frozenset({MotionKind.CLIMB}) | _TRAVELS,
    (ARDUPILOT, *CopterMode.BRAKE.parameters): frozenset({MotionKind.HOLD}),
    (ARDUPILOT, *CopterMode.RTL.parameters): frozenset({MotionKind.HOME}),
    (ARDUPILOT, *CopterMode.LAND.parameters): frozenset({MotionKind.LAND}),
}
_ROUNDING: Final = 2  # mm, mm/s: what a 32-bit float loses
_DATUM: Final = 2_000  # mm: by how much home's height above sea may have moved since it was last reported
#: a DO_REPOSITION: its number, heights above the sea; and its flags: to Hold, or where it is in Hold
_REPOSITION: Final = (enums.MAV_CMD_DO_REPOSITION, enums.MAV_FRAME_GLOBAL)
_FLAGS: Final = (enums.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE, 0)


class Target(NamedTuple):
    """What a step or link of the bundle has the vehicle do.

    `points` in 1e-7 degree; `altitude` in mm above home, `speed` in mm/s, 0 where it is the vehicle's own.
    """

    kind: int
    points: frozenset[tuple[int, int]]
    altitude: int
    speed: int


class Home(NamedTuple):
    """The lowest and the highest height above sea that home was reported at, in mm."""

    low: int
    high: int


def of_step(invocation: Invocation, policy: Policy) -> Target:
    """What a step does."""
    plan = invocation.plan
    return Target(plan.kind, _points(plan.path, policy), plan.altitude, plan.speed)


def of_link(link: Link, policy: Policy) -> Target:
    """What a link of a chain, or the target of a degrade rule, does."""
    contract = policy.contracts[link.skill]
    motion = contract.motion
    altitude, speed = (link.arguments[cell] if cell >= 0 else 0 for cell in (motion.altitude, motion.speed))
    path = _place(contract, link) if motion.kind == MotionKind.FLY else ()
    return Target(motion.kind, _points(path, policy), altitude, speed)


def obeyed(frame: Frame, target: Target, autopilot: int, home: Home | None) -> bool:
    """Whether an autopilot that obeys the frame does what the target is, or a part of it."""
    fields = frame.fields
    if not fields:
        return False
    if frame.message == COMMAND_LONG:
        return _command(fields, target, autopilot, home)
    if frame.message == COMMAND_INT and autopilot == PX4 and target.kind == MotionKind.HOLD:
        speed, flags, radius, yaw, x, y, z, number, reference = layouts.of_command_int(fields)
        nowhere = x == y == enums.NO_PLACE and isnan(z) and isnan(yaw)
        return nowhere and (number, reference, radius, speed) == (*_REPOSITION, 0, -1) and flags in _FLAGS
    if target.kind not in _TRAVELS:
        return False
    if frame.message == COMMAND_INT and autopilot == PX4:
        speed, flags, radius, yaw, x, y, z, number, reference = layouts.of_command_int(fields)
        asked = _near(speed, target.speed) if target.speed else speed == -1
        plain = radius == 0 and isnan(yaw)  # without a circle or a heading of its own
        there = (number, reference) == _REPOSITION and flags in _FLAGS and (x, y) in target.points
        return there and asked and plain and _above_sea(z, target, home)
    if frame.message == SET_POSITION_TARGET_GLOBAL_INT and autopilot == ARDUPILOT:
        x, y, z, mask, reference = layouts.of_position_target(fields)
        alone = mask == enums.POSITION_ONLY and reference == enums.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
        return alone and (x, y) in target.points and _near(z, target.altitude)
    return False


def _command(fields: tuple[Any, ...], target: Target, autopilot: int, home: Home | None) -> bool:
    *parameters, number = layouts.of_command_long(fields)
    one, two, three, four, five, six, seven = parameters
    if number == enums.MAV_CMD_DO_SET_MODE:
        custom = one == enums.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        return custom and target.kind in _MODES.get((autopilot, two, three), ()) and not any(parameters[3:])
    if number == enums.MAV_CMD_COMPONENT_ARM_DISARM:  # to arm, and not by force
        return target.kind == MotionKind.CLIMB and one == 1 and not any(parameters[1:])
    if number == enums.MAV_CMD_NAV_TAKEOFF:
        if target.kind != MotionKind.CLIMB:
            return False
        if autopilot == PX4:  # where it is, turned as it is
            here = (isnan(one) or not one) and not two and not three and all(map(isnan, (four, five, six)))
            return here and _above_sea(seven, target, home)
        return not any(parameters[:6]) and _near(seven, target.altitude)
    if number == enums.MAV_CMD_DO_CHANGE_SPEED:  # over ground, the throttle as it is
        asked = target.kind in _TRAVELS and target.speed > 0 and _near(two, target.speed)
        return asked and one == enums.SPEED_TYPE_GROUNDSPEED and three == -1 and not any(parameters[3:])
    return False


def _above_sea(metres: float, target: Target, home: Home | None) -> bool:
    if home is None or not isfinite(metres):
        return False
    above_home = round(metres * 1_000) - target.altitude
    return home.low - _DATUM <= above_home <= home.high + _DATUM


def _near(metres: float, millimetres: int) -> bool:
    return isfinite(metres) and abs(round(metres * 1_000) - millimetres) <= _ROUNDING


def _place(contract: Contract, link: Link) -> tuple[int, ...]:
    cell = next(parameter.cell for parameter in contract.parameters if parameter.kind == PLACE)
    return link.arguments[cell : cell + 2]


def _points(path: tuple[int, ...], policy: Policy) -> frozenset[tuple[int, int]]:
    """Points that are local, in mm, as they are sent."""
    local = zip(path[::2], path[1::2], strict=True)
    return frozenset(unproject(policy.projection, x, y) for x, y in local)
