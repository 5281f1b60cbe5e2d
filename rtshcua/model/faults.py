"""What can be made to go wrong in a flight on the simulated vehicle.

With the vehicle, its link, its surroundings, the pilot, the computer that we run on, and whoever sends documents.

`at_us` is the simulation's time, from its start; `for_us` None means for good. How a field's name ends tells its unit.
Sources name a kind as `KINDS` does, with `_` for `-`, and a field by its name without the unit.
"""

from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, fields
from enum import StrEnum
from typing import Any, NamedTuple

from rtshcua.model.quantity import Dimension


class FlightMode(StrEnum):
    """A flight mode by what it does."""

    MANUAL = "manual"
    """The pilot's sticks alone (MANUAL, STABILIZE)."""
    ALTITUDE = "altitude"
    """The pilot's sticks, height held (ALTCTL, ALT_HOLD)."""
    POSITION = "position"
    """The pilot's sticks, place held (POSCTL, POSHOLD)."""
    LOITER = "loiter"
    """Stays where it is (AUTO.LOITER, LOITER)."""
    TAKEOFF = "takeoff"
    """Climbs, then loiters (AUTO.TAKEOFF; ArduCopter takes off in GUIDED)."""
    GUIDED = "guided"
    """Flies to position targets as they come (OFFBOARD, GUIDED)."""
    MISSION = "mission"
    """Flies the mission that was uploaded (AUTO.MISSION, AUTO)."""
    ORBIT = "orbit"
    """Circles a place (PX4 only)."""
    BRAKE = "brake"
    """Stops and stays (ArduCopter only)."""
    RETURN = "return"
    """Climbs, flies home and lands (AUTO.RTL, RTL)."""
    LAND = "land"
    """Lands where it is (AUTO.LAND, LAND)."""


@dataclass(frozen=True, slots=True)
class Fault:
    """What goes wrong at a time."""

    at_us: int


class LinkFault(Fault):
    """Of the link, in one direction or both; or what the radio tells of it."""

    __slots__ = ()


class ReceiverFault(Fault):
    """Of the receiver of positions."""

    __slots__ = ()


class AutopilotFault(Fault):
    """Of the autopilot itself."""

    __slots__ = ()


class PilotFault(Fault):
    """Somebody takes over, past the link."""

    __slots__ = ()


class HostFault(Fault):
    """Of the computer that we run on; the simulated vehicle knows nothing of it."""

    __slots__ = ()


