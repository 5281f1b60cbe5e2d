"""Apply faults to a simulation at their times, including those of its camera, and the pilot's interventions by
switches, sticks or another ground station.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from math import cos, nan, radians, sin
from random import Random
from typing import Final

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec, Message
from rtshcua.model import faults
from rtshcua.model.faults import Direction, Fault, FlightMode, Voice
from rtshcua.simulation.autopilot import Autopilot, Speaker, Taker
from rtshcua.simulation.command import VehicleCommand
from rtshcua.simulation.fault_syntax import message_number
from rtshcua.simulation.link import FaultyLink
from rtshcua.simulation.surroundings import Cylinder, Wind
from rtshcua.simulation.telemetry import heartbeat

#: the addressee of answers that are not for the runtime: the same component of another system
_ANOTHER: Final = (77, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER)
_ANSWERED: Final = (
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_DO_SET_MODE,
    mavlink.MAV_CMD_DO_REPOSITION, mavlink.MAV_CMD_DO_CHANGE_SPEED,
)  # fmt: skip


class SecondSender:
    """A second sender under the vehicle's ids: sends the same messages every `each_us` from a time on, with its own
    sequence numbers.
    """

    def __init__(self, says: Voice, each_us: int, at_us: int) -> None:
        self._says = says
        self._each_us = max(each_us, 1)
        self._due_us = at_us
        self._codec: Codec | None = None

    def due(self, autopilot: Autopilot, system: int, now_us: int) -> list[bytes]:
        """Return the frames that are due by `now_us`."""
        if now_us < self._due_us:
            return []
        self._due_us = now_us + self._each_us
        if self._codec is None:
            self._codec = Codec(system, mavlink.MAV_COMP_ID_AUTOPILOT1)
        return [self._codec.pack(each) for each in self._messages(autopilot)]

    def _messages(self, autopilot: Autopilot) -> list[Message]:
        beat = heartbeat(autopilot)
        match self._says:
            case Voice.GIMBAL:
                kind, none = mavlink.MAV_TYPE_GIMBAL, mavlink.MAV_AUTOPILOT_INVALID
                return [mavlink.MAVLink_heartbeat_message(kind, none, 0, 0, mavlink.MAV_STATE_ACTIVE, 3)]
            case Voice.DISARMED:
                beat.base_mode &= ~mavlink.MAV_MODE_FLAG_SAFETY_ARMED
                return [beat]
            case Voice.STRAYED:
                beat.custom_mode = autopilot.flavour.modes.numbers[FlightMode.LAND]
                return [beat]
            case Voice.ANSWERS:
                denied, refused = mavlink.MAV_RESULT_DENIED, mavlink.MAV_MISSION_DENIED
                fence = mavlink.MAVLink_mission_ack_message(*_ANOTHER, refused, mavlink.MAV_MISSION_TYPE_FENCE)
                answers = [mavlink.MAVLink_command_ack_message(each, denied, 0, 0, *_ANOTHER) for each in _ANSWERED]
                return [*answers, fence]


Effect = tuple[int, Callable[[], object]]
"""A time, and the action at that time."""
_STATION = (255, 190)
_EVERY_US = 100_000
"""How often the stick positions are read."""
_STEERED_US = 100_000
"""How often a ground station sends the velocity that it steers by, as recorded."""
_VELOCITY_ALONE = 0x0DC7
"""The `type_mask` of that message."""
SHUFFLED_US = 200_000
"""How long messages wait after a stall to be shuffled."""


@dataclass(frozen=True, slots=True)
class Affected:
    """The parts of a simulation that faults act on."""

    autopilot: Autopilot
    up: FaultyLink
    down: FaultyLink
    halt: Callable[[bool], None]
    """Halts or resumes the autopilot's loop."""
    reboot: Callable[[], None]
    """Restarts the autopilot."""

    def links(self, way: Direction) -> tuple[FaultyLink, ...]:
        """The links of a direction."""
        return {Direction.BOTH: (self.up, self.down), Direction.UP: (self.up,), Direction.DOWN: (self.down,)}[way]


