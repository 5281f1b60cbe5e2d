"""The configuration of a simulation. Equal configurations and equal inputs give equal outputs."""

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
    """In one second and without status texts: for tests and demonstrations."""
    RECORDED = "recorded"
    """As long as the real autopilot takes: PX4 5 s, ArduCopter 42 s."""


class Answers(StrEnum):
    """How long the autopilot takes to obey and answer."""

    AT_ONCE = "at-once"
    """No delay: a datagram is obeyed when it arrives. All streams begin together."""
    RECORDED = "recorded"
    """As recorded: random milliseconds; requests overtake commands. Each stream begins at a random time."""


class Estimate(StrEnum):
    """How accurate the position estimate is."""

    CLOSE = "close"
    """To centimetres."""
    REAL = "real"
    """As with a satellite receiver: about a metre off, drifting slowly, and late."""


class Equipment(StrEnum):
    """Optional equipment beside GPS, barometer and battery, and the messages that the vehicle then sends."""

    RADIO = "radio"
    """A SiK radio in the link. It sends RADIO_STATUS as system 51, component 68."""
    RANGE = "range"
    """Range finders ahead and all around: DISTANCE_SENSOR with orientation 0, OBSTACLE_DISTANCE."""
    ALTIMETER = "altimeter"
    """A downward range finder, as in PX4's own simulation: DISTANCE_SENSOR with orientation 25."""
    WIND = "wind"
    """Wind estimation from drag, active in flight."""
    VOLTAGE = "voltage"
    """The battery's voltage is measured."""


STOCK = frozenset({Equipment.VOLTAGE})
"""A stock vehicle: GPS, barometer and battery only. SYS_STATUS carries the battery's voltage."""
EQUIPPED = frozenset({Equipment.RADIO, Equipment.RANGE, Equipment.WIND, Equipment.VOLTAGE})


class Purpose(StrEnum):
    """What a battery feeds (`battery_function` of BATTERY_STATUS)."""

    FLIGHT = "flight"
    """MAV_BATTERY_FUNCTION_ALL: drained like the first battery."""
    PROPULSION = "propulsion"
    """The motors only: drained like the first battery."""
    AVIONICS = "avionics"
    """Feeds no motor: its level does not change."""
    PAYLOAD = "payload"
    """Feeds no motor: its level does not change."""


@dataclass(frozen=True, slots=True)
class OtherBattery:
    """An additional battery: what it feeds, and its initial level in 1/10000."""

    purpose: Purpose
    level: int
    every_us: int = 0
    """The shortest interval between its reports, as of a smart battery on a slow bus. 0: in turn with the others."""


@dataclass(frozen=True, slots=True)
class SimulationConfig:
    """All settings of a simulation; integers in mm, mm/s, us, 1e-7 degree and 1/10000."""

    flavour: AutopilotKind = AutopilotKind.PX4
    system: int = 1
    home: HomePosition = HOME
    battery: int = 10_000
    other_batteries: tuple[OtherBattery, ...] = ()
    """The batteries with ids from 1 on. All batteries are reported in turn."""
    gauge_rise: int = 0
    """Percent by which every fifth report overstates the charge, as an estimate from the voltage does."""
    hover_us: int = 18 * 60 * 1_000_000
    """The hover time of a full battery."""
    cruise_mm_s: int = 5_000
    max_speed_mm_s: int = 12_000
    ceiling_mm: int | None = None
    """The greatest height above home that it can reach: too heavy, weak motors, or a fence (FENCE_ALT_MAX)."""
    return_mm: int = 30_000
    """The height above home of a return, as the owner has set it; ArduCopter's default is 15 m."""
    land_mm_s: int | None = None
    """The speed of the last metres of a landing, as the owner has set it; None: the autopilot's default."""
    wind: Wind = Wind()
    seed: int = 1
    noise: bool = True
    """Whether sensors have noise. Without noise the estimate does not drift either."""
    estimate: Estimate = Estimate.CLOSE
    answers: Answers = Answers.AT_ONCE
    mode_lag_us: int | None = None
    """How long its reports show the previous mode after a mode change; None: as recorded for the flavour."""
    boot: Boot = Boot.FAST
    parameters: tuple[tuple[str, float], ...] = ()
    """Parameters that the owner has set: names that the flavour has, and values."""
    extras: frozenset[Equipment] = EQUIPPED
    """Equipment beside GPS, barometer and battery."""
    camera: bool = False
    """Whether it has a camera: on PX4 a component of its own, on ArduCopter one that the autopilot triggers."""
    gimbal: bool = False
    """Whether it has a gimbal, which carries the camera. A camera without one looks down."""
    radio_us: int = 1_000_000
    """The interval between two reports of the radio; a SiK radio reports once a second."""
    faults: tuple[Fault, ...] = ()
    signing_key: bytes | None = None
    """The link's initial signing key; without it, SETUP_SIGNING can set one."""
    usb: bool = False
    """Whether the vehicle treats the link as USB, on which ArduCopter and PX4 1.17 accept unsigned frames."""
    release: tuple[int, int] | None = None
    """The release that it reports, which also decides how it handles keys. None: the recorded one (PX4 1.16, ArduCopter
    4.7); PX4 with a key is 1.18, because 1.16 has no signing.
    """
    utc_us: int = 0
    """UTC at the start, for signing time stamps; microseconds since 1970."""
    speed: int = 100
    """Simulated seconds per real second, times 100. Signing time stamps follow real time."""

    def __post_init__(self) -> None:
        """Raise ValueError for a value out of range."""
        key, release, home, levels = self.signing_key, self.release or (255, 255), self.home, self.other_batteries
        for holds, message in (
            (1 <= self.system <= 255, "system id must be from 1 to 255"),
            (0 <= self.battery <= 10_000, "battery must be from 0 to 10000 (1/10000)"),
            (all(0 <= each.level <= 10_000 for each in levels), "battery level must be from 0 to 10000 (1/10000)"),
            (all(each.every_us >= 0 for each in levels), "battery report interval must not be negative"),
            (self.hover_us > 0, "hover time must be greater than 0"),
            (0 < self.cruise_mm_s <= self.max_speed_mm_s, "cruise speed must be positive and at most the maximum"),
            (self.max_speed_mm_s <= 15_000, "maximum speed must be at most 15000 mm/s"),
            (key is None or len(key) == KEY_OCTETS, f"signing key must have {KEY_OCTETS} octets"),
            (0 <= min(release) <= max(release) <= 255, "release must be two numbers from 0 to 255"),
            (
                key is None or release >= (1, 17) or self.flavour is not AutopilotKind.PX4,
                "PX4 supports signing keys from release 1.17 on",
            ),
            (self.radio_us > 0, "report interval of the radio must be greater than 0"),
            (self.speed > 0, "speed must be greater than 0"),
            (2_000 <= self.return_mm <= 1_000_000, "return height must be from 2000 to 1000000 mm"),
            (self.land_mm_s is None or 100 <= self.land_mm_s <= 2_000, "landing speed must be from 100 to 2000 mm/s"),
            (abs(home.latitude) <= 850_000_000, "latitude of home must be from -85 to 85 degrees"),
            (abs(home.longitude) <= 1_800_000_000, "longitude of home must be from -180 to 180 degrees"),
        ):
            if not holds:
                raise ValueError(message)
