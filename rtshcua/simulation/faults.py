"""What can be made to go wrong. `at_us` is the simulation's time, from its start; `for_us` None means for good."""

from dataclasses import dataclass

from rtshcua.simulation.modes import Mode


@dataclass(frozen=True, slots=True)
class BatteryLevel:
    """The battery is found to hold no more than this, in 1/10000."""

    at_us: int
    level: int


@dataclass(frozen=True, slots=True)
class GpsLoss:
    """The receiver loses its fix."""

    at_us: int
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class GpsJump:
    """The receiver is off by this much more from now on."""

    at_us: int
    north_mm: int
    east_mm: int


@dataclass(frozen=True, slots=True)
class GpsGlitch:
    """The receiver alone is off by this; the estimator does not believe it, and gives up after a while."""

    at_us: int
    north_mm: int
    east_mm: int
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class BatteryVoltage:
    """This voltage is measured from now on, whatever the battery holds."""

    at_us: int
    voltage_mv: int


@dataclass(frozen=True, slots=True)
class WindStep:
    """The mean wind changes to this speed, from this direction; gusts end unless given."""

    at_us: int
    speed_mm_s: int
    from_deg: int = 0
    gust_mm_s: int = 0


@dataclass(frozen=True, slots=True)
class LinkDelay:
    """Every datagram takes this much longer, in both directions."""

    at_us: int
    delay_us: int


@dataclass(frozen=True, slots=True)
class LinkLoss:
    """This part of the datagrams, in 1/10000, is lost in each direction; RADIO_STATUS tells."""

    at_us: int
    loss: int


@dataclass(frozen=True, slots=True)
class LinkSilence:
    """Nothing gets through, in either direction."""

    at_us: int
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class LinkQuality:
    """RADIO_STATUS tells of this quality, in 1/10000, though nothing is lost yet."""

    at_us: int
    quality: int


@dataclass(frozen=True, slots=True)
class Obstacle:
    """The sensor sees something ahead at this distance, and goes on seeing it there wherever the vehicle goes."""

    at_us: int
    distance_mm: int
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class Pillar:
    """A round thing stands in the world, from the ground up: what is seen of it depends on where the vehicle is.

    The place of its middle, and its height, are from home. Who flies into it crashes.
    """

    at_us: int
    north_mm: int
    east_mm: int
    radius_mm: int
    height_mm: int
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class PilotMode:
    """The pilot takes over with the mode switch."""

    at_us: int
    mode: Mode = Mode.POSITION


Fault = (
    BatteryLevel
    | GpsLoss
    | GpsJump
    | GpsGlitch
    | BatteryVoltage
    | WindStep
    | LinkDelay
    | LinkLoss
    | LinkSilence
    | LinkQuality
    | Obstacle
    | Pillar
    | PilotMode
)