def effects(fault: Fault, on: Affected) -> Iterator[Effect]:
    """Yield the times at which a fault begins and ends, with the actions."""
    a = on.autopilot
    match fault:
        case faults.LinkFault():
            yield from _on_link(fault, on)
        case faults.AutopilotFault():
            yield from _on_autopilot(fault, on)
        case faults.PilotFault():
            yield from _by_pilot(fault, a)
        case faults.ReceiverFault():
            yield from _on_receiver(fault, a)
        case faults.PayloadFault():
            yield from _on_payload(fault, a)
        case faults.Obstacle(at_us, distance_mm, for_us):
            see = a.surroundings.see
            yield from _for(at_us, for_us, partial(see, distance_mm / 1000), partial(see, None))
        case faults.Pillar(at_us, north_mm, east_mm, radius_mm, height_mm, for_us, speed_mm_s, towards_deg):
            place = (north_mm / 1000, east_mm / 1000, radius_mm / 1000, height_mm / 1000)
            speed, towards = speed_mm_s / 1000, radians(towards_deg)
            pillar = Cylinder(*place, speed * cos(towards), speed * sin(towards))
            surroundings = a.surroundings
            yield from _for(at_us, for_us, partial(surroundings.put, pillar), partial(surroundings.take, pillar))
        case faults.BatteryCell(at_us, drop_mv):
            yield at_us, partial(a.battery.fail_cell, drop_mv)
        case faults.BatteryLevel(at_us, level):
            yield at_us, partial(a.battery.cap, level / 10_000)
        case faults.BatteryVoltage(at_us, voltage_mv):
            yield at_us, partial(setattr, a.battery, "forced_mv", voltage_mv)
        case faults.WindStep(at_us, speed_mm_s, from_deg, gust_mm_s):
            yield at_us, partial(a.air.set, Wind(speed_mm_s, from_deg, gust_mm_s))
        case faults.HostFault() | faults.AgentFault():
            pass  # does not affect the vehicle
        case _:
            raise _unknown(fault)


def _on_receiver(fault: faults.ReceiverFault, a: Autopilot) -> Iterator[Effect]:
    sensors = a.sensors
    match fault:
        case faults.GpsLoss(at_us, for_us):
            yield from _while((sensors,), "lost", True, False, at_us, for_us)
        case faults.GpsGlitch(at_us, north_mm, east_mm, for_us):
            yield from _while((sensors,), "glitch", (north_mm / 1000, east_mm / 1000), (0.0, 0.0), at_us, for_us)
        case faults.GpsJump(at_us, north_mm, east_mm):
            yield at_us, partial(sensors.jump, north_mm / 1000, east_mm / 1000)
        case faults.GpsDrift(at_us, north_mm_s, east_mm_s, for_us):
            yield from _while((sensors,), "stray", (north_mm_s / 1000, east_mm_s / 1000), (0.0, 0.0), at_us, for_us)
        case _:
            raise _unknown(fault)


def _on_payload(fault: faults.PayloadFault, a: Autopilot) -> Iterator[Effect]:
    """Yield effects on the camera and the gimbal, none where there is none."""
    camera, gimbal = a.camera, a.gimbal
    cameras = () if camera is None else (camera,)
    match fault:
        case faults.CameraLoss(at_us, part, for_us):
            yield from _while(cameras, "loss", part, 0, at_us, for_us)
        case faults.CameraSlow(at_us, delay_us, for_us):
            yield from _while(cameras, "slow_us", delay_us, 0, at_us, for_us)
        case faults.CameraFull(at_us, for_us):
            yield from _while(cameras, "full", True, False, at_us, for_us)
        case faults.CameraReboot(at_us, for_us, counter):
            if camera is not None:
                yield at_us, partial(camera.restart, counter)
                yield at_us + for_us, camera.started
        case faults.GimbalStuck(at_us, for_us):
            yield from _while(() if gimbal is None else (gimbal,), "stuck", True, False, at_us, for_us)
        case _:
            raise _unknown(fault)


