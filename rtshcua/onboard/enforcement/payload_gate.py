"""Which frames to cameras, gimbals and other payload may leave, and how often.

A step's contract lists the commands to payload that it may send (`model.flat.contract.Emission`). While the step's
command is open, exactly these frames pass: the command, each parameter to the bit, the component. They pass no more
often than declared: a frame that is sent once, once; one that is repeated, not before its interval is over, which for
a distance is the time that the vehicle needs at its greatest speed. Each may be repeated `RETRIES` times with a rising
`confirmation` (https://mavlink.io/en/services/command.html), so no more than four times what is declared ever leaves.

What a step has begun may be ended afterwards too, at any time until it was ended: a series of pictures, a video, a
trigger, the control of a gimbal. The frame that ends it follows from the one that began it, is for the same component,
and passes as often as one command with its retries.

Which commands are payload at all is written down here, independently of the compiler and of the checks of a bundle.
"""

from dataclasses import dataclass, field
from math import isfinite, isnan
from struct import pack, unpack
from typing import Final, NamedTuple, TypeAlias

from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink import enums
from rtshcua.mavlink.layouts import COMMAND_LONG, HEARTBEAT, LAYOUTS
from rtshcua.mavlink.modes import PX4
from rtshcua.mavlink.parameters import NAN, nearest_bits, value_of
from rtshcua.model.flat.contract import Addressee, Contract, Emission, EmissionMoment, NumberOrigin
from rtshcua.model.flat.limits import MAX_EMISSIONS
from rtshcua.model.flat.policy import Policy
from rtshcua.model.flat.zone import unproject
from rtshcua.onboard.enforcement.allow_list import DATUM_MOVES, Frame
from rtshcua.onboard.ports import PayloadFrame

#: how often an unacknowledged command may be repeated
RETRIES: Final = 3
#: how many commands may be left that end what others began: those of a whole step
MOST_ENDINGS: Final = 1 + MAX_EMISSIONS
#: the commands to payload (MAV_CMD). Nothing here moves or arms the vehicle, or changes what it may do.
COMMANDS: Final = frozenset(
    {
        enums.MAV_CMD_IMAGE_START_CAPTURE,
        enums.MAV_CMD_IMAGE_STOP_CAPTURE,
        enums.MAV_CMD_VIDEO_START_CAPTURE,
        enums.MAV_CMD_VIDEO_STOP_CAPTURE,
        enums.MAV_CMD_SET_CAMERA_MODE,
        enums.MAV_CMD_SET_CAMERA_ZOOM,
        enums.MAV_CMD_SET_CAMERA_FOCUS,
        enums.MAV_CMD_DO_DIGICAM_CONTROL,
        enums.MAV_CMD_DO_TRIGGER_CONTROL,
        enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST,
        enums.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW,
        enums.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE,
        enums.MAV_CMD_DO_MOUNT_CONTROL,
        enums.MAV_CMD_DO_SET_ROI_LOCATION,
        enums.MAV_CMD_DO_SET_ROI_NONE,
        enums.MAV_CMD_DO_GRIPPER,
        enums.MAV_CMD_DO_WINCH,
        enums.MAV_CMD_DO_SET_SERVO,
    }
)
_CAMERAS: Final = range(enums.MAV_COMP_ID_CAMERA, enums.MAV_COMP_ID_CAMERA6 + 1)
_GIMBALS: Final = (enums.MAV_COMP_ID_GIMBAL, *range(enums.MAV_COMP_ID_GIMBAL2, enums.MAV_COMP_ID_GIMBAL6 + 1))
_AUTOPILOT: Final = enums.MAV_COMP_ID_AUTOPILOT1
_ONE: Final = nearest_bits(1, 1)
_KEEP: Final = nearest_bits(-1, 1)  # what a trigger does, who controls a gimbal,
_GIVE_BACK: Final = nearest_bits(-3, 1)  # and that it is no longer the sender

_fields: Final = LAYOUTS[COMMAND_LONG].getter(
    "param1 param2 param3 param4 param5 param6 param7 command confirmation target_component"
)
_kind: Final = LAYOUTS[HEARTBEAT].getter("type")

# reasons why a frame is refused
NOT_COVERED: Final = Refusal("frame/not-covered", "the frame is not part of the permitted command")
WRONG_TARGET: Final = Refusal("frame/wrong-target", "the frame is for another system or component, or a broadcast")
TOO_OFTEN: Final = Refusal("frame/too-often", "the command to payload was sent as often as its step declares")


#: a command, the bits of its parameters, and the component that it is for
Sent: TypeAlias = tuple[int, tuple[int, ...], int]


class PayloadNumbers(NamedTuple):
    """What a command to payload says: the command, the bits of its parameters, and for whom."""

    command: int
    numbers: tuple[int, ...]
    component: int
    confirmation: int


