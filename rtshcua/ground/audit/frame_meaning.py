"""Classifies the frames that we sent, and decides whether a frame is part of flying a command of the bundle.

This is the auditor's own implementation, independent of the gate's. Both use the same layouts and numbers, which tests
compare with the dialect. A message that is not known to be harmless counts as a command. The frames of each motion:

| motion | PX4 | ArduCopter |
|---|---|---|
| climb | mode Hold, arm, take off to the height above sea | mode GUIDED, arm, take off to the height above home |
| fly, cover | reposition to a point of the path, at its height | mode GUIDED, speed, position target on the path |
| hold | reposition without place, height and heading, which stops it | mode BRAKE |
| home | mode Return | mode RTL |
| land | mode Land | mode LAND |

Heights above sea are checked with the height of home that the vehicle reported. A step may also send the commands to
payload that its contract lists, with these parameters, and later what ends pictures, a video, or control of a gimbal.
"""

from collections.abc import Callable, Mapping, Sequence
from enum import Enum, auto
from fractions import Fraction
from math import isfinite, isnan, nan
from typing import Any, Final, NamedTuple

from rtshcua.mavlink import enums, layouts
from rtshcua.mavlink.framing import HEAD, HEADER, MARKER
from rtshcua.mavlink.layouts import (
    COMMAND_INT,
    COMMAND_LONG,
    LAYOUTS,
    MISSION_ITEM_INT,
    PARAM_SET,
    SET_POSITION_TARGET_GLOBAL_INT,
)
from rtshcua.mavlink.modes import ARDUPILOT, PX4, CopterMode, Px4Mode
from rtshcua.mavlink.parameters import decode, is_bytewise, value_of
from rtshcua.model.flat.contract import PLACE, Addressee, Contract, Emission, Link, MotionKind, NumberOrigin
from rtshcua.model.flat.mission import ALONG, TURN, Invocation, Plan
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import unproject

_QUESTIONS: Final = frozenset((
    layouts.PARAM_REQUEST_READ, layouts.PARAM_REQUEST_LIST, layouts.MISSION_REQUEST, layouts.MISSION_REQUEST_LIST,
    layouts.MISSION_REQUEST_INT, layouts.MISSION_ACK, layouts.TIMESYNC, layouts.LOG_REQUEST_LIST,
    layouts.STATUSTEXT,
))  # fmt: skip
#: commands that only request information
_ASKS: Final = frozenset(
    {enums.MAV_CMD_RUN_PREARM_CHECKS, enums.MAV_CMD_SET_MESSAGE_INTERVAL, enums.MAV_CMD_REQUEST_MESSAGE}
)
_AREAS: Final = 4  # the polygon bit of FENCE_TYPE


_number: Final = LAYOUTS[COMMAND_LONG].getter("command")
_parameters: Final = {
    message: LAYOUTS[message].getter("param_id param_value param_type") for message in (PARAM_SET, layouts.PARAM_VALUE)
}
_current: Final = LAYOUTS[MISSION_ITEM_INT].getter("current")
_mission_types: Final = {
    message: LAYOUTS[message].getter("mission_type")
    for message in (layouts.MISSION_COUNT, layouts.MISSION_CLEAR_ALL, MISSION_ITEM_INT)
}


class FrameNature(Enum):
    """The class of a frame."""

    HARMLESS = auto()
    FENCE = auto()  # part of a geofence: harmless before the first command
    SETTING = auto()  # a parameter, which a record must list
    COMMAND = auto()


class AuditedFrame(NamedTuple):
    """A frame. `fields` are in wire order; empty if the audit does not read its message."""

    system: int
    component: int
    message: int
    fields: tuple[Any, ...]


