"""ArduCopter's commands and messages for payloads, as recorded from 4.7: the autopilot triggers the camera
(CAM1_TYPE 1) and moves the gimbal (MNT1_TYPE 1) itself, and answers for them.

An acknowledgement says nothing about a picture: CAMERA_FEEDBACK alone does, by its index and time, because it is also
repeated at a requested rate. As with a feedback pin (CAM1_FEEDBAK_PIN), it is sent when the shutter opens; its index
counts triggers.
"""

from collections.abc import Callable, Mapping
from math import atan2, degrees, hypot, isfinite, nan, radians

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Message
from rtshcua.model.faults import FlightMode
from rtshcua.simulation.autopilot import Autopilot, Builder, Handler
from rtshcua.simulation.camera import SimulatedCamera
from rtshcua.simulation.command import VehicleCommand, whole
from rtshcua.simulation.commands import ACCEPTED, FAILED, UNSUPPORTED
from rtshcua.simulation.gimbal import SimulatedGimbal
from rtshcua.simulation.mission_protocol import AMSL_FRAMES
from rtshcua.simulation.payload_components import (
    camera_information,
    camera_settings,
    capture_status,
    device_attitude,
    field_of_view,
    manager_information,
    manager_status,
    pitch_and_yaw,
)
from rtshcua.simulation.place import Point

_GIMBAL = 1
"""`gimbal_device_id` of its first mount."""
_STANDING_M_S = 1.0
"""A region of interest turns the vehicle while it stands; on a leg the nose follows the leg (recorded)."""
_MOTORS = range(1, 5)
_SHOOT, _ROI_LOCATION = 1, 3
"""Parameter 5 of DO_DIGICAM_CONTROL; parameter 1 of DO_SET_ROI (MAV_ROI_LOCATION)."""


def _parameters(command: VehicleCommand) -> tuple[float, ...]:
    """Return the seven parameters; a COMMAND_LONG has its fifth and sixth as degrees times 1e7 here."""
    scale = 1e7 if command.frame is None else 1.0
    five, six = (nan if each is None else each / scale for each in (command.latitude, command.longitude))
    return command.p1, command.p2, command.p3, command.p4, five, six, command.altitude


