"""The allow-list of frames: which ones may be sent without a permit, and which carry out the permitted command.

Housekeeping moves nothing. Requests (also for the list of logs, not for their data), telemetry rates, texts and our
own heartbeat always pass. All are for the autopilot, except requests for the reports of a camera (`asks_camera`). A
geofence may be uploaded before the flight, never during it; the same applies to the two parameters that switch
ArduCopter's fence on. Nothing else is housekeeping: no mission upload, signing key, file access or manual control.
Other parameters are set only as listed in a preparation (`written`, `frames.py`).

A frame carries out a command if every field that the autopilot acts on has the value in the command: the number,
each parameter, the frame of reference, the point, its height and heading, the speed, the mode. Values must be equal
except for the rounding of a 32-bit float and the height of home, which the autopilot's own estimate moves. The rules
are the same for every adapter, next to the documented behaviour of the autopilots.
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
from rtshcua.model.flat.mission import ALONG, TURN
from rtshcua.model.flat.zone import SHIFT, meridian
from rtshcua.onboard.ports import Command

_Fields = tuple[Any, ...]


class Frame(NamedTuple):
    """One complete frame. `fields` are in the order of the wire; `target` is (system, component) where it has one."""

    system: int
    component: int
    message: int
    fields: _Fields
    target: tuple[int, int] | None


_TARGETS = {number: layout.at("target_system") for number, layout in LAYOUTS.items()}


def read_frame(octets: bytes) -> Frame | None:
    """The frame in these octets; None unless they are one complete unsigned frame of a message in `LAYOUTS`.

    The boundary shares no parser with the adapters that it checks. The receiver checks the checksum: a frame with
    a wrong one moves nothing.
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
    """Whether the frame moves nothing and may be sent at any time."""
    rule = _AT_ANY_TIME.get(frame.message)
    return rule is not None and rule(frame.fields)


#: the system id of a ground station, by convention and by ArduPilot's default of `SYSID_MYGCS`
_GROUND_STATION: Final = 255


#: the components that are cameras
CAMERAS: Final = range(enums.MAV_COMP_ID_CAMERA, enums.MAV_COMP_ID_CAMERA6 + 1)


def asks_camera(frame: Frame) -> bool:
    """Whether the frame requests one report of a camera that is a component of its own: that of an image, by its index
    (parameter 2), or how many images it has taken. It is housekeeping too.
    """
    if frame.message != COMMAND_LONG or frame.target is None or frame.target[1] not in CAMERAS:
        return False
    if _command_number(frame.fields) != enums.MAV_CMD_REQUEST_MESSAGE:
        return False
    message, index, *rest = _parameters(frame.fields)
    about = message == layouts.CAMERA_IMAGE_CAPTURED or (message == layouts.CAMERA_CAPTURE_STATUS and index == 0)
    return about and not any(rest)


def is_greeting(frame: Frame) -> bool:
    """Whether the frame is our heartbeat, or requests one, under an id that no ground station has: it may be sent
    before any heartbeat was received.
    """
    if frame.system == _GROUND_STATION:
        return False
    if frame.message == COMMAND_LONG:
        asks = _command_number(frame.fields) == enums.MAV_CMD_REQUEST_MESSAGE
        return asks and not any(_parameters(frame.fields))  # the number of HEARTBEAT is 0
    return frame.message == HEARTBEAT and _is_own(frame.fields)


def is_of_fence(frame: Frame, types: float | None) -> bool:
    """Whether the frame is part of a fence upload: it moves nothing, and may be sent before the flight.

    `types` is the last received FENCE_TYPE, None before: it is set to the same value with the areas added.
    """
    if frame.message == layouts.PARAM_SET:
        return _switches_fence_on(frame.fields, types)
    rule = _BEFORE_FLIGHT.get(frame.message)
    return rule is not None and rule(frame.fields)


def written(frame: Frame, *, bytewise: bool) -> tuple[str, int | None] | None:
    """The parameter that a frame sets, and the 32 bits of its new value; None if it sets none."""
    return _named(_setting(frame.fields), bytewise=bytewise) if frame.message == layouts.PARAM_SET else None


def told(frame: Frame, *, bytewise: bool) -> tuple[str, int | None]:
    """The parameter in a PARAM_VALUE, and the bits of its value."""
    return _named(_told(frame.fields), bytewise=bytewise)


def _named(setting: tuple[bytes, float, int], *, bytewise: bool) -> tuple[str, int | None]:
    name, raw, kind = setting
    return name.rstrip(b"\0").decode("latin-1"), bits_of(decode(raw, kind, bytewise=bytewise))


def _any(fields: _Fields) -> bool:
    return True


def _is_own(fields: _Fields) -> bool:
    """Whether it is our own heartbeat: that of a ground station would hide the loss of the real one (vehicles.md,
    2).
    """
    return bool(_identity(fields) == _OWN_HEARTBEAT)


def _asks(fields: _Fields) -> bool:
    """Whether the command requests messages, or the checks before arming."""
    number = _command_number(fields)
    if number == enums.MAV_CMD_RUN_PREARM_CHECKS:
        return not any(_parameters(fields))
    return number in (enums.MAV_CMD_SET_MESSAGE_INTERVAL, enums.MAV_CMD_REQUEST_MESSAGE)