def read_frame(octets: bytes) -> AuditedFrame | None:
    """Decode a frame; None if the octets are not a complete MAVLink 2 frame."""
    if len(octets) < HEADER or octets[0] != MARKER or len(octets) < HEADER + octets[1]:
        return None
    _, length, _, _, _, system, component, low, high = HEAD.unpack_from(octets)
    message = low | high << 16
    layout = LAYOUTS.get(message)
    fields = () if layout is None or length > layout.fields.size else layout.read(octets)
    return AuditedFrame(system, component, message, fields)


def nature(frame: AuditedFrame) -> FrameNature:
    """Return the class of a frame that we sent."""
    fields = frame.fields
    if frame.message in _QUESTIONS:
        return FrameNature.HARMLESS
    if not fields:
        return FrameNature.COMMAND
    if frame.message == layouts.HEARTBEAT:
        return FrameNature.HARMLESS
    if frame.message == COMMAND_LONG:
        return FrameNature.HARMLESS if _number(fields) in _ASKS else FrameNature.COMMAND
    if frame.message == PARAM_SET:
        return FrameNature.SETTING
    kind = _mission_types.get(frame.message)
    if kind is None or kind(fields) != enums.MAV_MISSION_TYPE_FENCE:
        return FrameNature.COMMAND
    if frame.message == MISSION_ITEM_INT and _current(fields) != 0:
        return FrameNature.COMMAND  # 2 and 3 make ArduPilot fly there at once
    return FrameNature.FENCE


def parameter_write(frame: AuditedFrame, autopilot: int) -> tuple[str, float]:
    """The name and value in a PARAM_SET or PARAM_VALUE, in the encoding of this autopilot."""
    name, raw, kind = _parameters[frame.message](frame.fields)
    return name.rstrip(b"\0").decode("latin-1"), decode(raw, kind, bytewise=is_bytewise(autopilot))


def switches_fence_on(name: str, value: float, types: float | None) -> bool:
    """Whether a parameter write only switches ArduPilot's fence on; `types` is the last reported FENCE_TYPE."""
    if name == "FENCE_TYPE":
        return isfinite(value) and value == (int(value) if types is None else int(types)) | _AREAS
    return (name, value) == ("FENCE_ENABLE", 1)


def frame_words(frame: AuditedFrame) -> str:
    """Describe a frame for a finding."""
    if frame.fields and frame.message in (COMMAND_LONG, COMMAND_INT):
        return f"command {frame.fields[LAYOUTS[frame.message].at('command')]}"
    return f"message {frame.message}"


_TRAVELS: Final = frozenset({MotionKind.FLY, MotionKind.COVER})
#: the motions for which a mode is set, by autopilot and parameters 2 and 3 of DO_SET_MODE
_MODES: Final = {
    (PX4, *Px4Mode.HOLD.parameters): frozenset({MotionKind.CLIMB}),
    (PX4, *Px4Mode.RETURN.parameters): frozenset({MotionKind.HOME}),
    (PX4, *Px4Mode.LAND.parameters): frozenset({MotionKind.LAND}),
    (ARDUPILOT, *CopterMode.GUIDED.parameters): frozenset({MotionKind.CLIMB}) | _TRAVELS,
    (ARDUPILOT, *CopterMode.BRAKE.parameters): frozenset({MotionKind.HOLD}),
    (ARDUPILOT, *CopterMode.RTL.parameters): frozenset({MotionKind.HOME}),
    (ARDUPILOT, *CopterMode.LAND.parameters): frozenset({MotionKind.LAND}),
}
_ROUNDING: Final = 2  # mm, mm/s: the rounding of a 32-bit float
_YAW: Final = 100  # 1e-6 radian
#: the masks of a position target, and whether it has a yaw
_MASKS: Final = {enums.POSITION_ONLY: False, enums.POSITION_AND_YAW: True}
_DATUM: Final = 2_000  # mm: the tolerance of home's reported height above sea
#: the number and frame (heights above sea) of a DO_REPOSITION, and its accepted flags
_REPOSITION: Final = (enums.MAV_CMD_DO_REPOSITION, enums.MAV_FRAME_GLOBAL)
_FLAGS: Final = (enums.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE, 0)


