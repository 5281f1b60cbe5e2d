"""What a simulation is made from. Two simulations of equal configuration that hear the same say the same."""

from dataclasses import dataclass
from enum import StrEnum

from rtshcua.mavlink.signing import KEY_OCTETS
from rtshcua.model.faults import Fault
from rtshcua.simulation.place import HomePosition
from rtshcua.simulation.surroundings import Wind

HOME = HomePosition(473_977_400, 85_455_900, 488_000)
"""Where PX4's simulations start: an airfield in Zurich."""


class AutopilotKind(StrEnum):
    """Which autopilot the vehicle behaves like."""

    PX4 = "px4"
    ARDUPILOT = "ardupilot"


class Boot(StrEnum):
    """How long sensors and estimator take to come up."""

    FAST = "fast"
    """All of it in a second, and without the texts: for tests and demonstrations."""
    RECORDED = "recorded"
    """As the real one does: PX4 in 5 s, ArduCopter in 42 s."""


class Answers(StrEnum):
    """How long the autopilot takes to obey and answer."""

    AT_ONCE = "at-once"
    """No time: when a datagram has come it is obeyed. Streams begin together."""
    RECORDED = "recorded"
    """As the real one did: milliseconds, each time others; requests overtake commands. Streams begin at any time."""


class Estimate(StrEnum):
    """How near what the estimator believes is to what is."""

    CLOSE = "close"
    """Centimetres."""
    REAL = "real"
    """As with a satellite receiver: a metre off, slowly straying, and late."""


class Equipment(StrEnum):
    """What may be fitted beside GPS, barometer and battery, and what the vehicle then tells."""

    RADIO = "radio"
    """A SiK radio in the link: RADIO_STATUS, as system 51 and component 68."""
    RANGE = "range"
    """Range finders ahead and all around: DISTANCE_SENSOR with orientation 0, OBSTACLE_DISTANCE."""
    ALTIMETER = "altimeter"
    """A range finder that looks down, as PX4's own simulation has: DISTANCE_SENSOR with orientation 25."""
    WIND = "wind"
    """It is tuned to estimate the wind by its drag, which it does in the air."""
    VOLTAGE = "voltage"
    """The battery's voltage is measured."""


STOCK = frozenset({Equipment.VOLTAGE})
"""A stock vehicle: GPS, barometer and battery alone, of which SYS_STATUS carries the voltage."""
EQUIPPED = frozenset({Equipment.RADIO, Equipment.RANGE, Equipment.WIND, Equipment.VOLTAGE})


class Purpose(StrEnum):
    """What a battery feeds, as BATTERY_STATUS says it."""

    FLIGHT = "flight"
    """MAV_BATTERY_FUNCTION_ALL: drained as the first one is."""
    PROPULSION = "propulsion"
    """The same of the motors alone."""
    AVIONICS = "avionics"
    """Feeds no motor: its level stays."""
    PAYLOAD = "payload"
    """The same."""


@dataclass(frozen=True, slots=True)
class OtherBattery:
    """A battery beside the first one: what it feeds, and its level at the start, in 1/10000."""

    purpose: Purpose
    level: int
    every_us: int = 0
    """It is reported no more often than this: a smart battery on a slow bus. 0: in turn with the others."""


@dataclass(frozen=True, slots=True)
class SimulationConfig:
    """All that can be chosen; integers in mm, mm/s, us, 1e-7 degree and 1/10000."""

    flavour: AutopilotKind = AutopilotKind.PX4
    system: int = 1
    home: HomePosition = HOME
    battery: int = 10_000
    other_batteries: tuple[OtherBattery, ...] = ()
    """Those with the ids from 1 on; each is reported in turn with the first."""
    gauge_rise: int = 0
    """So many percent more than it has are told of the charge in one report of five, as an estimate by voltage does."""
    hover_us: int = 18 * 60 * 1_000_000
    """How long a full battery hovers."""
    cruise_mm_s: int = 5_000
    max_speed_mm_s: int = 12_000
    ceiling_mm: int | None = None
    """It rises no higher above home than this: too heavy, its motors weak, or a fence above (FENCE_ALT_MAX)."""
    return_mm: int = 30_000
    """The height above home that a return climbs to, as its owner has set it; ArduCopter comes with 15 m."""
    land_mm_s: int | None = None
    """How fast the last metres of a landing are, as its owner has set it; what the autopilot comes with if None."""
    wind: Wind = Wind()
    seed: int = 1
    noise: bool = True
    """Whether sensors have any; without it what is believed does not stray either."""
    estimate: Estimate = Estimate.CLOSE
    answers: Answers = Answers.AT_ONCE
    mode_lag_us: int | None = None
    """How long after it entered a mode its reports tell of the one before; None: as recorded of the flavour."""
    boot: Boot = Boot.FAST
    parameters: tuple[tuple[str, float], ...] = ()
    """What its owner has set: names of parameters that the flavour has, and their values."""
    extras: frozenset[Equipment] = EQUIPPED
    """What is fitted beside GPS, barometer and battery."""
    faults: tuple[Fault, ...] = ()
    signing_key: bytes | None = None
    """The key of the link from the start; else SETUP_SIGNING may bring one."""
    usb: bool = False
    """Whether the vehicle takes the link for USB, on which ArduCopter, and PX4 1.17, obey without a signature."""
    release: tuple[int, int] | None = None
    """Which release it says that it is, and takes keys as. If None, the recorded one (PX4 1.16, ArduCopter 4.7); a PX4
    with a key is 1.18, for 1.16 has none.
    """
    utc_us: int = 0
    """The time of day at the start, for the time stamps of signing; microseconds since 1970."""
    speed: int = 100
    """Seconds of flight in a second outside, times 100: the time stamps of signing follow the time outside."""

    def __post_init__(self) -> None:
        """Raises ValueError for what no vehicle could be."""
        if not 1 <= self.system <= 255:
            raise ValueError("system is an id from 1 to 255")
        if not 0 <= self.battery <= 10_000:
            raise ValueError("battery is from 0 to 10000, in 1/10000")
        if not all(0 <= other.level <= 10_000 and other.every_us >= 0 for other in self.other_batteries):
            raise ValueError("the level of another battery is from 0 to 10000, in 1/10000")
        if self.hover_us <= 0:
            raise ValueError("hover time is more than nothing")
        if not 0 < self.cruise_mm_s <= self.max_speed_mm_s <= 15_000:
            raise ValueError("cruise speed is more than 0 and at most the greatest speed, which is at most 15000 mm/s")
        if self.signing_key is not None and len(self.signing_key) != KEY_OCTETS:
            raise ValueError(f"a key for signing has {KEY_OCTETS} octets")
        if self.release is not None and not all(0 <= part <= 255 for part in self.release):
            raise ValueError("a release is two numbers from 0 to 255")
        keyless = self.flavour is AutopilotKind.PX4 and self.release is not None and self.release < (1, 17)
        if keyless and self.signing_key is not None:
            raise ValueError("PX4 takes keys from release 1.17 on")
        if self.speed <= 0:
            raise ValueError("speed is more than nothing")
        if not 2_000 <= self.return_mm <= 1_000_000:
            raise ValueError("a return climbs to a height from 2000 to 1000000 mm")
        if self.land_mm_s is not None and not 100 <= self.land_mm_s <= 2_000:
            raise ValueError("a landing is from 100 to 2000 mm/s")
        if not -850_000_000 <= self.home.latitude <= 850_000_000 or abs(self.home.longitude) > 1_800_000_000:
            raise ValueError("home is between 85 degrees south and north, and 180 degrees west and east")
