"""A simulated camera: pictures are effects of the simulated world, with the true place, attitude and time of the
shutter. `payload_components` and `ardupilot.payload_commands` report them by MAVLink.
"""

from collections.abc import Callable
from math import degrees, hypot, pi
from random import Random
from typing import Final, NamedTuple

from rtshcua.model.faults import CameraCounter
from rtshcua.simulation.gimbal import Angles, Quaternion, SimulatedGimbal, angles, product
from rtshcua.simulation.kinematics import Body
from rtshcua.simulation.place import HomePosition, Point

SHUTTER_US: Final = 60_000
"""From the command to the opening of the shutter."""
STORING_US: Final = 400_000
"""From the shutter to the stored and reported picture. No other picture is taken before that."""
CAPACITY_MIB, IMAGE_MIB = 32_000.0, 12.0
FOCAL_MM, SENSOR_MM, PIXELS = 8.8, (13.2, 8.8), (5_472, 3_648)
"""Focal length, size of the sensor and resolution."""
_DOWN: Final = Angles(0.0, -pi / 2, 0.0).quaternion
_KEPT: Final = 10_000
"""How many images of the present boot can be requested again."""


class Shot(NamedTuple):
    """One release of the shutter, as it truly was; mm from home, 1e-7 degree, 1/100 degree, us."""

    number: int
    """Which release it is since the start of the simulation, from 1."""
    sequence: int
    """The sequence number of its command; 0 for none."""
    image: int | None
    """The index under which the camera reports the image; None if there is no image."""
    at_us: int
    utc_us: int
    north_mm: int
    east_mm: int
    up_mm: int
    roll_cd: int
    """The attitude of the camera."""
    pitch_cd: int
    yaw_cd: int
    believed: Point
    """The place that the autopilot estimated, which the camera writes into its report."""
    vehicle: Angles
    """The attitude of the vehicle."""

    @property
    def attitude(self) -> Angles:
        """The attitude of the camera in radians."""
        return Angles(*(pi * each / 18_000 for each in (self.roll_cd, self.pitch_cd, self.yaw_cd)))

    @property
    def stored(self) -> bool:
        """Whether there is an image."""
        return self.image is not None

    def globe(self, home: HomePosition) -> tuple[int, int]:
        """Return the believed latitude and longitude, 1e-7 degree."""
        return home.globe(self.believed.north, self.believed.east)


class _Series(NamedTuple):
    every_us: int
    left: int | None
    """How many pictures are to come; None: without end."""
    due_us: int | None
    """None: now."""