class AgentFault(Fault):
    """Somebody hands over documents, signed or not; the simulated vehicle knows nothing of it."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class BatteryLevel(Fault):
    """The battery is found to hold no more than this, in 1/10000."""

    level: int


@dataclass(frozen=True, slots=True)
class GpsLoss(ReceiverFault):
    """The receiver loses its fix."""

    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class GpsJump(ReceiverFault):
    """The receiver is off by this much more from now on."""

    north_mm: int
    east_mm: int


@dataclass(frozen=True, slots=True)
class GpsGlitch(ReceiverFault):
    """The receiver alone is off by this; the estimator does not believe it, and gives up after a while."""

    north_mm: int
    east_mm: int
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class GpsDrift(ReceiverFault):
    """The receiver strays at this speed from now on, slowly enough to be believed; what it strayed by stays."""

    north_mm_s: int
    east_mm_s: int
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class EstimatorUnhealthy(AutopilotFault):
    """The estimator says that it cannot be trusted (flags of its status, health bits of SYS_STATUS), and goes on."""

    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class BatteryCell(Fault):
    """A cell fails: the pack has lost this voltage, and sags the more under load; the level says nothing of it."""

    drop_mv: int = 1_200


@dataclass(frozen=True, slots=True)
class BatteryVoltage(Fault):
    """This voltage is measured from now on, whatever the battery holds."""

    voltage_mv: int


@dataclass(frozen=True, slots=True)
class WindStep(Fault):
    """The mean wind changes to this speed, from this direction; gusts end unless given."""

    speed_mm_s: int
    from_deg: int = 0
    gust_mm_s: int = 0


class Direction(StrEnum):
    """A direction of the link."""

    BOTH = "both"
    UP = "up"
    """To the vehicle."""
    DOWN = "down"
    """From the vehicle."""


@dataclass(frozen=True, slots=True)
class LinkDelay(LinkFault):
    """Every datagram takes this much longer."""

    delay_us: int
    for_us: int | None = None
    way: Direction = Direction.BOTH


@dataclass(frozen=True, slots=True)
class LinkJitter(LinkFault):
    """Every datagram takes up to this much longer, each another time; none overtakes another."""

    jitter_us: int
    for_us: int | None = None
    way: Direction = Direction.BOTH


@dataclass(frozen=True, slots=True)
class LinkReorder(LinkFault):
    """This part of the datagrams, in 1/10000, is overtaken by those that are sent in the 60 ms after."""

    part: int
    for_us: int | None = None
    way: Direction = Direction.BOTH


@dataclass(frozen=True, slots=True)
class LinkLoss(LinkFault):
    """This part of the datagrams, in 1/10000, is lost; RADIO_STATUS tells."""

    loss: int
    for_us: int | None = None
    way: Direction = Direction.BOTH


@dataclass(frozen=True, slots=True)
class LinkSilence(LinkFault):
    """Nothing gets through: it is lost, or `held` back until the silence is over and comes in one burst."""

    for_us: int | None = None
    way: Direction = Direction.BOTH
    held: bool = False


class Voice(StrEnum):
    """What somebody says under the vehicle's own ids."""

    GIMBAL = "gimbal"
    """A heartbeat of a component that is no autopilot: disarmed, in mode 0."""
    DISARMED = "disarmed"
    """The autopilot's own heartbeat, but disarmed."""
    STRAYED = "strayed"
    """The autopilot's own heartbeat, but in another mode (LAND)."""
    ANSWERS = "answers"
    """That commands were denied and a fence was refused, to another system."""


@dataclass(frozen=True, slots=True)
class SecondVoice(LinkFault):
    """Somebody else speaks on the link under the vehicle's own ids, so often, beside the vehicle that goes on."""

    says: Voice = Voice.GIMBAL
    each_us: int = 250_000
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class Stall(AutopilotFault):
    """The autopilot's loop halts: its time and its flight stand still, as recorded (arducopter-dropout).

    What was sent meanwhile waits and is answered in one burst. With a `shuffle` other than 0, what it says in the first
    200 ms after comes at once at their end, in an order that is drawn from that seed.
    """

    for_us: int
    shuffle: int = 0


@dataclass(frozen=True, slots=True)
class Freeze(AutopilotFault):
    """The measurements stand still at their source: messages go on with old values and old time stamps."""

    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class MessageSilence(AutopilotFault):
    """One message of the autopilot, by its MAVLink name, does not come any more."""

    message: str
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class MessageStuck(AutopilotFault):
    """One message of the autopilot, by its MAVLink name, goes on with its last values and new time stamps."""

    message: str
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class StaleSource(AutopilotFault):
    """The measurements are old at their source by this much more, and their time stamps say so."""

    delay_us: int
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class Reboot(AutopilotFault):
    """The autopilot starts again: its motors stop meanwhile, it says nothing, and its clock begins at 0."""


@dataclass(frozen=True, slots=True)
class LinkQuality(LinkFault):
    """RADIO_STATUS tells of this quality, in 1/10000, though nothing is lost yet."""

    quality: int


@dataclass(frozen=True, slots=True)
class Obstacle(Fault):
    """The sensor sees something ahead at this distance, and goes on seeing it there wherever the vehicle goes."""

    distance_mm: int
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class Pillar(Fault):
    """A round thing stands in the world, from the ground up: what is seen of it depends on where the vehicle is.

    The place of its middle, and its height, are from home. Who flies into it crashes.
    With a speed it moves, in a direction clockwise from north.
    """

    north_mm: int
    east_mm: int
    radius_mm: int
    height_mm: int
    for_us: int | None = None
    speed_mm_s: int = 0
    towards_deg: int = 0


@dataclass(frozen=True, slots=True)
class PilotMode(PilotFault):
    """The pilot takes over with the mode switch."""

    mode: FlightMode = FlightMode.POSITION