def _start(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
    """Handle IMAGE_START_CAPTURE: acknowledged at once. A sequence number that came before is taken again."""
    if a.camera is None:
        return (FAILED,)
    if whole(command.p3) == 1:
        a.camera.take(max(whole(command.p4), 0))
    elif command.p2 > 0 and isfinite(command.p2) and whole(command.p3) >= 0:
        a.camera.begin(round(min(command.p2, 1e6) * 1e6), whole(command.p3))
    else:
        return (FAILED,)
    return (ACCEPTED,)


def _stop(a: Autopilot, _: VehicleCommand) -> tuple[int, ...]:
    if a.camera is not None:
        a.camera.stop()
    return (ACCEPTED,)


def _digicam(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
    if a.camera is not None and whole(_parameters(command)[4]) == _SHOOT:
        a.camera.take()
    return (ACCEPTED,)


def _by_distance(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
    """Handle DO_SET_CAM_TRIGG_DIST: parameter 3 takes the first picture at once."""
    if a.camera is not None and isfinite(command.p1):
        a.camera.by_distance(max(command.p1, 0.0))
        if whole(command.p3) == 1:
            a.camera.take()
    return (ACCEPTED,)


def _zoom(a: Autopilot, _: VehicleCommand) -> tuple[int, ...]:
    return (UNSUPPORTED,) if a.camera is None else (ACCEPTED,)


def _gimbal(obey: Callable[[SimulatedGimbal, tuple[float, ...]], object]) -> Handler:
    """Handle a command for the gimbal: it fails without one, and is accepted whatever its values."""

    def handle(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
        if a.gimbal is None:
            return (FAILED,)
        obey(a.gimbal, _parameters(command))
        return (ACCEPTED,)

    return handle


def _configure(gimbal: SimulatedGimbal, parameters: tuple[float, ...]) -> None:
    system, component = whole(parameters[0]), whole(parameters[1])
    if 0 <= system <= 255 and 0 <= component <= 255:
        gimbal.in_control = system, component


def _mount(gimbal: SimulatedGimbal, parameters: tuple[float, ...]) -> None:
    """Obey DO_MOUNT_CONTROL: pitch, roll and yaw from the nose, in degrees."""
    pitch, _, yaw, *_ = parameters
    gimbal.point(radians(pitch), radians(yaw), nan, nan, locked=False)


def _look_at(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
    """Handle DO_SET_ROI_LOCATION and DO_SET_ROI: the gimbal follows the place. A vehicle that stands in GUIDED turns
    to it, until its next target (recorded).
    """
    located = command.number != mavlink.MAV_CMD_DO_SET_ROI or whole(command.p1) == _ROI_LOCATION
    if not located or command.latitude is None or command.longitude is None or not isfinite(command.altitude):
        return (ACCEPTED,)
    above = command.altitude - a.home.amsl_mm / 1000 if command.frame in AMSL_FRAMES else command.altitude
    place = Point(*a.home.local(command.latitude, command.longitude), above)
    if a.gimbal is not None:
        a.gimbal.look_at(place)
    vehicle, body = a.vehicle, a.vehicle.body
    if vehicle.mode is FlightMode.GUIDED and vehicle.flies and hypot(body.v_north, body.v_east) < _STANDING_M_S:
        vehicle.turn_to(atan2(place.east - body.east, place.north - body.north))
    return (ACCEPTED,)


def _look_away(a: Autopilot, _: VehicleCommand) -> tuple[int, ...]:
    if a.gimbal is not None:
        a.gimbal.look_at(None)
    return (ACCEPTED,)


def _servo(a: Autopilot, command: VehicleCommand) -> tuple[int, ...]:
    """Handle DO_SET_SERVO: any channel but a motor's."""
    if whole(command.p1) not in _MOTORS:
        return (ACCEPTED,)
    text = f"ServoRelayEvent: Channel {whole(command.p1)} is already in use"
    a.say(mavlink.MAV_SEVERITY_INFO, text)
    return (FAILED,)


def _always(result: int) -> Handler:
    return lambda a, command: (result,)


PAYLOAD_COMMANDS: Mapping[int, Handler] = {
    mavlink.MAV_CMD_IMAGE_START_CAPTURE: _start,
    mavlink.MAV_CMD_IMAGE_STOP_CAPTURE: _stop,
    mavlink.MAV_CMD_DO_DIGICAM_CONTROL: _digicam,
    mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST: _by_distance,
    mavlink.MAV_CMD_SET_CAMERA_ZOOM: _zoom,
    mavlink.MAV_CMD_VIDEO_START_CAPTURE: _always(FAILED),
    mavlink.MAV_CMD_VIDEO_STOP_CAPTURE: _always(FAILED),
    mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE: _gimbal(_configure),
    mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW: _gimbal(pitch_and_yaw),
    mavlink.MAV_CMD_DO_MOUNT_CONTROL: _gimbal(_mount),
    mavlink.MAV_CMD_DO_MOUNT_CONFIGURE: _gimbal(lambda gimbal, parameters: None),
    mavlink.MAV_CMD_DO_SET_ROI_LOCATION: _look_at,
    mavlink.MAV_CMD_DO_SET_ROI: _look_at,
    mavlink.MAV_CMD_DO_SET_ROI_NONE: _look_away,
    mavlink.MAV_CMD_DO_SET_ROI_SYSID: _always(ACCEPTED),
    mavlink.MAV_CMD_DO_GRIPPER: _always(FAILED),
    mavlink.MAV_CMD_DO_SET_SERVO: _servo,
    mavlink.MAV_CMD_DO_SET_RELAY: _always(ACCEPTED),
    mavlink.MAV_CMD_DO_WINCH: _always(FAILED),
    mavlink.MAV_CMD_DO_SPRAYER: _always(ACCEPTED),
}
"""The commands; those that are missing here are unsupported."""


def _of_camera(build: Callable[[Autopilot, SimulatedCamera], Message]) -> Builder:
    """A message of the camera; without one it is acknowledged and not sent (recorded)."""
    return lambda a: None if a.camera is None else build(a, a.camera)


def _of_gimbal(build: Callable[[Autopilot, SimulatedGimbal], Message]) -> Builder:
    return lambda a: None if a.gimbal is None else build(a, a.gimbal)


def _feedback(a: Autopilot, camera: SimulatedCamera) -> Message:
    """CAMERA_FEEDBACK: the present index, and place, attitude of the vehicle and time of the last shutter."""
    shot, index, completed = camera.last, camera.count % 65_536, camera.completed % 65_536
    if shot is None:
        return mavlink.MAVLink_camera_feedback_message(0, 0, 0, index, 0, 0, *[0.0] * 6, 0, completed)
    latitude, longitude = shot.globe(a.home)
    amsl = a.home.amsl_mm / 1000 + shot.believed.up
    return mavlink.MAVLink_camera_feedback_message(
        shot.utc_us, 0, 0, index, latitude, longitude, amsl, shot.believed.up, *map(degrees, shot.vehicle), 0.0,
        mavlink.CAMERA_FEEDBACK_PHOTO, completed,
    )  # fmt: skip


PAYLOAD_BUILDERS: Mapping[int, Builder] = {
    mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION: _of_camera(
        lambda a, camera: camera_information(a.boot_ms, 0 if a.gimbal is None else _GIMBAL)
    ),
    mavlink.MAVLINK_MSG_ID_CAMERA_SETTINGS: _of_camera(lambda a, camera: camera_settings(a.boot_ms)),
    mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS: _of_camera(lambda a, camera: capture_status(camera, a.boot_ms)),
    mavlink.MAVLINK_MSG_ID_CAMERA_FOV_STATUS: _of_camera(lambda a, camera: field_of_view(camera, a, a.boot_ms)),
    mavlink.MAVLINK_MSG_ID_CAMERA_FEEDBACK: _of_camera(_feedback),
    mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_INFORMATION: _of_gimbal(
        lambda a, gimbal: manager_information(a.boot_ms, _GIMBAL)
    ),
    mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_STATUS: _of_gimbal(
        lambda a, gimbal: manager_status(gimbal, a.boot_ms, _GIMBAL)
    ),
    mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS: _of_gimbal(
        lambda a, gimbal: device_attitude(gimbal, a, a.boot_ms)
    ),
}
"""The messages; without a camera or gimbal they are empty."""
