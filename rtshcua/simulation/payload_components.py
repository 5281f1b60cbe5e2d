"""The camera and the gimbal of a PX4 vehicle: MAVLink components of their own behind the autopilot's link, which speak
the camera protocol v2 (https://mavlink.io/en/services/camera.html) and the gimbal protocol v2
(https://mavlink.io/en/services/gimbal_v2.html). The gimbal is its own manager.
"""

from collections.abc import Callable, Mapping
from functools import partial
from math import atan, degrees, isfinite, nan, radians
from typing import Final

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec, Message, ReceivedFrame, maker
from rtshcua.simulation.autopilot import Autopilot
from rtshcua.simulation.camera import (
    CAPACITY_MIB,
    FOCAL_MM,
    PIXELS,
    SENSOR_MM,
    Shot,
    SimulatedCamera,
)
from rtshcua.simulation.command import whole
from rtshcua.simulation.commands import ACCEPTED, DENIED, TEMPORARILY_REJECTED, UNSUPPORTED
from rtshcua.simulation.gimbal import PITCH, YAW, SimulatedGimbal
from rtshcua.simulation.streams import Streams

CAMERA: Final = mavlink.MAV_COMP_ID_CAMERA
GIMBAL: Final = mavlink.MAV_COMP_ID_GIMBAL
_HEARTBEAT = maker(mavlink.MAVLink_heartbeat_message)
_COMMAND_ACK = maker(mavlink.MAVLink_command_ack_message)
_SECOND_US = 1_000_000
_NAME_OCTETS = 32

Parameters = tuple[float, ...]
"""The seven parameters of a command."""
Obeys = Callable[[Parameters, tuple[int, int]], int]
"""Obeys a command of (system, component); returns the result to acknowledge with."""


def parameters_of(received: ReceivedFrame) -> Parameters:
    """Return the seven parameters of a COMMAND_LONG or COMMAND_INT."""
    m = received.message
    if received.name == "COMMAND_INT":
        return m.param1, m.param2, m.param3, m.param4, float(m.x), float(m.y), m.z
    return m.param1, m.param2, m.param3, m.param4, m.param5, m.param6, m.param7


def camera_information(boot_ms: int, gimbal: int) -> Message:
    """CAMERA_INFORMATION; `gimbal` is the id of the gimbal that carries the camera, 0 for none."""
    vendor, model = (list(text.ljust(_NAME_OCTETS, b"\0")) for text in (b"rtshcua", b"simulated"))
    flags = mavlink.CAMERA_CAP_FLAGS_CAPTURE_IMAGE | mavlink.CAMERA_CAP_FLAGS_HAS_MODES
    return mavlink.MAVLink_camera_information_message(
        boot_ms, vendor, model, 1, FOCAL_MM, *SENSOR_MM, *PIXELS, 0, flags, 0, b"", gimbal
    )


def camera_settings(boot_ms: int) -> Message:
    """CAMERA_SETTINGS: image mode."""
    return mavlink.MAVLink_camera_settings_message(boot_ms, mavlink.CAMERA_MODE_IMAGE, nan, nan)


def capture_status(camera: SimulatedCamera, boot_ms: int) -> Message:
    """CAMERA_CAPTURE_STATUS."""
    return mavlink.MAVLink_camera_capture_status_message(
        boot_ms, camera.status, 0, camera.interval_s, 0, camera.available_mib, camera.count
    )


def manager_information(boot_ms: int, device: int) -> Message:
    """GIMBAL_MANAGER_INFORMATION of a gimbal with two axes."""
    can = mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_PITCH_AXIS | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_PITCH_LOCK
    can |= mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_YAW_AXIS | mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_YAW_FOLLOW
    can |= mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_YAW_LOCK | mavlink.GIMBAL_MANAGER_CAP_FLAGS_SUPPORTS_INFINITE_YAW
    return mavlink.MAVLink_gimbal_manager_information_message(boot_ms, can, device, 0.0, 0.0, *PITCH, -YAW, YAW)


def _device_flags(gimbal: SimulatedGimbal) -> int:
    level = mavlink.GIMBAL_DEVICE_FLAGS_ROLL_LOCK | mavlink.GIMBAL_DEVICE_FLAGS_PITCH_LOCK
    return int(level | (mavlink.GIMBAL_DEVICE_FLAGS_YAW_LOCK if gimbal.locked else 0))


