"""The allow-list of frames: which ones may leave without a permit, and which carry out the command that is permitted.

Housekeeping moves nothing. Questions, telemetry rates, texts and our own heartbeat pass always. A geofence may be
handed over before the flight, never during it; so are the two parameters that switch ArduCopter's fence on, and nothing
but on. What is not here is not housekeeping: no mission is uploaded, no signing key set, no file opened, no manual
control given. Another parameter is set only as a preparation lists it (`written`, `frames.py`).

A frame carries out a command if every field that the autopilot acts on has the value that the command gives it: the
number, each parameter, the frame of reference, the point, the height, the speed, the mode. Nothing is "about right" but
for what a 32-bit float rounds off, and for the height of home, which the autopilot's own estimate moves. The rules are
the same for every adapter, read next to what autopilots make of a frame.
"""

from collections.abc import Callable, Mapping
from math import isfinite, isnan
from typing import Any, Final, NamedTuple

from rtshcua.mavlink import enums, layouts
from rtshcua.mavlink.framing import CHECKSUM, HEAD, HEADER, MARKER
from rtshcua.mavlink.layouts import COMMAND_INT, COMMAND_LONG, HEARTBEAT, LAYOUTS, SET_POSITION_TARGET_GLOBAL_INT
from rtshcua.mavlink.modes import ARDUPILOT, PX4, CopterMode, Px4Mode
from rtshcua.mavlink.parameters import bits_of, decode
from rtshcua.model.flat.contract import MotionKind
from rtshcua.model.flat.zone import SHIFT, meridian
from rtshcua.onboard.ports import Command

_Fields = tuple[Any, ...]


class Frame(NamedTuple):
    """One whole frame. `fields` are in the order of the wire; `target` is (system, component) where it has one."""

    system: int
    component: int
    message: int
    fields: _Fields
    target: tuple[int, int] | None


_TARGETS = {number: layout.at("target_system") for number, layout in LAYOUTS.items()}


def read_frame(octets: bytes) -> Frame | None:
    """The frame that these octets are; None unless they are one whole unsigned frame of a message in `LAYOUTS`.

    The boundary reads frames itself: it shares no parser with the adapters that it checks. The checksum is the
    receiver's to check: a frame whose checksum is wrong moves nothing.
    """
    if len(octets) < HEADER or octets[0] != MARKER:
        return None
    _, length, incompatible, compatible, _, system, component, low, high = HEAD.unpack_from(octets)
    message = low | high << 16
    layout = LAYOUTS.get(message)
    if layout is None or incompatible or compatible or len(octets) != HEADER + length + CHECKSUM:
        return None
    if length > layout.fields.size:
        return None
    fields, target = layout.read(octets), _TARGETS[message]
    return Frame(system, component, message, fields, None if target < 0 else fields[target : target + 2])


# ---------------------------------------------------------------- housekeeping

_OWN_HEARTBEAT: Final = (enums.MAV_TYPE_ONBOARD_CONTROLLER, enums.MAV_AUTOPILOT_INVALID, 0)
_AREAS: Final = 4  # a bit of FENCE_TYPE
_FENCE_ITEMS: Final = range(enums.MAV_CMD_NAV_FENCE_RETURN_POINT, enums.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION + 1)

_identity: Final = LAYOUTS[layouts.HEARTBEAT].getter("type autopilot base_mode")
_command_number: Final = LAYOUTS[COMMAND_LONG].getter("command")
_parameters: Final = LAYOUTS[COMMAND_LONG].getter("param1 param2 param3 param4 param5 param6 param7")
_setting: Final = LAYOUTS[layouts.PARAM_SET].getter("param_id param_value param_type")
_told: Final = LAYOUTS[layouts.PARAM_VALUE].getter("param_id param_value param_type")
_item: Final = LAYOUTS[layouts.MISSION_ITEM_INT].getter("command current mission_type")


def is_housekeeping(frame: Frame) -> bool:
    """Whether the frame moves nothing, and may leave at any time."""
    rule = _AT_ANY_TIME.get(frame.message)
    return rule is not None and rule(frame.fields)


#: the system id of a ground station, by custom and by `SYSID_MYGCS` as ArduPilot comes
_GROUND_STATION: Final = 255


