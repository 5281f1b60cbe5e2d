"""What can be made to go wrong. `at_us` is the simulation's time, from its start; `for_us` None means for good."""

from dataclasses import dataclass
from enum import StrEnum

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


class Way(StrEnum):
    """A direction of the link."""

    BOTH = "both"
    UP = "up"
    """To the vehicle."""
    DOWN = "down"
    """From the vehicle."""


@dataclass(frozen=True, slots=True)
class LinkDelay:
    """Every datagram takes this much longer."""

    at_us: int
    delay_us: int
    for_us: int | None = None
    way: Way = Way.BOTH


@dataclass(frozen=True, slots=True)
class LinkJitter:
    """Every datagram takes up to this much longer, each another time; none overtakes another."""

    at_us: int
    jitter_us: int
    for_us: int | None = None
    way: Way = Way.BOTH


@dataclass(frozen=True, slots=True)
class LinkReorder:
    """This part of the datagrams, in 1/10000, is overtaken by those that are sent in the 60 ms after."""

    at_us: int
    part: int
    for_us: int | None = None
    way: Way = Way.BOTH


@dataclass(frozen=True, slots=True)
class LinkLoss:
    """This part of the datagrams, in 1/10000, is lost; RADIO_STATUS tells."""

    at_us: int
    loss: int
    for_us: int | None = None
    way: Way = Way.BOTH


@dataclass(frozen=True, slots=True)
class LinkSilence:
    """Nothing gets through: it is lost, or `held` back until the silence is over and comes in one burst."""

    at_us: int
    for_us: int | None = None
    way: Way = Way.BOTH
    held: bool = False


@dataclass(frozen=True, slots=True)
class Stall:
    """The autopilot's loop halts: its time and its flight stand still, as recorded (arducopter-dropout).

    What was sent meanwhile waits and is answered in one burst. With a `shuffle` other than 0, what it says in the first
    200 ms after comes at once at their end, in an order that is drawn from that seed.
    """

    at_us: int
    for_us: int
    shuffle: int = 0


@dataclass(frozen=True, slots=True)
class Freeze:
    """The measurements stand still at their source: messages go on with old values and old time stamps."""

    at_us: int
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class MessageSilence:
    """One message of the autopilot, by its MAVLink name, does not come any more."""

    at_us: int
    message: str
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


@dataclass(frozen=True, slots=True)
class PilotPause:
    """The pilot stops it from a ground station, and the mode does not change.

    PX4: DO_REPOSITION without a place. ArduCopter: DO_PAUSE_CONTINUE, which has an effect in GUIDED only.
    """

    at_us: int


@dataclass(frozen=True, slots=True)
class PilotGoto:
    """The pilot sends it elsewhere from a ground station, with DO_REPOSITION; the place and height are from home.

    PX4: the mode is Hold, as for a target of ours. ArduCopter: GUIDED, likewise.
    """

    at_us: int
    north_mm: int
    east_mm: int
    up_mm: int


@dataclass(frozen=True, slots=True)
class PilotSticks:
    """The pilot moves the sticks of the remote control for a while, to steer it east.

    PX4 leaves every automatic mode for Position (COM_RC_OVERRIDE, bit 0, on by default; bit 1, for OFFBOARD, is off).
    ArduCopter does not mind in GUIDED, AUTO and BRAKE; while it lands it is moved aside at up to 1.25 m/s
    (LAND_REPOSITION, on by default; `land_run_horizontal_control`), and in LOITER and POSHOLD too.
    """

    at_us: int
    for_us: int = 2_000_000


@dataclass(frozen=True, slots=True)
class Kill:
    """The motors stop, wherever it is: disarmed by force. In the air it falls."""

    at_us: int


LinkFault = LinkDelay | LinkJitter | LinkReorder | LinkLoss | LinkSilence | LinkQuality
PilotFault = PilotMode | PilotPause | PilotGoto | PilotSticks | Kill
AutopilotFault = Stall | Freeze | MessageSilence
Fault = (
    BatteryLevel
    | GpsLoss
    | GpsJump
    | GpsGlitch
    | BatteryVoltage
    | WindStep
    | Obstacle
    | Pillar
    | LinkFault
    | PilotFault
    | AutopilotFault
)