def manager_status(gimbal: SimulatedGimbal, boot_ms: int, device: int) -> Message:
    """GIMBAL_MANAGER_STATUS: who is in control."""
    return mavlink.MAVLink_gimbal_manager_status_message(
        boot_ms, _device_flags(gimbal), device, *gimbal.in_control, 0, 0
    )


def device_attitude(gimbal: SimulatedGimbal, a: Autopilot, boot_ms: int) -> Message:
    """GIMBAL_DEVICE_ATTITUDE_STATUS: from north with a locked yaw, otherwise from the nose."""
    attitude, flags = gimbal.attitude(a.vehicle.body), _device_flags(gimbal)
    if gimbal.locked:
        flags |= mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_EARTH_FRAME
    else:
        attitude = gimbal.attitude_from_nose
        flags |= mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_VEHICLE_FRAME
    return mavlink.MAVLink_gimbal_device_attitude_status_message(
        0, 0, boot_ms, flags, list(attitude), 0.0, 0.0, 0.0, 0, a.vehicle.body.yaw, 0.0
    )


def pitch_and_yaw(gimbal: SimulatedGimbal, parameters: Parameters) -> None:
    """Obey DO_GIMBAL_MANAGER_PITCHYAW: yaw from north if it is locked or said to be, otherwise from the nose."""
    flags = max(whole(parameters[4]), 0)
    earth = mavlink.GIMBAL_MANAGER_FLAGS_YAW_LOCK | mavlink.GIMBAL_MANAGER_FLAGS_YAW_IN_EARTH_FRAME
    gimbal.point(*(radians(each) if isfinite(each) else nan for each in parameters[:4]), locked=bool(flags & earth))


class PayloadComponent:
    """One component: its heartbeat, streams and commands. Its clock begins with the simulation."""

    #: the type in its HEARTBEAT (MAV_TYPE)
    kind: int
    #: its streams from boot, and their intervals in us
    default: Mapping[int, int]

    def __init__(self, autopilot: Autopilot, system: int, number: int) -> None:
        self.autopilot = autopilot
        self.number = number
        self._system = system
        self._codec = Codec(system, number)
        self._streams = Streams({mavlink.MAVLINK_MSG_ID_HEARTBEAT: _SECOND_US, **self.default})
        self._outbox: list[Message] = []
        self.now_us = 0
        self.builders: dict[int, Callable[[], Message | None]] = {mavlink.MAVLINK_MSG_ID_HEARTBEAT: self._heartbeat}
        self.commands: dict[int, Obeys] = {
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._request,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._interval,
        }

    @property
    def off(self) -> bool:
        """Whether it is silent and deaf."""
        return False

    def is_named(self, received: ReceivedFrame) -> bool:
        """Return whether a command is for this component, or for all."""
        m = received.message
        return (
            received.name in ("COMMAND_LONG", "COMMAND_INT")
            and m.target_system in (0, self._system)
            and m.target_component in (0, self.number)
        )

    def obey(self, received: ReceivedFrame) -> None:
        """Obey a command and queue the answer. A broadcast that it does not know is not answered."""
        if self.off:
            return
        m, sender = received.message, (received.system, received.component)
        obeys = self.commands.get(m.command)
        if obeys is None and m.target_component == 0:
            return
        result = UNSUPPORTED if obeys is None else obeys(parameters_of(received), sender)
        self.send(_COMMAND_ACK(m.command, result, 0, 0, *sender))

    def due(self, now_us: int) -> None:
        """Queue the streams that are due."""
        self.now_us = now_us
        for number in self._streams.due(now_us):
            self.send(self.builders[number]())

    def taken(self) -> list[bytes]:
        """Return the queued frames; none while it is off."""
        messages, self._outbox = self._outbox, []
        if self.off:
            return []
        frames = [self._codec.pack(message) for message in messages]
        signing, now_us = self.autopilot.signing, self.autopilot.now_us
        return [signing.seal(frame, now_us) for frame in frames]

    def send(self, message: Message | None) -> None:
        """Queue a message, unless a fault mutes it."""
        if message is not None and not self.autopilot.reports.is_silent(message.get_msgId()):
            self._outbox.append(message)

    def restart(self) -> None:
        """Forget the streams that were asked for."""
        self._codec = Codec(self._system, self.number)
        self._streams = Streams({mavlink.MAVLINK_MSG_ID_HEARTBEAT: _SECOND_US, **self.default})

    def _heartbeat(self) -> Message:
        return _HEARTBEAT(self.kind, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3)

    def _request(self, parameters: Parameters, sender: tuple[int, int]) -> int:
        build = self.builders.get(whole(parameters[0]))
        if build is None:
            return DENIED
        self.send(build())
        return ACCEPTED

    def _interval(self, parameters: Parameters, sender: tuple[int, int]) -> int:
        number, every = whole(parameters[0]), parameters[1]
        if number not in self.builders or not isfinite(every):
            return DENIED
        self._streams.set(number, whole(every))
        return ACCEPTED