class MotionTarget(NamedTuple):
    """The motion of a step or link of the bundle.

    `points` are latitude and longitude in 1e-7 degree, with the heights (mm above home) and headings (1/100 degree, or
    `ALONG`) of the points there; `altitude` in mm above home, `speed` in mm/s, 0 for the vehicle's own.
    """

    kind: int
    points: Mapping[tuple[int, int], frozenset[tuple[int, int]]]
    altitude: int
    speed: int
    payload: tuple["PayloadTarget", ...] = ()


class PayloadTarget(NamedTuple):
    """A command to payload: its number, who may be addressed besides the autopilot, and its parameters as fractions
    (None: not a number). A `height`, in mm above home, is in place of the last one.
    """

    command: int
    components: frozenset[int]
    values: tuple[Fraction | None, ...]
    height: int | None


class HomeHeights(NamedTuple):
    """The lowest and highest reported height of home above sea, in mm."""

    low: int
    high: int


def target_of_step(invocation: Invocation, policy: Policy) -> MotionTarget:
    """The motion of a step."""
    plan = invocation.plan
    payload = tuple(_payload_target(each, invocation.arguments, policy) for each in invocation.contract.emits)
    return MotionTarget(plan.kind, _points(plan, policy), plan.altitude, plan.speed, payload)


def target_of_link(link: Link, policy: Policy) -> MotionTarget:
    """The motion of a link of a chain, or of the target of a degrade rule."""
    contract = policy.contracts[link.skill]
    motion = contract.motion
    altitude, speed = (link.arguments[cell] if cell >= 0 else 0 for cell in (motion.altitude, motion.speed))
    path = _link_place(contract, link) if motion.kind == MotionKind.FLY else ()
    return MotionTarget(motion.kind, _points(Plan(motion.kind, path, altitude, speed), policy), altitude, speed)


_CAMERAS: Final = frozenset(range(100, 106))  # MAV_COMP_ID_CAMERA .. CAMERA6
_GIMBALS: Final = frozenset({154, *range(171, 176)})  # MAV_COMP_ID_GIMBAL, GIMBAL2 .. GIMBAL6
_TAKE_CONTROL: Final = enums.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE
_POINT: Final = enums.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW
_of_payload: Final = LAYOUTS[COMMAND_LONG].getter(
    "command target_component param1 param2 param3 param4 param5 param6 param7"
)
_ROUNDED: Final = Fraction(1, 1 << 23)  # the greatest relative error of a 32-bit float


def _payload_target(emitted: Emission, arguments: tuple[int, ...], policy: Policy) -> PayloadTarget:
    components = {Addressee.CAMERA: _CAMERAS, Addressee.GIMBAL: _GIMBALS}.get(Addressee(emitted.addressee), frozenset())
    values: list[Fraction | None] = []
    height = None
    for parameter in emitted.parameters:
        cell = parameter.cell
        value: Fraction | None = None
        if parameter.origin == NumberOrigin.CONSTANT:
            number = value_of(parameter.value)
            value = None if isnan(number) else Fraction(number)
        elif parameter.origin == NumberOrigin.ARGUMENT:
            value = Fraction(arguments[cell], parameter.value)
        elif parameter.origin == NumberOrigin.HEIGHT:
            height = parameter.value if cell < 0 else arguments[cell]
        else:
            place = unproject(policy.projection, *arguments[cell : cell + 2])
            value = Fraction(place[parameter.origin - NumberOrigin.LATITUDE], 10_000_000)
        values.append(value)
    return PayloadTarget(emitted.command, components, tuple(values), height)