def _on_link(fault: faults.LinkFault, on: Affected) -> Iterator[Effect]:
    """Yield effects on the link in the fault's directions, and on the radio's report."""
    radio = (on.autopilot,)
    match fault:
        case faults.LinkDelay(at_us, delay_us, for_us, way):
            yield from _while(on.links(way), "delay_us", delay_us, 0, at_us, for_us)
        case faults.LinkJitter(at_us, jitter_us, for_us, way):
            yield from _while(on.links(way), "jitter_us", jitter_us, 0, at_us, for_us)
        case faults.LinkReorder(at_us, part, for_us, way):
            yield from _while(on.links(way), "reordered", part, 0, at_us, for_us)
        case faults.LinkLoss(at_us, loss, for_us, way):
            yield from _while(on.links(way), "loss", loss, 0, at_us, for_us)
            yield from _while(radio, "link_quality", 10_000 - loss, 10_000, at_us, for_us)
        case faults.LinkSilence(at_us, for_us, way, held):
            links = on.links(way)
            if held:
                yield at_us, partial(_set, links, "held", True)
                if for_us is not None:
                    yield from ((at_us + for_us, partial(link.release, at_us + for_us)) for link in links)
            else:
                yield from _while(links, "silent", True, False, at_us, for_us)
        case faults.LinkQuality(at_us, quality):
            yield at_us, partial(_set, radio, "link_quality", quality)
        case faults.SecondVoice(at_us, says, each_us, for_us):
            voice: Speaker = SecondSender(says, each_us, at_us)
            voices = on.autopilot.voices
            yield from _for(at_us, for_us, partial(_begin, voices, voice), partial(_end, voices, voice))
        case _:
            raise _unknown(fault)


def _on_autopilot(fault: faults.AutopilotFault, on: Affected) -> Iterator[Effect]:
    reports = on.autopilot.reports
    match fault:
        case faults.Stall(at_us, for_us, shuffle):
            end_us = at_us + for_us
            yield at_us, partial(on.halt, True)
            yield end_us, partial(on.halt, False)
            if shuffle:
                yield end_us, partial(_set, (on.down,), "held", True)
                last_us = end_us + SHUFFLED_US
                yield last_us, partial(on.down.release, last_us, Random(shuffle))
        case faults.Freeze(at_us, for_us):
            yield from _for(at_us, for_us, partial(reports.freeze, True), partial(reports.freeze, False))
        case faults.MessageSilence(at_us, message, for_us):
            silence = partial(reports.silence, message_number(message))
            yield from _for(at_us, for_us, partial(silence, True), partial(silence, False))
        case faults.MessageStuck(at_us, message, for_us):
            stick = partial(reports.stick, message_number(message))
            yield from _for(at_us, for_us, partial(stick, True), partial(stick, False))
        case faults.StaleSource(at_us, delay_us, for_us):
            yield from _for(at_us, for_us, partial(reports.delay, delay_us), partial(reports.delay, 0))
        case faults.EstimatorUnhealthy(at_us, for_us):
            yield from _while((on.autopilot.sensors,), "unhealthy", True, False, at_us, for_us)
        case faults.Reboot(at_us):
            yield at_us, on.reboot
        case _:
            raise _unknown(fault)


def _unknown(fault: Fault) -> TypeError:
    return TypeError(f"the effect of {type(fault).__name__} on the simulated vehicle is not defined")


def _by_pilot(fault: faults.PilotFault, a: Autopilot) -> Iterator[Effect]:
    """Yield the pilot's actions; an action that has an effect is a takeover."""
    for at_us, act in _pilots(fault, a):
        yield at_us, partial(a.take_over, Taker.PILOT, act)