class CameraComponent(PayloadComponent):
    """The camera, component 100."""

    kind = mavlink.MAV_TYPE_CAMERA
    default: Mapping[int, int] = {}

    def __init__(self, autopilot: Autopilot, system: int, camera: SimulatedCamera) -> None:
        super().__init__(autopilot, system, CAMERA)
        self._camera = camera
        camera.report = self._tell
        self._was_off = False
        information, settings, storage, status = (
            mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION, mavlink.MAVLINK_MSG_ID_CAMERA_SETTINGS,
            mavlink.MAVLINK_MSG_ID_STORAGE_INFORMATION, mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS,
        )  # fmt: skip
        self.builders |= {
            information: self._information,
            settings: self._settings,
            storage: self._storage,
            status: self._status,
        }
        self.commands |= {
            mavlink.MAV_CMD_IMAGE_START_CAPTURE: self._start,
            mavlink.MAV_CMD_IMAGE_STOP_CAPTURE: self._stop,
            mavlink.MAV_CMD_SET_CAMERA_MODE: self._set_mode,
            mavlink.MAV_CMD_REQUEST_CAMERA_INFORMATION: partial(self._request_one, information),
            mavlink.MAV_CMD_REQUEST_CAMERA_SETTINGS: partial(self._request_one, settings),
            mavlink.MAV_CMD_REQUEST_STORAGE_INFORMATION: partial(self._request_one, storage),
            mavlink.MAV_CMD_REQUEST_CAMERA_CAPTURE_STATUS: partial(self._request_one, status),
        }

    @property
    def off(self) -> bool:
        """Whether it restarts."""
        return self._camera.off

    def due(self, now_us: int) -> None:
        """Queue the streams that are due; after a restart they begin anew."""
        if self._was_off and not self.off:
            self.restart()
        self._was_off = self.off
        super().due(now_us)

    def _request_one(self, number: int, parameters: Parameters, sender: tuple[int, int]) -> int:
        """Handle the superseded command that requests one message: parameter 1 must be 1."""
        return self._request((float(number),), sender) if whole(parameters[0]) == 1 else DENIED

    def _request(self, parameters: Parameters, sender: tuple[int, int]) -> int:
        if whole(parameters[0]) != mavlink.MAVLINK_MSG_ID_CAMERA_IMAGE_CAPTURED:
            return super()._request(parameters, sender)
        shot = self._camera.image(whole(parameters[1]))
        if shot is None:
            return DENIED
        self.send(self._captured(shot))
        return ACCEPTED

    def _start(self, parameters: Parameters, sender: tuple[int, int]) -> int:
        """Handle IMAGE_START_CAPTURE: one picture with its sequence number, or a series."""
        camera, (_, every, total, sequence, *_) = self._camera, parameters
        if whole(total) != 1:
            if not every > 0 or whole(total) < 0 or camera.full:
                return DENIED
            camera.begin(round(min(every, 1e6) * _SECOND_US), whole(total))
            return ACCEPTED
        if camera.is_taken(whole(sequence)):
            return ACCEPTED
        if camera.full:
            return DENIED
        if not camera.take(max(whole(sequence), 0)):
            return TEMPORARILY_REJECTED
        return ACCEPTED

    def _stop(self, parameters: Parameters, sender: tuple[int, int]) -> int:
        self._camera.stop()
        return ACCEPTED

    def _set_mode(self, parameters: Parameters, sender: tuple[int, int]) -> int:
        return ACCEPTED if whole(parameters[1]) == mavlink.CAMERA_MODE_IMAGE else DENIED

    def _tell(self, shot: Shot) -> None:
        self.send(self._captured(shot))

    def _information(self) -> Message:
        return camera_information(self._camera.boot_ms, 0 if self.autopilot.gimbal is None else GIMBAL)

    def _settings(self) -> Message:
        return camera_settings(self._camera.boot_ms)

    def _status(self) -> Message:
        return capture_status(self._camera, self._camera.boot_ms)

    def _storage(self) -> Message:
        free = self._camera.available_mib
        return mavlink.MAVLink_storage_information_message(
            self._camera.boot_ms, 1, 1, mavlink.STORAGE_STATUS_READY, CAPACITY_MIB, CAPACITY_MIB - free, free, nan, nan
        )

    def _captured(self, shot: Shot) -> Message:
        """CAMERA_IMAGE_CAPTURED: the place that the autopilot estimated at the shutter, heights above sea and home."""
        a = self.autopilot
        latitude, longitude = shot.globe(a.home)
        up = round(shot.believed.up * 1000)
        index = -1 if shot.image is None else shot.image
        return mavlink.MAVLink_camera_image_captured_message(
            self._camera.boot_ms_of(shot), shot.utc_us if a.sensors.receives else 0, 0, latitude, longitude,
            a.home.amsl_mm + up, up, list(shot.attitude.quaternion), index, int(shot.stored),
            b"" if shot.image is None else b"mftp:/DCIM/IMG_%06d.JPG" % shot.number,
        )  # fmt: skip