@dataclass(slots=True)
class _Sendings:
    """How often a declared command was sent."""

    frame: PayloadFrame
    sent: int = 0
    last_us: int = 0
    retries: int = 0

    def passes(self, confirmation: int, now_us: int) -> bool:
        """Whether it may be sent now; then it counts as sent."""
        if confirmation:
            self.retries -= 1
            return self.retries >= 0
        frame = self.frame
        if frame.interval_us:
            if self.sent and now_us < self.last_us + frame.interval_us:
                return False
        elif self.sent >= frame.most:
            return False
        self.sent, self.last_us, self.retries = self.sent + 1, now_us, RETRIES
        return True


@dataclass(slots=True)
class _Ending:
    """The command that ends what another one began, and how often it may still be sent."""

    sent: Sent
    left: int = 1 + RETRIES


def payload_of(contract: Contract, arguments: tuple[int, ...], points: int, policy: Policy) -> tuple[PayloadFrame, ...]:
    """The commands to payload of a step with these arguments, whose path has so many points."""
    return tuple(_payload_frame(each, arguments, points, policy) for each in contract.emits)


def _payload_frame(emitted: Emission, arguments: tuple[int, ...], points: int, policy: Policy) -> PayloadFrame:
    moment, height = emitted.moment, None
    numbers: list[int] = []
    for parameter in emitted.parameters:
        cell, value = parameter.cell, parameter.value
        match parameter.origin:
            case NumberOrigin.CONSTANT:
                numbers.append(value)
            case NumberOrigin.ARGUMENT:
                numbers.append(nearest_bits(arguments[cell], value))
            case NumberOrigin.LATITUDE | NumberOrigin.LONGITUDE:
                place = unproject(policy.projection, arguments[cell], arguments[cell + 1])
                numbers.append(nearest_bits(place[parameter.origin == NumberOrigin.LONGITUDE], 10_000_000))
            case NumberOrigin.HEIGHT:
                height = value if cell < 0 else arguments[cell]
                numbers.append(nearest_bits(height, 1_000))
    interval_us = emitted.amount
    if moment == EmissionMoment.DISTANCE:
        interval_us = emitted.amount * 1_000_000 // policy.vehicle.speed
    most = {EmissionMoment.TURN: max(points - 2, 0), EmissionMoment.WAYPOINT: points}.get(EmissionMoment(moment), 1)
    return PayloadFrame(
        emitted.command, emitted.addressee, tuple(numbers), height, moment, emitted.amount, most, interval_us,
        emitted.success, emitted.bound, emitted.within_us, bool(emitted.required),
    )  # fmt: skip


def read_payload(frame: Frame) -> PayloadNumbers | None:
    """What a frame says to payload; None if it is no command to payload."""
    if frame.message != COMMAND_LONG:
        return None
    *parameters, command, confirmation, component = _fields(frame.fields)
    if command not in COMMANDS:
        return None
    bits = tuple(NAN if isnan(each) else unpack("<I", pack("<f", each))[0] for each in parameters)
    return PayloadNumbers(command, bits, component, confirmation)


def ending_of(command: int, numbers: tuple[int, ...]) -> tuple[int, tuple[int, ...]] | None:
    """The command that ends what this one begins, with its parameters; None if it begins nothing that goes on."""
    one, _, three, four, _, _, seven = numbers
    match command:
        case enums.MAV_CMD_IMAGE_START_CAPTURE if three != _ONE:
            return enums.MAV_CMD_IMAGE_STOP_CAPTURE, (one, NAN, NAN, NAN, 0, 0, NAN)
        case enums.MAV_CMD_VIDEO_START_CAPTURE:
            return enums.MAV_CMD_VIDEO_STOP_CAPTURE, (one, three, NAN, NAN, 0, 0, NAN)
        case enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST if one:
            return command, (0, 0, 0, four, 0, 0, 0)
        case enums.MAV_CMD_DO_TRIGGER_CONTROL if one not in (0, _KEEP, NAN):
            return command, (0, _KEEP, _KEEP, 0, 0, 0, 0)
        case enums.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE if one != _GIVE_BACK:
            return command, (_GIVE_BACK, _GIVE_BACK, _KEEP, _KEEP, 0, 0, seven)
    return None


def is_ended(ending: Sent, by: Sent) -> bool:
    """Whether what a command would end is ended by another one: a first parameter of 0 ends all of a kind."""
    command, numbers, component = by
    return (ending[0], ending[2]) == (command, component) and numbers[0] in (0, ending[1][0])


