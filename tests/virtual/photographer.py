"""A ground station that takes pictures in a virtual flight, and compares what was recorded with what truly happened."""

from collections.abc import Callable, Sequence
from random import Random
from typing import Any

import msgspec
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from rtshcua.codec.frames import Codec
from rtshcua.evidence.image_records import ImageDetail, MissingDetail
from rtshcua.onboard.ports import Event
from rtshcua.simulation.config import AutopilotKind
from virtual.flight import Flight, Flown

S = 1_000_000
CAMERA, GIMBAL = 100, 154


class Photographer:
    """Takes a picture at an interval while the vehicle is in the air. `lost`: the part of the camera's reports that do
    not arrive; those in `never` never do.
    """

    def __init__(
        self, flight: Flight, every_us: int = S, *, lost: float = 0.0, never: Callable[[Any], bool] = lambda m: False
    ) -> None:
        self._codec, self._reader = Codec(255, 190), Codec(255, 190)
        self._due_us, self._every_us, self._sequence = 0, every_us, 0
        self._lost, self._never, self._chance = lost, never, Random(5)
        self._known: set[int] = set()
        self.asked = 0
        flight.vehicle.hurt = self._hurt
        flight.vehicle.driver.images.expected = True

    def __call__(self, flight: Flight) -> Sequence[Event]:
        simulation, now_us = flight.vehicle.simulation, flight.clock.elapsed_us
        if simulation.truth().in_air and now_us >= self._due_us:
            self._due_us = now_us + self._every_us
            self._sequence += 1
            self.send(flight, 2000, 0, 0, 1, self._sequence)
        return ()

    def send(self, flight: Flight, command: int, *parameters: float, component: int = CAMERA) -> None:
        padded = [*parameters, *[0.0] * (7 - len(parameters))]
        frame = self._codec.pack(mavlink.MAVLink_command_long_message(1, component, command, 0, *padded))
        flight.vehicle._waiting += flight.vehicle.simulation.receive(frame, flight.clock.elapsed_us)

    def _hurt(self, datagram: bytes) -> Sequence[bytes]:
        """Lose reports of images, each at its first arrival."""
        for received in self._reader.parse(datagram):
            m = received.message
            if received.name == "CAMERA_IMAGE_CAPTURED":
                if self._never(m):
                    return ()
                if m.image_index not in self._known:
                    self._known.add(m.image_index)
                    return () if self._chance.random() < self._lost else (datagram,)
                self.asked += 1
        return (datagram,)


def details_of(flown: Flown) -> list[ImageDetail]:
    return [msgspec.json.decode(each["detail"], type=ImageDetail) for each in flown.effects("image")]


def gaps_of(flown: Flown) -> list[MissingDetail]:
    return [msgspec.json.decode(each["detail"], type=MissingDetail) for each in flown.effects("images-missing")]


def agree_with_truth(flown: Flown, flavour: str, within_mm: int = 200) -> None:
    """Every recorded image was taken, where and looking where its record says; every one that was taken is recorded or
    listed as missing.
    """
    simulation = flown.vehicle.simulation
    home = simulation._autopilot.home
    stored = {shot.utc_us: shot for shot in simulation.shots if shot.stored}
    recorded = [each for each in details_of(flown) if each.index is not None]
    for image in recorded:
        assert image.utc_us is not None
        shot = stored[image.utc_us]
        assert image.latitude is not None
        assert image.longitude is not None
        north, east = home.local(image.latitude, image.longitude)
        assert abs(north * 1_000 - shot.north_mm) < within_mm
        assert abs(east * 1_000 - shot.east_mm) < within_mm
        assert image.above_home_mm is not None
        assert abs(image.above_home_mm - shot.up_mm) < within_mm
        assert image.above_sea_mm == image.above_home_mm + home.amsl_mm
        looks = (shot.roll_cd, shot.pitch_cd, shot.yaw_cd)
        if flavour == AutopilotKind.ARDUPILOT:
            looks = tuple(round(each * 18_000 / 3.141592653589793) for each in shot.vehicle)
        told = (image.roll_cd, image.pitch_cd, image.yaw_cd)
        for one, other in zip(told, looks, strict=True):
            assert one is not None
            assert abs((one - other + 18_000) % 36_000 - 18_000) <= 2, (told, looks)
        assert image.attitude == ("vehicle" if flavour == AutopilotKind.ARDUPILOT else "camera")
    times = [each.utc_us for each in recorded]
    assert len(times) == len(set(times))