def _pilots(fault: faults.PilotFault, a: Autopilot) -> Iterator[Effect]:
    match fault:
        case faults.PilotMode(at_us, mode):
            if mode in a.flavour.modes.numbers:  # the switch has no position for a mode of the other flavour
                yield at_us, partial(_choose, a, mode)
        case faults.PilotPause(at_us):
            yield at_us, partial(_pause, a)
        case faults.PilotGoto(at_us, north_mm, east_mm, up_mm):
            yield at_us, partial(_send_to, a, north_mm, east_mm, up_mm)
        case faults.PilotVelocity(at_us, north_mm_s, east_mm_s, for_us):
            for after_us in range(0, for_us, _STEERED_US):
                yield at_us + after_us, partial(_steer, a, north_mm_s / 1000, east_mm_s / 1000)
        case faults.PilotSpeed(at_us, speed_mm_s):
            yield at_us, partial(_change_speed, a, speed_mm_s / 1000)
        case faults.PilotSticks(at_us, for_us):
            for after_us in range(0, for_us, _EVERY_US):
                yield at_us + after_us, partial(a.flavour.on_sticks, a, _EVERY_US)
        case faults.Kill(at_us):
            yield at_us, a.vehicle.disarm
        case _:
            raise _unknown(fault)


def _choose(a: Autopilot, mode: FlightMode) -> None:
    """Select a mode with the remote control's switch: the autopilot refuses it like a ground station's request. Only
    PX4 enters Altitude if Position is selected without a position (`UserModeIntention::change`, `allow_fallback`).
    """
    if mode is FlightMode.POSITION and a.flavour.falls_back and not a.can_enter(mode):
        mode = FlightMode.ALTITUDE
    a.flavour.on_set_mode(a, a.flavour.modes.numbers[mode])


def _pause(a: Autopilot) -> None:
    if mavlink.MAV_CMD_DO_PAUSE_CONTINUE in a.flavour.commands:
        _command(a, mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0.0, None, None, nan)
    else:
        _command(a, mavlink.MAV_CMD_DO_REPOSITION, -1.0, None, None, nan)


def _send_to(a: Autopilot, north_mm: int, east_mm: int, up_mm: int) -> None:
    latitude, longitude = a.home.globe(north_mm / 1000, east_mm / 1000)
    amsl = (a.home.amsl_mm + up_mm) / 1000
    _command(a, mavlink.MAV_CMD_DO_REPOSITION, -1.0, float(latitude), float(longitude), amsl)


def _steer(a: Autopilot, north_m_s: float, east_m_s: float) -> None:
    message = mavlink.MAVLink_set_position_target_local_ned_message(
        0, a.system, 1, mavlink.MAV_FRAME_LOCAL_NED, _VELOCITY_ALONE, 0, 0, 0, north_m_s, east_m_s, 0, 0, 0, 0, 0, 0
    )
    a.flavour.on_local_target(a, message)


def _change_speed(a: Autopilot, speed_m_s: float) -> None:
    a.flavour.commands[mavlink.MAV_CMD_DO_CHANGE_SPEED](
        a, VehicleCommand(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1.0, speed_m_s, -1.0, 0.0, None, None, 0.0, None, _STATION)
    )


def _command(
    a: Autopilot, number: int, p1: float, latitude: float | None, longitude: float | None, amsl: float
) -> None:
    flags = float(mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE)
    frame = mavlink.MAV_FRAME_GLOBAL_INT
    a.flavour.commands[number](
        a, VehicleCommand(number, p1, flags, 0.0, nan, latitude, longitude, amsl, frame, _STATION)
    )


def _begin(voices: list[Speaker], voice: Speaker) -> None:
    voices.append(voice)


def _end(voices: list[Speaker], voice: Speaker) -> None:
    voices.remove(voice)


def _while(
    things: tuple[object, ...], name: str, value: object, after: object, at_us: int, for_us: int | None
) -> Iterator[Effect]:
    return _for(at_us, for_us, partial(_set, things, name, value), partial(_set, things, name, after))


def _for(at_us: int, for_us: int | None, begin: Callable[[], object], end: Callable[[], object]) -> Iterator[Effect]:
    yield at_us, begin
    if for_us is not None:
        yield at_us + for_us, end


def _set(things: tuple[object, ...], name: str, value: object) -> None:
    for thing in things:
        setattr(thing, name, value)
