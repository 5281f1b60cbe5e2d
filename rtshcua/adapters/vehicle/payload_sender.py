"""Sends the commands to payload of the step that flies, and follows each until it has had its effect.

The schedule is that of the contract: at the begin, at the end, at points of the path, by distance or by time. A command
is repeated while nobody acknowledges it, with a rising `confirmation` (https://mavlink.io/en/services/command.html). An
acknowledgement proves no picture: where the contract asks for more, an image or an attitude has to be reported
(CAMERA_IMAGE_CAPTURED or CAMERA_FEEDBACK, GIMBAL_DEVICE_ATTITUDE_STATUS).

A camera or a gimbal that sends heartbeats of its own (PX4) is addressed itself, else the autopilot (ArduPilot). Whoever
points a gimbal takes its primary control first and gives it back at the end. What a step leaves running is ended by us:
when it ends, when a fallback takes its place, and when somebody else takes the vehicle over.

The boundary's gate has the same rules, and refuses what they do not allow. Times in us; a clock and the state of the
vehicle are passed in.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from math import asin, atan2, degrees, isnan
from typing import Final, NamedTuple

from rtshcua.adapters.vehicle import messages
from rtshcua.adapters.vehicle.effects import ARRIVED, apart
from rtshcua.adapters.vehicle.manoeuvre import RESULTS
from rtshcua.adapters.vehicle.messages import Message
from rtshcua.adapters.vehicle.observed import ObservedVehicle
from rtshcua.diagnostics.refusal import Refusal
from rtshcua.mavlink import enums
from rtshcua.mavlink.parameters import nearest_bits, value_of
from rtshcua.model.flat.contract import EmissionMoment, EmissionSuccess
from rtshcua.onboard.enforcement.payload_gate import (
    RETRIES,
    PayloadComponents,
    Sent,
    ending_of,
    is_ended,
    with_control,
)
from rtshcua.onboard.ports import Command, CommandFailed, Event, PayloadFrame, PayloadOutcome, Succeeded

#: an unacknowledged command is repeated after this long
RETRY_US: Final = 700_000
#: how often the attitude of a gimbal is requested while it is awaited
ASK_US: Final = 200_000
#: mm: shorter movements count as noise of the position, and not as distance flown
STEP: Final = 300
#: the reason of a command that failed because payload that its contract requires did not work
FAILED: Final = "payload"
#: the reason of a command whose contract requires all images, of which some are missing
IMAGES_MISSING: Final = "images-missing"
#: how long the last pictures of a step may take, until cameras count them
SETTLES_US: Final = 1_500_000
#: the messages that tell about payload
HEEDED: Final = frozenset(
    {"HEARTBEAT", "COMMAND_ACK", "CAMERA_IMAGE_CAPTURED", "CAMERA_FEEDBACK", "GIMBAL_DEVICE_ATTITUDE_STATUS"}
)

#: the commands after which a camera takes pictures
PICTURES: Final = frozenset(
    {
        enums.MAV_CMD_IMAGE_START_CAPTURE,
        enums.MAV_CMD_DO_DIGICAM_CONTROL,
        enums.MAV_CMD_DO_TRIGGER_CONTROL,
        enums.MAV_CMD_DO_SET_CAM_TRIGG_DIST,
    }
)

_ACCEPTED, _TEMPORARILY_REJECTED, _IN_PROGRESS = 0, 1, 5
_ATTITUDE: Final = "GIMBAL_DEVICE_ATTITUDE_STATUS"
_YAW_LOCK, _IN_VEHICLE, _IN_EARTH = 16, 32, 64  # GIMBAL_DEVICE_FLAGS; the first one is also GIMBAL_MANAGER_FLAGS
_UNIT: Final = 10_000_000  # 1e-7 degree in a degree

#: sends a message at a time, unless the boundary refuses it
Send = Callable[[Message, int], Refusal | None]


class Attitude(NamedTuple):
    """The attitude that a gimbal reports, or that is asked of it: degrees, NaN for an axis that does not matter.
    `by_north`: the yaw is from north, and not from the nose.
    """

    pitch: float
    yaw: float
    by_north: bool


def attitude_of(message: Message) -> Attitude:
    """The attitude in GIMBAL_DEVICE_ATTITUDE_STATUS, from its quaternion (w, x, y, z)."""
    w, x, y, z = message.q
    pitch = degrees(asin(max(-1.0, min(1.0, 2 * (w * y - z * x)))))
    yaw = degrees(atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
    frames = message.flags & (_IN_VEHICLE | _IN_EARTH)
    return Attitude(pitch, yaw, bool(frames == _IN_EARTH or (not frames and message.flags & _YAW_LOCK)))


def asked_attitude(frame: PayloadFrame) -> Attitude:
    """The attitude that a command asks for."""
    numbers = [value_of(each) for each in frame.numbers]
    if frame.command == enums.MAV_CMD_DO_MOUNT_CONTROL:
        return Attitude(numbers[0], numbers[2], by_north=False)
    return Attitude(numbers[0], numbers[1], bool(int(numbers[4]) & _YAW_LOCK))


def off_by(asked: Attitude, shown: Attitude) -> float:
    """The greatest difference of an axis that matters and is told in the same frame, in degrees."""
    off = 0.0 if isnan(asked.pitch) else abs(asked.pitch - shown.pitch)
    if not isnan(asked.yaw) and asked.by_north == shown.by_north:
        off = max(off, abs((asked.yaw - shown.yaw + 180) % 360 - 180))
    return off


@dataclass(slots=True)
class _Sending:
    """One command that was sent and has neither had its effect nor failed. `due_us` is when it is repeated."""

    frame: PayloadFrame
    name: str  # for a record
    component: int
    token: int
    until_us: int
    due_us: int
    tries: int = 0
    acknowledged: bool = False
    ends: bool = False  # what an earlier command began
    off: float | None = None  # the last difference from the attitude, in degrees


@dataclass(slots=True)
class _Schedule:
    """When one command of a contract is due. `way` is the distance that was flown since it was last due, in mm."""

    frame: PayloadFrame
    count: int = 0
    last_us: int | None = None
    way: float = 0.0
    owed: int = 0  # points of the path that were reached


@dataclass(slots=True)
class _Path:
    """How far the vehicle is along the path of its command."""

    points: tuple[tuple[int, int], ...]
    reached: int = 0
    anchor: tuple[int, int] | None = None  # where the flown distance was last added up


@dataclass(slots=True)
class PayloadSender:
    """Everything that is sent to payload. `send` packs a message through the boundary's gate."""

    send: Send
    system: int = 0
    heard: PayloadComponents = field(default_factory=PayloadComponents)
    _token: int = 0
    _schedules: list[_Schedule] = field(default_factory=list)
    _path: _Path = field(default_factory=lambda: _Path(()))
    _begun: bool = False
    _sendings: list[_Sending] = field(default_factory=list)
    _endings: dict[Sent, PayloadFrame] = field(default_factory=dict)  # what is owed
    _ended: Succeeded | None = None  # the success that waits for the commands of the end
    _captured: bool = False  # CAMERA_IMAGE_CAPTURED was heard: CAMERA_FEEDBACK tells of the same pictures
    _images: dict[str, int] = field(default_factory=dict)  # the last index, by message
    _asked_us: int = 0
    _events: list[Event] = field(default_factory=list)
    _flown_us: int | None = None  # when nothing but images was awaited any more
    _closing: bool = False  # what was begun is to be ended now
    _now_us: int = 0
    #: the height of home above sea in mm where heights are sent above sea, else 0
    datum: int = 0
    #: what is missing of the images, in words, if cameras have told since a time how many they took; empty: nothing
    lacking: Callable[[int], str] = lambda since_us: ""
    #: how often the autopilot was asked for an attitude
    asked: int = 0

    @property
    def awaits_images(self) -> bool:
        """Whether the end of the step waits for images alone."""
        return self._flown_us is not None

    @property
    def busy(self) -> bool:
        """Whether there is anything to send or to wait for."""
        return bool(self._schedules or self._sendings or self._endings or self._ended or self._events)

    def begin(self, command: Command) -> None:
        """Another command takes the place of the one before. Nothing is sent before `advance`."""
        self.close()
        self._token, self._begun = command.token, False
        declared = with_control(command.payload, self.system)
        in_order = sorted(declared, key=lambda each: each.moment == EmissionMoment.END)  # those of the end come last
        self._schedules = [_Schedule(each) for each in in_order]
        geo = command.geo
        self._path = _Path(tuple(zip(geo[::2], geo[1::2], strict=True)))

    def close(self) -> None:
        """The command is over, whoever flies now: what it began is ended, and nothing else is sent."""
        self._schedules, self._ended, self._closing, self._flown_us = [], None, True, None
        for each in self._sendings:
            if not each.ends:
                self._tell(self._now_us, each, "failed", "its step ended before its effect showed")
        self._sendings = [each for each in self._sendings if each.ends]

    def ends(self, success: Succeeded) -> bool:
        """Whether the success of the command waits for payload; then it comes from `advance`."""
        if success.token != self._token or not (self._schedules or self._sendings or self._endings):
            return False
        self._ended = success
        for each in self._schedules:
            each.owed += each.frame.moment == EmissionMoment.END
        return True

    # -------------------------------------------------------- what is heard

    def take(self, name: str, message: Message, component: int, now_us: int) -> None:
        """Take in a message of `HEEDED`, an acknowledgement only if it is for us."""
        match name:
            case "HEARTBEAT":
                self.heard.hear(message.type, component)
            case "COMMAND_ACK":
                self._acknowledge(message.command, message.result, component, now_us)
            case "CAMERA_IMAGE_CAPTURED":
                self._captured = True
                self._image(name, message.image_index, component, now_us, failed=message.capture_result != 1)
            case "CAMERA_FEEDBACK" if not self._captured:
                self._image(name, message.img_idx, component, now_us)
            case "GIMBAL_DEVICE_ATTITUDE_STATUS":
                self._turned(attitude_of(message), component, now_us)

    def _acknowledge(self, command: int, result: int, component: int, now_us: int) -> None:
        found = next((each for each in self._waiting(command, component) if not each.acknowledged), None)
        if found is None:
            return
        if result == _IN_PROGRESS:
            found.until_us, found.due_us = now_us + found.frame.within_us, now_us + found.frame.within_us
        elif result == _TEMPORARILY_REJECTED and found.tries < RETRIES:
            found.due_us = now_us + RETRY_US  # a camera that is busy, as with the picture whose answer was lost
        elif result != _ACCEPTED:
            self._end(found, now_us, "failed", RESULTS.get(result, str(result)))
        else:
            found.acknowledged = True
            if found.frame.success in (EmissionSuccess.ACKNOWLEDGEMENT, EmissionSuccess.ALL_IMAGES):
                self._end(found, now_us, "done", "acknowledged")

    def _waiting(self, command: int, component: int) -> Iterator[_Sending]:
        return (each for each in self._sendings if (each.frame.command, each.component) == (command, component))

    def _image(self, name: str, index: int, component: int, now_us: int, *, failed: bool = False) -> None:
        """A picture was reported; the same one may be reported again."""
        before, self._images[name] = self._images.get(name), index
        if before == index:
            return
        if name == "CAMERA_FEEDBACK" and before is not None:
            self._skip(component, index - before - 1, now_us)
        for each in self._sendings:
            if each.frame.success == EmissionSuccess.IMAGE and each.component == component:
                what = "failed" if failed else "done"
                self._end(each, now_us, what, f"image {index}" if not failed else f"image {index} was not captured")
                return

    def _skip(self, component: int, skipped: int, now_us: int) -> None:
        """Fail the oldest commands whose pictures the camera's count of triggers has skipped, and not later ones."""
        waits = [
            each
            for each in self._sendings
            if each.frame.success == EmissionSuccess.IMAGE and each.component == component
        ]
        for each in waits[: max(0, min(skipped, len(waits) - 1))]:
            self._end(each, now_us, "failed", "no image")

    def _turned(self, shown: Attitude, component: int, now_us: int) -> None:
        for each in [*self._sendings]:
            if each.frame.success == EmissionSuccess.ATTITUDE and each.component == component:
                each.off = off_by(asked_attitude(each.frame), shown)
                if each.off * _UNIT <= each.frame.bound:
                    self._end(each, now_us, "done", f"off by {each.off:.1f} deg")

    # -------------------------------------------------------- what is sent

    def advance(self, seen: ObservedVehicle, now_us: int, *, flies: bool) -> list[Event]:
        """Send what is due; return the events. `flies`: a frame of the command has left, or it needs none."""
        self._now_us = now_us
        if self._closing:
            self._closing = False
            self._send_endings(now_us)
        if flies and not self._begun:
            self._begun = True
            for each in self._schedules:
                each.owed = int(each.frame.moment == EmissionMoment.BEGIN)
        if self._begun:
            self._look(seen)
            self._send_due(now_us)
        self._repeat(now_us)
        if self._ended is not None and not any(each.owed for each in self._schedules):
            self._send_endings(now_us)
        self._ask(now_us)
        self._finish(now_us)
        events, self._events = self._events, []
        return events

    def _look(self, seen: ObservedVehicle) -> None:
        """Note the way that was flown, and the points of the path that were reached."""
        path = self._path
        if not seen.located:
            return
        here = seen.latitude, seen.longitude
        if path.anchor is None or (way := apart(*here, *path.anchor)) >= STEP:
            moved = 0.0 if path.anchor is None else way
            path.anchor = here
            for each in self._schedules:
                each.way += moved
        last = len(path.points) - 1
        if path.reached <= last and apart(*here, *path.points[path.reached]) <= ARRIVED:
            for each in self._schedules:
                turns = each.frame.moment == EmissionMoment.TURN and 0 < path.reached < last
                each.owed += turns or each.frame.moment == EmissionMoment.WAYPOINT
                each.way = 0.0 if path.reached == 0 else each.way  # the way to the path is none of it
            path.reached += 1

    def _is_due(self, schedule: _Schedule, now_us: int) -> bool:
        frame, last_us = schedule.frame, schedule.last_us
        if not frame.interval_us:
            return schedule.owed > 0 and schedule.count < frame.most
        if self._ended is not None or (last_us is not None and now_us < last_us + frame.interval_us):
            return False
        if frame.moment == EmissionMoment.TIME or last_us is None:
            return len(self._path.points) < 2 or self._path.reached > 0  # on a path, from its first point on
        return schedule.way >= frame.amount

    def _send_due(self, now_us: int) -> None:
        controls = enums.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE
        for each in self._schedules:
            waits = each.frame.command != controls and any(
                sending.frame.command == controls and sending.component == self.heard.of(each.frame.addressee)
                for sending in self._sendings
            )  # whoever does not control a gimbal may not point it
            if waits or not self._is_due(each, now_us):
                continue
            each.owed = max(each.owed - 1, 0)
            each.way = each.way % each.frame.amount if each.frame.moment == EmissionMoment.DISTANCE else 0.0
            each.count += 1
            each.last_us = now_us
            self._send(each.frame, each.count, now_us)

    def _send(self, frame: PayloadFrame, count: int, now_us: int, to: int = 0) -> None:
        """Send a command to the component that it is for, or what ends something to the one that it was begun with."""
        component = to or self.heard.of(frame.addressee)
        sending = _Sending(
            frame, f"{frame.command} to {component}, {count}", component, self._token, now_us + frame.within_us,
            now_us + RETRY_US, ends=bool(to),
        )  # fmt: skip
        refused = self.send(self._message(sending), now_us)
        if refused is not None:
            self._tell(now_us, sending, "failed", refused.slug)
            return
        self._tell(now_us, sending, "sent", "")
        self._sendings.append(sending)
        ending = ending_of(frame.command, frame.numbers)
        if ending is None:
            by = frame.command, frame.numbers, component
            self._endings = {owed: each for owed, each in self._endings.items() if not is_ended(owed, by)}
        else:
            self._endings[*ending, component] = PayloadFrame(
                ending[0], frame.addressee, ending[1], None, EmissionMoment.END, 0, 1, 0,
                EmissionSuccess.ACKNOWLEDGEMENT, 0, frame.within_us, False,
            )  # fmt: skip

    def _message(self, sending: _Sending) -> Message:
        frame = sending.frame
        numbers = [value_of(each) for each in frame.numbers]
        if frame.height is not None:
            numbers[6] = value_of(nearest_bits(frame.height + self.datum, 1_000))
        return messages.payload_command(self.system, sending.component, frame.command, sending.tries, *numbers)

    def _send_endings(self, now_us: int) -> None:
        """End what was begun."""
        endings, self._endings = self._endings, {}
        for (_, _, component), frame in endings.items():
            self._send(frame, 1, now_us, component)

    def _repeat(self, now_us: int) -> None:
        """Repeat what nobody acknowledged, and give up what had no effect in time."""
        for each in [*self._sendings]:
            if now_us >= each.until_us:
                self._end(each, now_us, "failed", self._lacks(each))
            elif not each.acknowledged and now_us >= each.due_us and each.tries < RETRIES and self._is_last(each):
                each.tries += 1
                each.due_us = now_us + RETRY_US
                self.send(self._message(each), now_us)

    def _is_last(self, sending: _Sending) -> bool:
        """Whether its command was not sent again since: only the last one may be repeated."""
        return next(each for each in reversed(self._sendings) if each.frame is sending.frame) is sending

    @staticmethod
    def _lacks(sending: _Sending) -> str:
        if not sending.acknowledged:
            return "no answer"
        if sending.off is not None:
            return f"off by {sending.off:.1f} deg"
        return {EmissionSuccess.IMAGE: "no image"}.get(EmissionSuccess(sending.frame.success), "no attitude")

    def _ask(self, now_us: int) -> None:
        """Request the attitude that a command waits for."""
        waiting = next((each for each in self._sendings if each.frame.success == EmissionSuccess.ATTITUDE), None)
        if waiting is not None and now_us - self._asked_us >= ASK_US:
            self._asked_us = now_us
            self.asked += waiting.component == enums.MAV_COMP_ID_AUTOPILOT1
            self.send(messages.request_of(self.system, waiting.component, _ATTITUDE), now_us)

    # -------------------------------------------------------- what became of it

    def _finish(self, now_us: int) -> None:
        """Report the command's success once all commands of its end have ended."""
        if self._ended is None or self._sendings or any(each.owed for each in self._schedules):
            return
        if self._awaits_images(now_us, self._ended):
            return
        self._events.append(Succeeded(now_us, self._ended.token))
        self._schedules, self._ended = [], None

    def _awaits_images(self, now_us: int, ended: Succeeded) -> bool:
        """Whether images are still awaited, or the step has failed without them."""
        asking = [each.frame for each in self._schedules if each.frame.success == EmissionSuccess.ALL_IMAGES]
        if not asking:
            return False
        if self._flown_us is None:
            self._flown_us = now_us
        lacking = self.lacking(self._flown_us + SETTLES_US)
        if lacking and now_us < self._flown_us + max(each.within_us for each in asking):
            return True
        required = any(each.required for each in asking)
        self._flown_us = None
        if lacking:
            self._events.append(PayloadOutcome(now_us, ended.token, "failed", lacking))
        if lacking and required:
            self._events.append(CommandFailed(now_us, ended.token, IMAGES_MISSING, lacking))
            self._schedules, self._ended = [], None
        return bool(lacking and required)

    def _end(self, sending: _Sending, now_us: int, what: str, text: str) -> None:
        self._sendings.remove(sending)
        self._tell(now_us, sending, what, text)

    def _tell(self, now_us: int, sending: _Sending, what: str, text: str) -> None:
        said = sending.name + (f": {text}" if text else "")
        self._events.append(PayloadOutcome(now_us, sending.token, what, said))
        if what == "failed" and sending.frame.required and sending.token == self._token and self._schedules:
            self._events.append(CommandFailed(now_us, sending.token, FAILED, said))
            self._schedules, self._ended = [], None