def is_greeting(frame: Frame) -> bool:
    """Whether the frame is our heartbeat, or asks for one, under an id that no ground station has: it may leave before
    any came.
    """
    if frame.system == _GROUND_STATION:
        return False
    if frame.message == COMMAND_LONG:
        asks = _command_number(frame.fields) == enums.MAV_CMD_REQUEST_MESSAGE
        return asks and not any(_parameters(frame.fields))  # the number of HEARTBEAT is 0
    return frame.message == HEARTBEAT and _is_own(frame.fields)


def is_of_fence(frame: Frame, types: float | None) -> bool:
    """Whether the frame is part of handing over a fence: it moves nothing, and may leave before the flight.

    `types` is the FENCE_TYPE that was heard last, None before: it is set to the same with the areas, not without what
    its owner has in it.
    """
    if frame.message == layouts.PARAM_SET:
        return _switches_fence_on(frame.fields, types)
    rule = _BEFORE_FLIGHT.get(frame.message)
    return rule is not None and rule(frame.fields)


def written(frame: Frame, *, bytewise: bool) -> tuple[str, int | None] | None:
    """The parameter that a frame sets, and the 32 bits of the value that it gets; None if it sets none."""
    return _named(_setting(frame.fields), bytewise=bytewise) if frame.message == layouts.PARAM_SET else None


def told(frame: Frame, *, bytewise: bool) -> tuple[str, int | None]:
    """The parameter that a PARAM_VALUE tells of, and the bits of its value."""
    return _named(_told(frame.fields), bytewise=bytewise)


def _named(setting: tuple[bytes, float, int], *, bytewise: bool) -> tuple[str, int | None]:
    name, raw, kind = setting
    return name.rstrip(b"\0").decode("latin-1"), bits_of(decode(raw, kind, bytewise=bytewise))


def _any(fields: _Fields) -> bool:
    return True


def _is_own(fields: _Fields) -> bool:
    """A heartbeat of ours: a ground station's would hide that the real one is gone (vehicles.md, 2)."""
    return bool(_identity(fields) == _OWN_HEARTBEAT)


def _asks(fields: _Fields) -> bool:
    """A command that asks for messages, or for the checks before arming."""
    number = _command_number(fields)
    if number == enums.MAV_CMD_RUN_PREARM_CHECKS:
        return not any(_parameters(fields))
    return number in (enums.MAV_CMD_SET_MESSAGE_INTERVAL, enums.MAV_CMD_REQUEST_MESSAGE)


def _switches_fence_on(fields: _Fields, types: float | None) -> bool:
    """FENCE_ENABLE on; the areas switched on in FENCE_TYPE, which stays as it is else."""
    name, value, _ = _setting(fields)
    match name.rstrip(b"\0"):
        case b"FENCE_ENABLE":
            return bool(value == 1)
        case b"FENCE_TYPE":
            return types is not None and bool(value == (int(types) | _AREAS))
    return False


def _about_fence(message: int) -> Callable[[_Fields], bool]:
    """Whether such a message is about a fence, and not about a mission."""
    kind = LAYOUTS[message].getter("mission_type")
    return lambda fields: bool(kind(fields) == enums.MAV_MISSION_TYPE_FENCE)


def _is_fence_item(fields: _Fields) -> bool:
    """Not `current`: 2 and 3 there are ArduPilot's way to say "go there now" and "climb to there now"."""
    number, current, mission_type = _item(fields)
    return mission_type == enums.MAV_MISSION_TYPE_FENCE and current == 0 and number in _FENCE_ITEMS


_AT_ANY_TIME: Final[dict[int, Callable[[_Fields], bool]]] = {
    layouts.HEARTBEAT: _is_own,
    layouts.COMMAND_LONG: _asks,
    layouts.PARAM_REQUEST_READ: _any,
    layouts.PARAM_REQUEST_LIST: _any,
    layouts.MISSION_REQUEST: _any,
    layouts.MISSION_REQUEST_LIST: _any,
    layouts.MISSION_REQUEST_INT: _any,
    layouts.MISSION_ACK: _any,
    layouts.TIMESYNC: _any,
    layouts.STATUSTEXT: _any,
}
_BEFORE_FLIGHT: Final[dict[int, Callable[[_Fields], bool]]] = {
    layouts.MISSION_COUNT: _about_fence(layouts.MISSION_COUNT),
    layouts.MISSION_CLEAR_ALL: _about_fence(layouts.MISSION_CLEAR_ALL),
    layouts.MISSION_ITEM_INT: _is_fence_item,
}

# ---------------------------------------------------------------- motion

