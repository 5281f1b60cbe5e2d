"""A camera and a gimbal at the level of frames, beside the simulated vehicle or inside its autopilot."""

from collections.abc import Callable, Sequence
from math import cos, radians, sin
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as m

from rtshcua.codec.frames import Codec, ReceivedFrame
from rtshcua.mavlink.framing import unsigned
from rtshcua.onboard.enforcement.payload_gate import COMMANDS
from rtshcua.virtual.vehicle import VirtualVehicle

CAMERA, GIMBAL, AUTOPILOT, OURS = 100, 154, 1, 191


class PayloadStandIn:
    """Answers commands to payload. `apart`: as components of their own, which send heartbeats; else as the autopilot.

    `answers` decides the result of a command (None: no answer); `captures` whether a picture is taken and reported.
    `heard` are the frames of payload commands that arrived: command, component, confirmation and parameters.
    """

    def __init__(self, vehicle: VirtualVehicle, *, apart: bool) -> None:
        self.vehicle = vehicle
        self.apart = apart
        self.answers: Callable[[Any], int | None] = lambda command: 0
        self.captures: Callable[[int], bool] = lambda number: True
        self.heard: list[tuple[int, int, int, tuple[float, ...]]] = []
        self.pitch = self.yaw = 0.0
        self.images = 0
        self._queue: list[bytes] = []
        self._codecs: dict[int, Codec] = {}
        self._reader = Codec(0, 0)
        self._beat_us = 0
        vehicle.lose, vehicle.hurt = self._takes, self._adds

    @property
    def system(self) -> int:
        return self.vehicle.driver.system or 1

    def said(self, command: int) -> list[tuple[float, ...]]:
        """The parameters of each such command, without repetitions."""
        return [numbers for number, _, again, numbers in self.heard if number == command and not again]

    def _send(self, component: int, message: Any) -> None:
        codec = self._codecs.setdefault(component, Codec(self.system, component))
        self._queue.append(codec.pack(message))

    def _takes(self, frame: bytes) -> bool:
        """Take in a frame to the vehicle; return whether the autopilot gets nothing of it."""
        found: Sequence[ReceivedFrame] = self._reader.parse(unsigned(frame), 0)
        if not found or found[0].name != "COMMAND_LONG":
            return False
        command = found[0].message
        if command.command == m.MAV_CMD_REQUEST_MESSAGE and command.param1 == 285:
            self._tell_attitude()
            return command.target_component != AUTOPILOT
        if command.command not in COMMANDS:
            return False
        numbers = tuple(getattr(command, f"param{index}") for index in range(1, 8))
        self.heard.append((command.command, command.target_component, command.confirmation, numbers))
        result = self.answers(command)
        if result is not None:
            self._obey(command, result)
        return True

    def _obey(self, command: Any, result: int) -> None:
        component = command.target_component
        self._send(component, m.MAVLink_command_ack_message(command.command, result, 0, 0, self.system, OURS))
        if result:
            return
        if command.command == m.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW:
            self.pitch, self.yaw = command.param1, command.param2
        if command.command in (m.MAV_CMD_IMAGE_START_CAPTURE, m.MAV_CMD_DO_DIGICAM_CONTROL):
            self.images += 1
            if not self.captures(self.images):
                return
            if component == CAMERA:
                self._send(component, m.MAVLink_camera_image_captured_message(
                    0, 0, 0, 0, 0, 0, 0, [1.0, 0.0, 0.0, 0.0], self.images, 1, b""
                ))  # fmt: skip
            else:
                self._send(component, m.MAVLink_camera_feedback_message(0, 0, 0, self.images, *[0] * 9))

    def _tell_attitude(self) -> None:
        half = radians(self.pitch) / 2
        quaternion = [cos(half), 0.0, sin(half), 0.0]
        component = GIMBAL if self.apart else AUTOPILOT
        self._send(component, m.MAVLink_gimbal_device_attitude_status_message(
            0, 0, 0, 32, quaternion, 0, 0, 0, 0
        ))  # fmt: skip

    def _adds(self, datagram: bytes) -> list[bytes]:
        now_us = self.vehicle.clock.elapsed_us
        if self.apart and now_us >= self._beat_us:
            self._beat_us = now_us + 1_000_000
            self._send(CAMERA, m.MAVLink_heartbeat_message(m.MAV_TYPE_CAMERA, 8, 0, 0, 4, 3))
            self._send(GIMBAL, m.MAVLink_heartbeat_message(m.MAV_TYPE_GIMBAL, 8, 0, 0, 4, 3))
        queue, self._queue = self._queue, []
        return [datagram, *queue]