def _switches_fence_on(fields: _Fields, types: float | None) -> bool:
    """Whether it sets FENCE_ENABLE, or adds the areas to FENCE_TYPE and changes nothing else of it."""
    name, value, _ = _setting(fields)
    match name.rstrip(b"\0"):
        case b"FENCE_ENABLE":
            return bool(value == 1)
        case b"FENCE_TYPE":
            return types is not None and bool(value == (int(types) | _AREAS))
    return False


def _about_fence(message: int) -> Callable[[_Fields], bool]:
    """Whether the message is about a fence, and not about a mission."""
    kind = LAYOUTS[message].getter("mission_type")
    return lambda fields: bool(kind(fields) == enums.MAV_MISSION_TYPE_FENCE)


def _is_fence_item(fields: _Fields) -> bool:
    """Whether it is a fence item. `current` must be 0: 2 and 3 are ArduPilot's encodings of "go there now" and "climb
    to there now".
    """
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
    layouts.LOG_REQUEST_LIST: _any,
    layouts.STATUSTEXT: _any,
}
_BEFORE_FLIGHT: Final[dict[int, Callable[[_Fields], bool]]] = {
    layouts.MISSION_COUNT: _about_fence(layouts.MISSION_COUNT),
    layouts.MISSION_CLEAR_ALL: _about_fence(layouts.MISSION_CLEAR_ALL),
    layouts.MISSION_ITEM_INT: _is_fence_item,
}

# ---------------------------------------------------------------- motion

#: mm: the greatest change of home's height above sea between the frame that reported it and the one that uses it;
#: 0.7 m in the recorded flight of PX4
DATUM_MOVES: Final = 2_000
_ROUNDING: Final = 2  # mm, mm/s
#: 1e-7 degree of latitude, 5 m: the greatest distance to a point of its path at which the vehicle may be sent to
#: the next one; the adapters count it as arrived within 2 m
NEAR: Final = 449

#: mm: the same for the height of a point, on a path at several heights; the adapters count 1.5 m as arrived
NEAR_LEVEL: Final = 3_000
#: 1e-6 radian, about half of 1/100 degree
_YAW_ROUNDING: Final = 100

#: command and frame of reference (heights above mean sea level) of a DO_REPOSITION,
_REPOSITION: Final = (enums.MAV_CMD_DO_REPOSITION, enums.MAV_FRAME_GLOBAL)
#: and its flags: change to Hold, or only act in Hold, which overrides no pilot who chose another mode
_FLAGS: Final = (enums.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE, 0)
#: the mask of a position target with a heading
_TURNED: Final = enums.POSITION_AND_YAW
_NOWHERE: Final = (enums.NO_PLACE, enums.NO_PLACE)

_places: Final = {
    COMMAND_INT: LAYOUTS[COMMAND_INT].getter("x y"),
    SET_POSITION_TARGET_GLOBAL_INT: LAYOUTS[SET_POSITION_TARGET_GLOBAL_INT].getter("lat_int lon_int"),
}
_armings: Final = {number: LAYOUTS[number].getter("command param2") for number in (COMMAND_LONG, COMMAND_INT)}

#: parameters 2 and 3 of DO_SET_MODE for a kind of motion
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
#: frames that may carry out a command (`carries_out`); none sets a parameter or uploads a fence
COMMANDS: Final = frozenset({COMMAND_LONG, COMMAND_INT, SET_POSITION_TARGET_GLOBAL_INT})


def is_forced_arming(frame: Frame) -> bool:
    """Whether it would arm or disarm past the autopilot's own checks: parameter 2 of COMPONENT_ARM_DISARM is 21196.

    Any value but 0 counts, because an autopilot's interpretation of other values is unknown.
    """
    number, force = _armings[frame.message](frame.fields) if frame.message in _armings else (0, 0)
    return bool(number == enums.MAV_CMD_COMPONENT_ARM_DISARM and force != 0)


def carries_out(frame: Frame, command: Command, autopilot: int, home_amsl: int | None) -> bool:
    """Whether an autopilot that obeys the frame carries out the command or a part of it.

    `home_amsl` is the height of home above mean sea level in mm, None if unknown.
    """
    match frame.message:
        case layouts.COMMAND_LONG:
            return _long(frame.fields, command, autopilot, home_amsl)
        case layouts.COMMAND_INT if autopilot == PX4 and command.kind == MotionKind.HOLD:
            return _stop(frame.fields)
        case layouts.COMMAND_INT:
            return autopilot == PX4 and _reposition(frame, command, home_amsl)
        case layouts.SET_POSITION_TARGET_GLOBAL_INT:
            return autopilot == ARDUPILOT and _position_target(frame, command)
    return False


def point_of(frame: Frame) -> tuple[int, int] | None:
    """The target of a frame that carries out a command, in 1e-7 degree; None if the vehicle stays where it is."""
    place = _places.get(frame.message)
    point: tuple[int, int] | None = None if place is None else place(frame.fields)
    return None if point == _NOWHERE else point