def ends_payload(frame: AuditedFrame) -> tuple[int, int] | None:
    """The number and the addressee of a command that only ends pictures, a video, or the control of a gimbal."""
    if frame.message != COMMAND_LONG or not frame.fields:
        return None
    command, component, one, *_ = _of_payload(frame.fields)
    gives_back = command == _TAKE_CONTROL and one == -3
    stops = command in (enums.MAV_CMD_IMAGE_STOP_CAPTURE, enums.MAV_CMD_VIDEO_STOP_CAPTURE)
    no_distance = command == enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST and one == 0
    return (command, component) if gives_back or stops or no_distance else None


def begins_payload(frame: AuditedFrame) -> tuple[int, int] | None:
    """The number and the addressee of the command that will have to end what a command to payload begins."""
    if frame.message != COMMAND_LONG or not frame.fields or ends_payload(frame) is not None:
        return None
    command, component, *_ = _of_payload(frame.fields)
    ends = {
        enums.MAV_CMD_IMAGE_START_CAPTURE: enums.MAV_CMD_IMAGE_STOP_CAPTURE,
        enums.MAV_CMD_VIDEO_START_CAPTURE: enums.MAV_CMD_VIDEO_STOP_CAPTURE,
        enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST: enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST,
        _TAKE_CONTROL: _TAKE_CONTROL,
    }.get(command)
    return None if ends is None else (ends, component)


def _emitted(frame: AuditedFrame, target: MotionTarget, autopilot: int, home: HomeHeights | None) -> bool:
    """Whether a COMMAND_LONG is a command to payload of the target, or takes control of the gimbal that it points."""
    command, component, *values = _of_payload(frame.fields)
    for each in target.payload:
        if component != enums.MAV_COMP_ID_AUTOPILOT1 and component not in each.components:
            continue
        if command == _TAKE_CONTROL and each.command == _POINT:
            ours = frame.system, enums.MAV_COMP_ID_ONBOARD_COMPUTER
            if tuple(values[:6]) == (*ours, -1, -1, 0, 0):
                return True
        if command == each.command and all(map(_is_value, values, each.values[: 7 if each.height is None else 6])):
            if each.height is None or (autopilot != PX4 and _is_near(values[6], each.height)):
                return True
            if autopilot == PX4 and _above_sea(values[6], each.height, home):
                return True
    return False


def _is_value(found: float, wanted: Fraction | None) -> bool:
    """Whether a parameter has a value; None: it is no number."""
    if wanted is None:
        return isnan(found)
    return isfinite(found) and abs(Fraction(found) - wanted) <= abs(wanted) * _ROUNDED


def is_part_of(frame: AuditedFrame, target: MotionTarget, autopilot: int, home: HomeHeights | None) -> bool:
    """Whether the frame makes an autopilot fly the target or a part of it."""
    if not frame.fields:
        return False
    if frame.message == COMMAND_LONG:
        *parameters, number = layouts.of_command_long(frame.fields)
        obeys = _COMMANDS.get(number)
        if obeys is None:
            return _emitted(frame, target, autopilot, home)
        return obeys(parameters, target, autopilot, home)
    if frame.message == COMMAND_INT and autopilot == PX4:
        return _repositions(frame.fields, target, home)
    if frame.message == SET_POSITION_TARGET_GLOBAL_INT and autopilot == ARDUPILOT and target.kind in _TRAVELS:
        x, y, z, yaw, mask, reference = layouts.of_position_target(frame.fields)
        if reference != enums.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT or mask not in _MASKS:
            return False
        turned = yaw if _MASKS[mask] else nan
        there = target.points.get((x, y), ())
        return any(_is_near(z, height) and _faces(turned, heading) for height, heading in there)
    return False


def _repositions(fields: tuple[Any, ...], target: MotionTarget, home: HomeHeights | None) -> bool:
    speed, flags, radius, yaw, x, y, z, number, reference = layouts.of_command_int(fields)
    if (number, reference, radius) != (*_REPOSITION, 0) or flags not in _FLAGS:
        return False  # another command, or with a loiter radius
    if target.kind == MotionKind.HOLD:
        return bool(x == y == enums.NO_PLACE and isnan(z) and isnan(yaw) and speed == -1)
    wanted = _is_near(speed, target.speed) if target.speed else speed == -1
    if target.kind not in _TRAVELS or not wanted:
        return False
    there = target.points.get((x, y), ())
    return any(_above_sea(z, height, home) and _faces(yaw, heading) for height, heading in there)