class SimulatedCamera:
    """One camera, mounted on the gimbal, or looking down without one.

    `where` returns the estimated position. Chance decides which pictures are lost. Times are those of the simulation.
    A camera that is `triggered` by the autopilot has no counter of its own: the autopilot counts its triggers from 1,
    and each has an index whether or not the shutter opens. Otherwise stored images are counted from 0.
    """

    def __init__(
        self, chance: Random, body: Callable[[], Body], where: Callable[[], Point], gimbal: SimulatedGimbal | None,
        utc_us: int, *, triggered: bool,
    ) -> None:  # fmt: skip
        self._triggered = triggered
        self._chance, self._body, self._where, self._gimbal, self._utc_us = chance, body, where, gimbal, utc_us
        self.now_us = self._booted_us = 0
        self.shots: list[Shot] = []
        """Every release of the shutter since the start of the simulation."""
        self.loss = 0
        """The share of pictures for which the shutter does not open, in 1/10000."""
        self.slow_us = 0
        """How much longer a picture takes."""
        self.full = False
        self.off = False
        """Whether it restarts now."""
        self.count = 0
        """How many images, or triggers, it counts."""
        self.last: Shot | None = None
        """The last stored picture since the counter began."""
        self.completed = 0
        """How many pictures were stored since then."""
        self._released = self._last_sequence = 0
        self._opens: tuple[int, int] | None = None  # when the shutter opens, and for which sequence number
        self._storing: tuple[int, Shot] | None = None  # when it is stored
        self._series: _Series | None = None
        self._kept: dict[int, Shot] = {}
        self._stored = 0
        self._apart_m = 0.0
        self._last_place: Point | None = None
        #: called for each picture that is due for a report, also for a lost one
        self.report: Callable[[Shot], object] = lambda shot: None

    # ------------------------------------------------------------------------------------------- commands

    def take(self, sequence: int = 0) -> bool:
        """Release the shutter; return False if another picture is under way."""
        if self._triggered:
            self.count += 1
        if self.busy or self.off:
            return False
        self._opens, self._last_sequence = (self.now_us + SHUTTER_US, sequence), sequence
        return True

    def is_taken(self, sequence: int) -> bool:
        """Return whether the last picture was commanded by the same sequence number: its command came twice."""
        return 0 < sequence == self._last_sequence

    def begin(self, every_us: int, total: int) -> None:
        """Take a picture now and at this interval, `total` in all (0: without end)."""
        self._series = _Series(max(every_us, 1), total or None, None)

    def by_distance(self, metres: float) -> None:
        """Take a picture at each distance flown; 0 ends that."""
        self._apart_m, self._last_place = metres, self._where()

    def stop(self) -> None:
        """End a series."""
        self._series, self._apart_m = None, 0.0

    def restart(self, counter: CameraCounter) -> None:
        """Begin to restart: a picture under way is lost, and so is a series."""
        if self._storing is not None:
            self._end(self._storing[1]._replace(image=None), tells=False)
        self.stop()
        self._opens = self._storing = None
        self._kept.clear()
        self._last_sequence, self.off = 0, True
        if counter is CameraCounter.RESTARTS and not self._triggered:
            self.forget()

    def forget(self) -> None:
        """Restart the counter."""
        self.count = self.completed = 0
        self.last = None

    def started(self) -> None:
        """End a restart."""
        self.off, self._booted_us = False, self.now_us

    # --------------------------------------------------------------------------------------------- state

    @property
    def busy(self) -> bool:
        """Whether a picture is under way."""
        return self._opens is not None or self._storing is not None

    @property
    def boot_ms(self) -> int:
        """The time since its start."""
        return (self.now_us - self._booted_us) // 1_000

    def boot_ms_of(self, shot: Shot) -> int:
        """The time of a picture since its start."""
        return max(0, shot.at_us - self._booted_us) // 1_000

    @property
    def utc_us(self) -> int:
        """The time of day."""
        return self._utc_us + self.now_us

    @property
    def status(self) -> int:
        """CAMERA_CAPTURE_STATUS.image_status: 1 captures, 2 and 3 the same during a series."""
        return (2 if self._series is not None else 0) + (1 if self.busy else 0)

    @property
    def interval_s(self) -> float:
        """The interval of the series; 0 without one."""
        return 0.0 if self._series is None else self._series.every_us / 1_000_000

    @property
    def available_mib(self) -> float:
        """The free storage."""
        return 0.0 if self.full else max(0.0, CAPACITY_MIB - self._stored * IMAGE_MIB)

    def image(self, index: int) -> Shot | None:
        """Return an image of the present boot by its index."""
        return self._kept.get(index)

    # -------------------------------------------------------------------------------------------- in time

    @property
    def attitude(self) -> Quaternion:
        """The attitude of the camera now."""
        body = self._body()
        if self._gimbal is not None:
            return self._gimbal.attitude(body)
        return product(Angles(body.roll, body.pitch, body.yaw).quaternion, _DOWN)

    def step(self, now_us: int) -> None:
        """Advance to a time: open the shutter, store pictures, continue a series."""
        self.now_us = now_us
        if self.off:
            return
        if self._storing is not None and now_us >= self._storing[0]:
            (_, shot), self._storing = self._storing, None
            self._end(shot, tells=True)
        if self._opens is not None and now_us >= self._opens[0]:
            (_, sequence), self._opens = self._opens, None
            self._open(sequence)
        if self._series is not None:
            every_us, left, due_us = self._series
            due_us = now_us if due_us is None else due_us
            if now_us >= due_us:
                self.take()  # not taken if the last one is not stored yet
                left = None if left is None else left - 1
                self._series = None if left == 0 else _Series(every_us, left, due_us + every_us)
        if self._apart_m > 0:
            here, last = self._where(), self._last_place
            if last is None or hypot(here.north - last.north, here.east - last.east) >= self._apart_m:
                self._last_place = here
                self.take()

    def _open(self, sequence: int) -> None:
        body = self._body()
        vehicle = Angles(body.roll, body.pitch, body.yaw)
        looks = angles(self.attitude)
        self._released += 1
        shot = Shot(
            self._released, sequence, None, self.now_us, self.utc_us,
            round(body.north * 1000), round(body.east * 1000), round(body.up * 1000), round(degrees(looks.roll) * 100),
            round(degrees(looks.pitch) * 100), round(degrees(looks.yaw) * 100), self._where(), vehicle,
        )  # fmt: skip
        lost = bool(self.loss) and self._chance.randrange(10_000) < self.loss
        if not (lost or self.full):
            shot = shot._replace(image=self.count)
            self.count += not self._triggered
        self._storing = self.now_us + STORING_US + self.slow_us, shot

    def _end(self, shot: Shot, *, tells: bool) -> None:
        self.shots.append(shot)
        if shot.image is not None:
            self._stored += 1
            self.completed += 1
            self.last = shot
            self._kept[shot.image] = shot
            if len(self._kept) > _KEPT:
                del self._kept[next(iter(self._kept))]
        if tells:
            self.report(shot)