#: mm: how far home's height above sea may have moved between the frame that told it and the one that uses it; in the
#: recorded flight of PX4 it moves by 0.7 m
DATUM_MOVES: Final = 2_000
_ROUNDING: Final = 2  # mm, mm/s
#: 1e-7 degree of latitude, 5 m: how near to a point of its path the vehicle must have been seen before it is sent to
#: the next; the adapters count it as arrived within 2 m
NEAR: Final = 449

#: command and frame of reference (heights above mean sea level) of a DO_REPOSITION,
_REPOSITION: Final = (enums.MAV_CMD_DO_REPOSITION, enums.MAV_FRAME_GLOBAL)
#: and its flags: to Hold, or in Hold alone, where nothing is taken from a pilot who chose another mode
_FLAGS: Final = (enums.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE, 0)
_NOWHERE: Final = (enums.NO_PLACE, enums.NO_PLACE)

_places: Final = {
    COMMAND_INT: LAYOUTS[COMMAND_INT].getter("x y"),
    SET_POSITION_TARGET_GLOBAL_INT: LAYOUTS[SET_POSITION_TARGET_GLOBAL_INT].getter("lat_int lon_int"),
}
_armings: Final = {number: LAYOUTS[number].getter("command param2") for number in (COMMAND_LONG, COMMAND_INT)}

#: parameters 2 and 3 of DO_SET_MODE that a kind of motion is made with
_MODES: Final[Mapping[int, Mapping[int, tuple[int, int]]]] = {
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
_TRAVELS: Final = (MotionKind.FLY, MotionKind.COVER)
#: what may carry out a command (`carries_out`): no parameter is set by it, and no fence handed over
COMMANDS: Final = frozenset({COMMAND_LONG, COMMAND_INT, SET_POSITION_TARGET_GLOBAL_INT})


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
    north = here[0] - latitude
    east = (meridian(here[1], longitude) - longitude) * _cosine(latitude) >> SHIFT
    return north * north + east * east <= NEAR * NEAR


def _cosine(latitude: int) -> int:
    """The cosine of a latitude in 1e-7 degree, times 2**SHIFT: by Bhaskara I, which is off by 0.0016 at most, and takes
    no float.
    """
    square = (abs(latitude) // 10_000) ** 2  # 1e-3 degree
    return ((180_000**2 - 4 * square) << SHIFT) // (180_000**2 + square)


def _long(fields: _Fields, command: Command, autopilot: int, home_amsl: int | None) -> bool:
    one, two, three, four, five, six, seven, number = layouts.of_command_long(fields)
    match number:
        case enums.MAV_CMD_DO_SET_MODE:
            mode = (enums.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, *_MODES[autopilot].get(command.kind, ()))
            return (one, two, three) == mode and _zero(four, five, six, seven)
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


def _reposition(fields: _Fields, command: Command, home_amsl: int | None) -> bool:
    """DO_REPOSITION: a circle's radius, or a heading of its own, would be another manoeuvre."""
    speed, flags, radius, yaw, x, y, z, number, reference = layouts.of_command_int(fields)
    there = _is_point(x, y, command) and _is_above_sea(z, command, home_amsl) and isnan(yaw)
    as_fast = radius == 0 and (_is_speed(speed, command) if command.speed else speed == -1)
    repositions = (number, reference) == _REPOSITION and flags in _FLAGS
    return repositions and command.kind in _TRAVELS and there and as_fast


def _stop(fields: _Fields) -> bool:
    """DO_REPOSITION to no place, height or heading: PX4 brakes, and stays where it comes to stand.

    A finite one of them would make PX4 keep the target that it flies to.
    """
    speed, flags, radius, yaw, x, y, z, number, reference = layouts.of_command_int(fields)
    nowhere = (x, y) == _NOWHERE and isnan(z) and isnan(yaw)
    repositions = (number, reference) == _REPOSITION and flags in _FLAGS
    return repositions and nowhere and (speed, radius) == (-1, 0)


def _position_target(fields: _Fields, command: Command) -> bool:
    """SET_POSITION_TARGET_GLOBAL_INT; what the mask tells the autopilot to ignore may be anything."""
    x, y, z, mask, reference = layouts.of_position_target(fields)
    there = _is_point(x, y, command) and _is(z, command.altitude)
    above_home = (mask, reference) == (enums.POSITION_ONLY, enums.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)
    return above_home and command.kind in _TRAVELS and there


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