def _faces(yaw: float, heading: int) -> bool:
    """Whether a yaw, NaN for none, turns the nose to a heading, or along the leg."""
    if heading == ALONG:
        return isnan(yaw)
    wanted = (heading if heading <= TURN // 2 else heading - TURN) * 1_745_329_252 // 10_000_000
    return isfinite(yaw) and abs(round(yaw * 1_000_000) - wanted) <= _YAW


def _sets_mode(values: Sequence[Any], target: MotionTarget, autopilot: int, home: HomeHeights | None) -> bool:
    custom = values[0] == enums.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    return custom and target.kind in _MODES.get((autopilot, values[1], values[2]), ()) and not any(values[3:])


def _arms(values: Sequence[Any], target: MotionTarget, autopilot: int, home: HomeHeights | None) -> bool:
    return target.kind == MotionKind.CLIMB and values[0] == 1 and not any(values[1:])  # arm, without force


def _takes_off(values: Sequence[Any], target: MotionTarget, autopilot: int, home: HomeHeights | None) -> bool:
    pitch, height = values[0], values[6]
    if target.kind != MotionKind.CLIMB:
        return False
    if autopilot == PX4:  # at the current position, with the current heading
        here = (isnan(pitch) or not pitch) and not any(values[1:3]) and all(map(isnan, values[3:6]))
        return here and _above_sea(height, target.altitude, home)
    return not any(values[:6]) and _is_near(height, target.altitude)


def _changes_speed(values: Sequence[Any], target: MotionTarget, autopilot: int, home: HomeHeights | None) -> bool:
    wanted = target.kind in _TRAVELS and target.speed > 0 and _is_near(values[1], target.speed)
    over_ground = values[0] == enums.SPEED_TYPE_GROUNDSPEED
    return wanted and over_ground and values[2] == -1 and not any(values[3:])


#: whether a COMMAND_LONG with these parameters is part of a motion, by its number
_COMMANDS: Final[Mapping[int, Callable[[Sequence[Any], MotionTarget, int, HomeHeights | None], bool]]] = {
    enums.MAV_CMD_DO_SET_MODE: _sets_mode,
    enums.MAV_CMD_COMPONENT_ARM_DISARM: _arms,
    enums.MAV_CMD_NAV_TAKEOFF: _takes_off,
    enums.MAV_CMD_DO_CHANGE_SPEED: _changes_speed,
}


def _above_sea(metres: float, height: int, home: HomeHeights | None) -> bool:
    if home is None or not isfinite(metres):
        return False
    above_home = round(metres * 1_000) - height
    return home.low - _DATUM <= above_home <= home.high + _DATUM


def _is_near(metres: float, millimetres: int) -> bool:
    return isfinite(metres) and abs(round(metres * 1_000) - millimetres) <= _ROUNDING


def _link_place(contract: Contract, link: Link) -> tuple[int, ...]:
    cell = next(parameter.cell for parameter in contract.parameters if parameter.kind == PLACE)
    return link.arguments[cell : cell + 2]


def _points(plan: Plan, policy: Policy) -> dict[tuple[int, int], frozenset[tuple[int, int]]]:
    """Convert local points in mm to the coordinates that are sent, in 1e-7 degree."""
    found: dict[tuple[int, int], frozenset[tuple[int, int]]] = {}
    headings = plan.headings or (ALONG,) * (len(plan.path) // 2)
    for (x, y, height), heading in zip(plan.points(), headings, strict=True):
        place = unproject(policy.projection, x, y)
        found[place] = found.get(place, frozenset()) | {(height, heading)}
    return found