@dataclass(frozen=True, slots=True)
class PilotPause(PilotFault):
    """The pilot stops it from a ground station, and the mode does not change.

    PX4: DO_REPOSITION without a place. ArduCopter: DO_PAUSE_CONTINUE, which has an effect in GUIDED only.
    """


@dataclass(frozen=True, slots=True)
class PilotGoto(PilotFault):
    """The pilot sends it elsewhere from a ground station, with DO_REPOSITION; the place and height are from home.

    PX4: the mode is Hold, as for a target of ours. ArduCopter: GUIDED, likewise.
    """

    north_mm: int
    east_mm: int
    up_mm: int


@dataclass(frozen=True, slots=True)
class PilotVelocity(PilotFault):
    """The pilot steers it from a ground station, by velocities ten times a second for a while; the mode stays.

    ArduCopter obeys in GUIDED, and names no target from then on; PX4 would in OFFBOARD only, and does not mind.
    """

    north_mm_s: int
    east_mm_s: int
    for_us: int = 4_000_000


@dataclass(frozen=True, slots=True)
class PilotSpeed(PilotFault):
    """The pilot has it fly at another speed from a ground station (DO_CHANGE_SPEED): it goes where it goes."""

    speed_mm_s: int


@dataclass(frozen=True, slots=True)
class PilotSticks(PilotFault):
    """The pilot moves the sticks of the remote control for a while, to steer it east.

    PX4 leaves every automatic mode for Position (COM_RC_OVERRIDE, bit 0, on by default; bit 1, for OFFBOARD, is off).
    ArduCopter does not mind in GUIDED, AUTO and BRAKE; while it lands it is moved aside at up to 1.25 m/s
    (LAND_REPOSITION, on by default; `land_run_horizontal_control`), and in LOITER and POSHOLD too.
    """

    for_us: int = 2_000_000


@dataclass(frozen=True, slots=True)
class Kill(PilotFault):
    """The motors stop, wherever it is: disarmed by force. In the air it falls."""


@dataclass(frozen=True, slots=True)
class RuntimeKilled(HostFault):
    """The process of the runtime dies, and is started again after this long, as `run` does after a crash."""

    for_us: int


@dataclass(frozen=True, slots=True)
class BoundaryKilled(HostFault):
    """The boundary, a process of its own (`run --mode process`), dies; another begins with the next run."""


@dataclass(frozen=True, slots=True)
class HostStall(HostFault):
    """The process of the runtime does not get to run for this long: nothing is read and nothing sent."""

    for_us: int


@dataclass(frozen=True, slots=True)
class DiskFull(HostFault):
    """No record can be written."""

    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class DiskStall(HostFault):
    """The disk takes records and does not get on with them, as a memory card may for seconds: none is kept before it is
    over.
    """

    for_us: int


@dataclass(frozen=True, slots=True)
class ClockStep(HostFault):
    """The machine's time of day is set: ahead by this much, or back."""

    by_us: int


@dataclass(frozen=True, slots=True)
class Approval(AgentFault):
    """Somebody of a role grants every approval that the mission asks for; `copies` times."""

    role: str
    copies: int = 1


@dataclass(frozen=True, slots=True)
class Disapproval(AgentFault):
    """Somebody of a role refuses every step that the mission asks approval for; `copies` times."""

    role: str
    copies: int = 1


@dataclass(frozen=True, slots=True)
class Recall(AgentFault):
    """The mission is called back; `copies` times."""

    copies: int = 1


@dataclass(frozen=True, slots=True)
class Replacement(AgentFault):
    """The steps that were not yet released are replaced by themselves, under new ids; `copies` times."""

    copies: int = 1


@dataclass(frozen=True, slots=True)
class Babble(AgentFault):
    """So many documents that nobody signed, or that were damaged on their way, one a tick."""

    copies: int = 20