def leads_to(frame: Frame, command: Command, number: int, home_amsl: int | None) -> bool:
    """Whether place, height and heading in a frame that carries out a command are those of a point of its path."""
    if not 0 <= number < len(command.geo) // 2:
        return False
    heading, height = command.heading_at(number), command.height_at(number)
    if frame.message == COMMAND_INT:
        _, _, _, yaw, x, y, z, _, _ = layouts.of_command_int(frame.fields)
        turned = isnan(yaw) if heading == ALONG else _is_heading(yaw, heading)
        raised = home_amsl is not None and _is(z, home_amsl + height, DATUM_MOVES)
    else:
        x, y, z, yaw, mask, _ = layouts.of_position_target(frame.fields)
        along = heading == ALONG
        turned = mask == enums.POSITION_ONLY if along else mask == _TURNED and _is_heading(yaw, heading)
        raised = _is(z, height)
    return turned and raised and (x, y) == command.geo[2 * number : 2 * number + 2]


def is_near(here: tuple[int, int] | None, point: tuple[int, int]) -> bool:
    """Whether a reported place is close enough to a point of a path for the next leg to begin; 1e-7 degree."""
    if here is None:
        return False
    latitude, longitude = point
    north = here[0] - latitude
    east = (meridian(here[1], longitude) - longitude) * _cosine(latitude) >> SHIFT
    return north * north + east * east <= NEAR * NEAR


def _cosine(latitude: int) -> int:
    """The cosine of a latitude in 1e-7 degree, times 2**SHIFT: by Bhaskara I, with an error of at most 0.0016 and
    without floats.
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
                pitch = isnan(one) or one == 0  # no effect on a multirotor
                return here and pitch and _zero(two, three) and _is_above_sea(seven, command, home_amsl)
            return _zero(one, two, three, four, five, six) and _is(seven, command.altitude)
        case enums.MAV_CMD_DO_CHANGE_SPEED if command.kind in _TRAVELS:
            ground_speed = one == enums.SPEED_TYPE_GROUNDSPEED and three == -1  # throttle as it is
            return ground_speed and _is_speed(two, command) and _zero(four, five, six, seven)
    return False


def _reposition(frame: Frame, command: Command, home_amsl: int | None) -> bool:
    """DO_REPOSITION: a circle's radius would be another manoeuvre."""
    speed, flags, radius, _, x, y, _, number, reference = layouts.of_command_int(frame.fields)
    as_fast = radius == 0 and (_is_speed(speed, command) if command.speed else speed == -1)
    repositions = (number, reference) == _REPOSITION and flags in _FLAGS
    return repositions and command.kind in _TRAVELS and as_fast and _leads_there(frame, x, y, command, home_amsl)


def _stop(fields: _Fields) -> bool:
    """DO_REPOSITION without place, height and heading: PX4 brakes, and stays where it stops.

    A finite one of them would make PX4 keep its previous target.
    """
    speed, flags, radius, yaw, x, y, z, number, reference = layouts.of_command_int(fields)
    nowhere = (x, y) == _NOWHERE and isnan(z) and isnan(yaw)
    repositions = (number, reference) == _REPOSITION and flags in _FLAGS
    return repositions and nowhere and (speed, radius) == (-1, 0)


def _position_target(frame: Frame, command: Command) -> bool:
    """SET_POSITION_TARGET_GLOBAL_INT; fields that the mask excludes may have any value."""
    x, y, _, _, _, reference = layouts.of_position_target(frame.fields)
    above_home = reference == enums.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
    return above_home and command.kind in _TRAVELS and _leads_there(frame, x, y, command, None)


def _leads_there(frame: Frame, x: int, y: int, command: Command, home_amsl: int | None) -> bool:
    """Whether the target is some point of the command's path; places are in 1e-7 degree."""
    places = enumerate(zip(command.geo[::2], command.geo[1::2], strict=True))
    return any(place == (x, y) and leads_to(frame, command, number, home_amsl) for number, place in places)


def _is_speed(metres_per_second: float, command: Command) -> bool:
    return command.speed > 0 and _is(metres_per_second, command.speed)


def _is_above_sea(metres: float, command: Command, home_amsl: int | None) -> bool:
    return home_amsl is not None and _is(metres, home_amsl + command.altitude, DATUM_MOVES)


def _is(metres: float, millimetres: int, within: int = _ROUNDING) -> bool:
    return isfinite(metres) and abs(round(metres * 1_000) - millimetres) <= within


def _is_heading(yaw: float, heading: int) -> bool:
    """Whether a yaw in radians, from -pi to pi, is a heading in 1/100 degree."""
    return isfinite(yaw) and abs(round(yaw * 1_000_000) - microradians(heading)) <= _YAW_ROUNDING


def microradians(heading: int) -> int:
    """A heading in 1/100 degree as a yaw in 1e-6 radian, from -pi to pi; rounded down."""
    turned = heading if heading <= TURN // 2 else heading - TURN
    return turned * 1_745_329_252 // 10_000_000


def _zero(*parameters: float) -> bool:
    return not any(parameters)