def control_of(pointing: PayloadFrame, system: int) -> PayloadFrame:
    """The command that takes the primary control of the gimbal which another one points, for us in this system."""
    ours = nearest_bits(system, 1), nearest_bits(enums.MAV_COMP_ID_ONBOARD_COMPUTER, 1)
    numbers = (*ours, _KEEP, _KEEP, 0, 0, pointing.numbers[6])
    return PayloadFrame(
        enums.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE, pointing.addressee, numbers, None, EmissionMoment.BEGIN, 0, 1, 0,
        0, 0, pointing.within_us, False,
    )  # fmt: skip


def with_control(payload: tuple[PayloadFrame, ...], system: int) -> tuple[PayloadFrame, ...]:
    """The declared commands, after the one that takes control of the gimbal if one of them points it."""
    points = enums.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW
    pointing = next((each for each in payload if each.command == points), None)
    return payload if pointing is None else (control_of(pointing, system), *payload)


@dataclass(slots=True)
class PayloadComponents:
    """The camera and the gimbal that were heard as components of their own, 0 before: the first of each counts."""

    camera: int = 0
    gimbal: int = 0

    def hear(self, kind: int, component: int) -> None:
        """Process a heartbeat, by its MAV_TYPE, of another component of the vehicle's system."""
        if not self.camera and kind == enums.MAV_TYPE_CAMERA and component in _CAMERAS:
            self.camera = component
        if not self.gimbal and kind == enums.MAV_TYPE_GIMBAL and component in _GIMBALS:
            self.gimbal = component

    def of(self, addressee: int) -> int:
        """The component that a command is for: the one that was heard, else the autopilot, which then has the payload
        itself.
        """
        heard = {Addressee.CAMERA: self.camera, Addressee.GIMBAL: self.gimbal}.get(Addressee(addressee), 0)
        return heard or _AUTOPILOT


@dataclass(slots=True)
class PayloadGate:
    """What of the payload's commands may leave."""

    _heard: PayloadComponents = field(default_factory=PayloadComponents)
    _open: list[_Sendings] = field(default_factory=list)
    _servos: tuple[int, ...] = ()
    _endings: list[_Ending] = field(default_factory=list)  # the oldest first

    def open(self, payload: tuple[PayloadFrame, ...], servos: tuple[int, ...], system: int) -> None:
        """Let the payload's commands of one step pass, in place of those before."""
        self._open = [_Sendings(each) for each in with_control(payload, system)] if payload else []
        self._servos = servos

    def close(self) -> None:
        """Let nothing more pass but what ends something."""
        self._open = []

    def hear(self, heard: Frame) -> None:
        """Process a heartbeat of another component of the vehicle's system."""
        self._heard.hear(_kind(heard.fields), heard.component)

    def has(self, component: int) -> bool:
        """Whether a component other than the autopilot is payload that was heard."""
        return component != 0 and component in (self._heard.camera, self._heard.gimbal)

    def refuse(self, frame: PayloadNumbers, now_us: int, autopilot: int, home_amsl: int | None) -> Refusal | None:
        """Why a command to payload is refused at a monotonic time; None if it passes, and then it counts as sent."""
        found = NOT_COVERED
        for each in self._open:
            if not self._is(frame, each.frame, autopilot, home_amsl):
                continue
            if frame.component != self._heard.of(each.frame.addressee):
                found = WRONG_TARGET
            elif each.passes(frame.confirmation, now_us):
                self._begun(frame)
                return None
            else:
                found = TOO_OFTEN
        ending = next((each for each in self._endings if each.sent == frame[:3]), None)
        if ending is None:
            return found
        ending.left -= 1
        if not ending.left:
            self._endings.remove(ending)
        return None

    def _begun(self, frame: PayloadNumbers) -> None:
        """A command passed: what it begins may be ended, and what it ends has been."""
        ending = ending_of(frame.command, frame.numbers)
        if ending is None:
            self._endings = [each for each in self._endings if not is_ended(each.sent, frame[:3])]
            return
        made = _Ending((*ending, frame.component))
        self._endings = [*(each for each in self._endings if each.sent != made.sent), made][-MOST_ENDINGS:]

    def _is(self, frame: PayloadNumbers, declared: PayloadFrame, autopilot: int, home_amsl: int | None) -> bool:
        """Whether a command is the declared one, to the bit, but for the height of home."""
        if frame.command != declared.command:
            return False
        if frame.command == enums.MAV_CMD_DO_SET_SERVO:
            free = {nearest_bits(servo, 1) for servo in self._servos}
            if frame.numbers[0] not in free:
                return False
        if declared.height is None or autopilot != PX4:
            return frame.numbers == declared.numbers
        metres = value_of(frame.numbers[6])
        if home_amsl is None or frame.numbers[:6] != declared.numbers[:6] or not isfinite(metres):
            return False
        return abs(round(metres * 1_000) - home_amsl - declared.height) <= DATUM_MOVES