class GimbalComponent(PayloadComponent):
    """The gimbal, component 154, which is its own gimbal manager."""

    kind = mavlink.MAV_TYPE_GIMBAL
    default: Mapping[int, int] = {
        mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS: 200_000,
        mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS: 200_000,
    }

    def __init__(self, autopilot: Autopilot, system: int, gimbal: SimulatedGimbal) -> None:
        super().__init__(autopilot, system, GIMBAL)
        self._gimbal = gimbal
        self.builders |= {
            mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_INFORMATION: self._information,
            mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS: self._status,
            mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS: self._attitude,
        }
        self.commands |= {
            mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW: self._pitch_yaw,
            mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE: self._configure,
        }

    @property
    def _boot_ms(self) -> int:
        return self.now_us // 1_000

    def _information(self) -> Message:
        return manager_information(self._boot_ms, GIMBAL)

    def _status(self) -> Message:
        return manager_status(self._gimbal, self._boot_ms, GIMBAL)

    def _attitude(self) -> Message:
        return device_attitude(self._gimbal, self.autopilot, self._boot_ms)

    def _pitch_yaw(self, parameters: Parameters, sender: tuple[int, int]) -> int:
        """Turn, if the sender is in primary control."""
        if sender != self._gimbal.in_control or parameters[6] not in (0, GIMBAL):
            return DENIED
        pitch_and_yaw(self._gimbal, parameters)
        return ACCEPTED

    def _configure(self, parameters: Parameters, sender: tuple[int, int]) -> int:
        """Take, give or give back primary control: a system and component, -1 unchanged, -2 the sender, -3 none if it
        was the sender.
        """
        gimbal, system, component = self._gimbal, parameters[0], parameters[1]
        if not isfinite(system) or not -3 <= system <= 255 or parameters[6] not in (0, GIMBAL):
            return DENIED
        if system == -2:
            gimbal.in_control = sender
        elif system == -3:
            gimbal.in_control = (0, 0) if gimbal.in_control == sender else gimbal.in_control
        elif system >= 0:
            gimbal.in_control = whole(system), max(0, min(255, whole(component))) if system else 0
        return ACCEPTED


def components_of(autopilot: Autopilot, system: int) -> tuple[PayloadComponent, ...]:
    """Return the components of a vehicle whose autopilot does not speak for its camera and gimbal."""
    found: list[PayloadComponent] = []
    if not autopilot.flavour.speaks_for_payload:
        if autopilot.camera is not None:
            found.append(CameraComponent(autopilot, system, autopilot.camera))
        if autopilot.gimbal is not None:
            found.append(GimbalComponent(autopilot, system, autopilot.gimbal))
    return tuple(found)


def field_of_view(camera: SimulatedCamera, a: Autopilot, boot_ms: int) -> Message:
    """CAMERA_FOV_STATUS without a place that it looks at (INT32_MAX)."""
    unknown = 2**31 - 1
    latitude, longitude = a.home.globe(a.here.north, a.here.east)
    amsl = a.home.amsl_mm + round(a.here.up * 1000)
    wide, high = (degrees(2 * atan(size / 2 / FOCAL_MM)) for size in SENSOR_MM)
    return mavlink.MAVLink_camera_fov_status_message(
        boot_ms, latitude, longitude, amsl, unknown, unknown, unknown, list(camera.attitude), wide, high
    )
