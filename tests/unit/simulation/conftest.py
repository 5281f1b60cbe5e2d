"""A ground station in virtual time that flies the simulated vehicle by MAVLink, in the test process."""

from collections.abc import Callable
from copy import copy
from math import nan
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec, ReceivedFrame
from rtshcua.model.faults import FlightMode
from rtshcua.simulation.config import AutopilotKind, SimulationConfig
from rtshcua.simulation.world import Simulation
from virtual.copying import copied

SECOND = 1_000_000
#: a pilot that has only waited for a ready vehicle counts as unused
BEGINNING_US = 1_500_000


class Pilot:
    """Sends commands and stores every received frame."""

    def __init__(self, flavour: str, station: bool = True, **config: Any) -> None:
        self.px4 = flavour == "px4"
        self.config = SimulationConfig(flavour=AutopilotKind(flavour), **config)
        self.simulation = Simulation(self.config)
        self.codec = Codec(255, 190)
        self.seen: list[ReceivedFrame] = []
        self.sent: list[bytes] = []
        self._sent_us: list[int] = []
        if station:
            self.send(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3))

    # ------------------------------------------------------------------------------------------ talking

    def send(self, message: Any) -> list[ReceivedFrame]:
        self.sent.append(self.codec.pack(message))
        self._sent_us.append(self.simulation.now_us)
        return self.take(self.simulation.receive(self.sent[-1], self.simulation.now_us))

    def take(self, datagrams: list[bytes]) -> list[ReceivedFrame]:
        received = [frame for datagram in datagrams for frame in self.codec.parse(datagram)]
        self.seen += received
        return received

    def wait(self, seconds: float) -> list[ReceivedFrame]:
        return self.take(self.simulation.advance(self.simulation.now_us + round(seconds * SECOND)))

    def until(self, reached: Callable[[], bool], seconds: float = 300) -> None:
        end_us = self.simulation.now_us + round(seconds * SECOND)
        while not reached():
            assert self.simulation.now_us < end_us, f"not reached: {self.simulation.truth()}"
            self.wait(0.1)

    def long(self, command: int, *params: float, system: int = 1, component: int = 1) -> list[int]:
        padded = [*params, *[0.0] * (7 - len(params))]
        return acks(self.send(mavlink.MAVLink_command_long_message(system, component, command, 0, *padded)), command)

    def int(self, command: int, frame: int, params: list[float], x: int, y: int, z: float) -> list[int]:
        message = mavlink.MAVLink_command_int_message(1, 1, frame, command, 0, 0, *params, x, y, z)
        return acks(self.send(message), command)

    def mode(self, mode: FlightMode) -> list[int]:
        number = self.simulation._autopilot.flavour.modes.numbers[mode]
        if self.px4:
            return self.long(mavlink.MAV_CMD_DO_SET_MODE, 1, number >> 16 & 0xFF, number >> 24)
        return self.long(mavlink.MAV_CMD_DO_SET_MODE, 1, number)

    def pause(self) -> list[int]:
        """Send PX4's DO_REPOSITION without place, height and heading, which stops the vehicle."""
        return self.long(mavlink.MAV_CMD_DO_REPOSITION, -1, 1, 0, nan, nan, nan, nan)

    # ------------------------------------------------------------------------------------------- flying

    def ready(self) -> "Pilot":
        self.wait(1.5)
        return self

    def arm(self) -> list[int]:
        return self.long(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)

    def take_off(self, up_m: float = 20) -> None:
        """Climb. Equal beginnings are flown once and copied."""
        now_us = self.simulation.now_us
        if now_us > BEGINNING_US or self.simulation._events:
            self._take_off(up_m)
            return
        begun = (repr(self.config), tuple(zip(self._sent_us, self.sent, strict=True)), now_us, up_m)
        if begun not in CLIMBED:
            self._take_off(up_m)
            CLIMBED[begun] = self._copied()
        self.__dict__ = CLIMBED[begun]._copied().__dict__

    def _copied(self) -> "Pilot":
        made = copy(self)
        made.simulation, made.codec = copied(self.simulation), copied(self.codec)
        made.seen, made.sent, made._sent_us = list(self.seen), list(self.sent), list(self._sent_us)
        return made

    def _take_off(self, up_m: float) -> None:
        self.ready()
        if not self.px4:
            assert self.mode(FlightMode.GUIDED) == [0]
        assert self.arm() == [0]
        altitude = up_m + self.config.home.amsl_mm / 1000 if self.px4 else up_m
        assert self.long(mavlink.MAV_CMD_NAV_TAKEOFF, -1, 0, 0, nan, nan, nan, altitude) == [0]
        self.until(lambda: abs(self.truth.up_mm - up_m * 1000) < 300 and self.truth.climb_mm_s < 200)
        self.wait(2)

    def go_to(self, north_m: float, east_m: float, up_m: float) -> None:
        latitude, longitude = self.config.home.globe(north_m, east_m)
        if self.px4:
            altitude = up_m + self.config.home.amsl_mm / 1000
            assert self.int(192, 5, [-1, 1, 0, nan], latitude, longitude, altitude) == [0]
        else:
            self.target(latitude, longitude, up_m)

    def target(self, latitude: int, longitude: int, altitude: float, frame: int = 6, mask: int = 0xFF8) -> None:
        self.send(
            mavlink.MAVLink_set_position_target_global_int_message(
                0, 1, 1, frame, mask, latitude, longitude, altitude, 0, 0, 0, 0, 0, 0, 0, 0
            )
        )

    # -------------------------------------------------------------------------------------------- seeing

    @property
    def truth(self) -> Any:
        return self.simulation.truth()

    def last(self, name: str) -> Any:
        return next(frame.message for frame in reversed(self.seen) if frame.name == name)

    def texts(self) -> list[str]:
        return [frame.message.text for frame in self.seen if frame.name == "STATUSTEXT"]


#: keyed by configuration, earlier messages with their times, the current time, and the height
CLIMBED: dict[tuple[str, tuple[tuple[int, bytes], ...], int, float], Pilot] = {}


def acks(received: list[ReceivedFrame], command: int) -> list[int]:
    return [f.message.result for f in received if f.name == "COMMAND_ACK" and f.message.command == command]


@pytest.fixture
def pilot() -> Callable[..., Pilot]:
    return Pilot


@pytest.fixture(params=["px4", "ardupilot"])
def flavour(request: pytest.FixtureRequest) -> str:
    name: str = request.param
    return name