KINDS: Mapping[str, type[Fault]] = {
    "battery": BatteryLevel,
    "battery-cell": BatteryCell,
    "battery-voltage": BatteryVoltage,
    "gps-loss": GpsLoss,
    "gps-jump": GpsJump,
    "gps-drift": GpsDrift,
    "gps-glitch": GpsGlitch,
    "estimator": EstimatorUnhealthy,
    "wind": WindStep,
    "link-delay": LinkDelay,
    "link-jitter": LinkJitter,
    "link-reorder": LinkReorder,
    "link-loss": LinkLoss,
    "link-silence": LinkSilence,
    "link-quality": LinkQuality,
    "second-voice": SecondVoice,
    "obstacle": Obstacle,
    "pillar": Pillar,
    "pilot": PilotMode,
    "pilot-mode": PilotMode,
    "pilot-pause": PilotPause,
    "pilot-goto": PilotGoto,
    "pilot-velocity": PilotVelocity,
    "pilot-speed": PilotSpeed,
    "pilot-sticks": PilotSticks,
    "kill": Kill,
    "reboot": Reboot,
    "stall": Stall,
    "freeze": Freeze,
    "stale": StaleSource,
    "stuck": MessageStuck,
    "mute": MessageSilence,
    "runtime-killed": RuntimeKilled,
    "boundary-killed": BoundaryKilled,
    "host-stall": HostStall,
    "disk-full": DiskFull,
    "disk-stall": DiskStall,
    "clock-step": ClockStep,
    "approve": Approval,
    "refuse": Disapproval,
    "recall": Recall,
    "replace": Replacement,
    "babble": Babble,
}


class FieldUnit(NamedTuple):
    """How numbers of a field are written: on a command line with a unit, in a source as a quantity.

    `suffix` ends the field's name; `words` says how many of the field's unit each written one is. `dimension` None: a
    source writes a plain number. One of the field's unit is `canonical` of the dimension's.
    """

    suffix: str
    words: Mapping[str, int]
    dimension: Dimension | None
    canonical: int = 1


#: the first that fits a field's name
UNITS: tuple[FieldUnit, ...] = (
    FieldUnit("_us", {"us": 1, "ms": 1000, "s": 1_000_000, "min": 60_000_000}, Dimension.DURATION),
    FieldUnit("_mv", {"mV": 1, "V": 1000}, None),
    FieldUnit("_mm_s", {"mm/s": 1, "m/s": 1000}, Dimension.SPEED),
    FieldUnit("_mm", {"mm": 1, "m": 1000}, Dimension.LENGTH),
    FieldUnit("_deg", {"deg": 1}, Dimension.ANGLE, 10_000_000),
    FieldUnit("", {"%": 100}, Dimension.RATIO),
)
#: fields that are one of some words
WORDS: Mapping[str, tuple[str, ...]] = {
    "mode": tuple(FlightMode),
    "way": tuple(Direction),
    "held": ("yes", "no"),
    "says": tuple(Voice),
}
#: and what their words are members of
WORD_TYPES: Mapping[str, type[FlightMode | Direction | Voice]] = {"mode": FlightMode, "way": Direction, "says": Voice}
#: fields that are a plain number
COUNTS = frozenset({"copies", "shuffle"})
#: fields that may be below zero: south and west, down, and back in time
SIGNED = frozenset({"north", "east", "up", "by"})
#: fields that name something
NAMES = frozenset({"message", "role"})


class FaultField(NamedTuple):
    """A field of a kind of fault. Exactly one of `unit`, `words`, `is_count`, `is_name` tells what it takes."""

    name: str
    """As it is written."""
    field: str
    """As the kind calls it."""
    unit: FieldUnit | None
    words: tuple[str, ...]
    is_count: bool
    is_name: bool
    needed: bool
    """Whether it must be given."""


def parameters(kind: type[Fault]) -> tuple[FaultField, ...]:
    """What may be said of a fault of this kind, but for its time."""
    return tuple(_parameter(field) for field in fields(kind) if field.name != "at_us")


def _parameter(field: Field[Any]) -> FaultField:
    name, needed = field.name, field.default is MISSING
    words, is_count, is_name = WORDS.get(name, ()), name in COUNTS, name in NAMES
    if words or is_count or is_name:
        return FaultField(name, name, None, words, is_count, is_name, needed)
    unit = next(each for each in UNITS if name.endswith(each.suffix))
    return FaultField(name.removesuffix(unit.suffix), name, unit, (), False, False, needed)
