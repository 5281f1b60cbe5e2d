"""The faults that can be injected into a simulated flight.

They concern the vehicle, its camera and gimbal, its link, its surroundings, the pilot, the onboard computer, and
senders of documents.

`at_us` is the time since the start of the simulation; `for_us` None means permanently. The end of a field's name
is its unit. Sources name a kind as in `KINDS`, with `_` for `-`, and a field by its name without the unit.
"""

from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, fields
from enum import StrEnum
from typing import Any, NamedTuple

from rtshcua.model.quantity import Dimension


class FlightMode(StrEnum):
    """A flight mode by its behaviour."""

    MANUAL = "manual"
    "Flown by the pilot's sticks alone (MANUAL, STABILIZE)."
    ALTITUDE = "altitude"
    "Flown by the pilot's sticks, height held (ALTCTL, ALT_HOLD)."
    POSITION = "position"
    "Flown by the pilot's sticks, position held (POSCTL, POSHOLD)."
    LOITER = "loiter"
    "Holds its position (AUTO.LOITER, LOITER)."
    TAKEOFF = "takeoff"
    """Climbs, then loiters (AUTO.TAKEOFF; ArduCopter takes off in GUIDED)."""
    GUIDED = "guided"
    "Flies to streamed position targets (OFFBOARD, GUIDED)."
    MISSION = "mission"
    "Flies the uploaded mission (AUTO.MISSION, AUTO)."
    ORBIT = "orbit"
    """Circles a place (PX4 only)."""
    BRAKE = "brake"
    """Stops and stays (ArduCopter only)."""
    RETURN = "return"
    """Climbs, flies home and lands (AUTO.RTL, RTL)."""
    LAND = "land"
    "Lands at its position (AUTO.LAND, LAND)."


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault at a given time."""

    at_us: int


class LinkFault(Fault):
    """A fault of the link, in one direction or both, or of the radio's status reports."""

    __slots__ = ()


class ReceiverFault(Fault):
    """A fault of the GPS receiver."""

    __slots__ = ()


class AutopilotFault(Fault):
    """A fault of the autopilot itself."""

    __slots__ = ()


class PilotFault(Fault):
    """An intervention by a pilot who does not use our link."""

    __slots__ = ()


class PayloadFault(Fault):
    """A fault of the camera or the gimbal; without effect on a vehicle that has none."""

    __slots__ = ()


class HostFault(Fault):
    """A fault of the onboard computer; the simulated vehicle does not see it."""

    __slots__ = ()


class AgentFault(Fault):
    """Documents that somebody hands over, signed or not; the simulated vehicle does not see them."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class BatteryLevel(Fault):
    """The battery level drops to this value, in 1/10000."""

    level: int


@dataclass(frozen=True, slots=True)
class GpsLoss(ReceiverFault):
    """The receiver loses its fix."""

    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class GpsJump(ReceiverFault):
    """The receiver's position is off by this much from now on."""

    north_mm: int
    east_mm: int


@dataclass(frozen=True, slots=True)
class GpsGlitch(ReceiverFault):
    """Only the receiver is off by this; the estimator does not accept the position, and fails after a while."""

    north_mm: int
    east_mm: int
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class GpsDrift(ReceiverFault):
    """The receiver's position drifts at this speed, slowly enough to be accepted; the offset stays."""

    north_mm_s: int
    east_mm_s: int
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class EstimatorUnhealthy(AutopilotFault):
    """The estimator reports that it is unhealthy (flags of its status, health bits of SYS_STATUS), and continues."""

    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class BatteryCell(Fault):
    """A cell fails: the pack loses this voltage and sags more under load; the reported level does not show it."""

    drop_mv: int = 1_200


@dataclass(frozen=True, slots=True)
class BatteryVoltage(Fault):
    """The measured voltage is this value from now on, whatever the battery holds."""

    voltage_mv: int


@dataclass(frozen=True, slots=True)
class WindStep(Fault):
    """The mean wind changes to this speed and direction; gusts end unless given."""

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
    """Every datagram is delayed by this much more."""

    delay_us: int
    for_us: int | None = None
    way: Direction = Direction.BOTH


@dataclass(frozen=True, slots=True)
class LinkJitter(LinkFault):
    """Every datagram is delayed by a random time up to this; the order is kept."""

    jitter_us: int
    for_us: int | None = None
    way: Direction = Direction.BOTH


@dataclass(frozen=True, slots=True)
class LinkReorder(LinkFault):
    """This fraction of the datagrams, in 1/10000, is overtaken by those sent in the following 60 ms."""

    part: int
    for_us: int | None = None
    way: Direction = Direction.BOTH


@dataclass(frozen=True, slots=True)
class LinkLoss(LinkFault):
    """This fraction of the datagrams, in 1/10000, is lost; RADIO_STATUS reports it."""

    loss: int
    for_us: int | None = None
    way: Direction = Direction.BOTH


@dataclass(frozen=True, slots=True)
class LinkSilence(LinkFault):
    """Nothing gets through: datagrams are lost, or `held` back and delivered in one burst at the end."""

    for_us: int | None = None
    way: Direction = Direction.BOTH
    held: bool = False


class Voice(StrEnum):
    """The message that a second sender fakes under the vehicle's own ids."""

    GIMBAL = "gimbal"
    "A heartbeat of a component that is not an autopilot: disarmed, in mode 0."
    DISARMED = "disarmed"
    """The autopilot's own heartbeat, but disarmed."""
    STRAYED = "strayed"
    """The autopilot's own heartbeat, but in another mode (LAND)."""
    ANSWERS = "answers"
    "Replies to another system: denied commands and a refused fence."


@dataclass(frozen=True, slots=True)
class SecondVoice(LinkFault):
    """A second sender uses the vehicle's own ids on the link, at this rate, while the vehicle continues."""

    says: Voice = Voice.GIMBAL
    each_us: int = 250_000
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class Stall(AutopilotFault):
    """The autopilot's loop halts: its time and its flight stop, as recorded (arducopter-dropout).

    Messages sent to it meanwhile wait and are answered in one burst. With a `shuffle` other than 0, its messages
    of the following 200 ms arrive together at their end, in an order drawn from that seed.
    """

    for_us: int
    shuffle: int = 0


@dataclass(frozen=True, slots=True)
class Freeze(AutopilotFault):
    """Measurements freeze at their source: messages continue with old values and old time stamps."""

    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class MessageSilence(AutopilotFault):
    """One message of the autopilot, by its MAVLink name, is no longer sent."""

    message: str
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class MessageStuck(AutopilotFault):
    """One message of the autopilot, by its MAVLink name, continues with its last values and new time stamps."""

    message: str
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class StaleSource(AutopilotFault):
    """Measurements are older at their source by this much, and their time stamps show it."""

    delay_us: int
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class Reboot(AutopilotFault):
    """The autopilot restarts: its motors stop meanwhile, it is silent, and its clock restarts at 0."""


@dataclass(frozen=True, slots=True)
class LinkQuality(LinkFault):
    """RADIO_STATUS reports this quality, in 1/10000, without any loss."""

    quality: int


@dataclass(frozen=True, slots=True)
class Obstacle(Fault):
    """The sensor reports an obstacle ahead at this distance, wherever the vehicle goes."""

    distance_mm: int
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class Pillar(Fault):
    """A cylinder stands in the world, from the ground up; the sensor sees it depending on the vehicle's position.

    The position of its centre, and its height, are relative to home. A vehicle that flies into it crashes. With a
    speed it moves, in a direction clockwise from north.
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
    """The pilot stops the vehicle from a ground station, without a mode change.

    PX4: DO_REPOSITION without a position. ArduCopter: DO_PAUSE_CONTINUE, which has an effect in GUIDED only.
    """


@dataclass(frozen=True, slots=True)
class PilotGoto(PilotFault):
    """The pilot sends the vehicle elsewhere from a ground station, with DO_REPOSITION; position and height are from
    home.

    PX4: the mode is Hold, as for a target of ours. ArduCopter: GUIDED, likewise.
    """

    north_mm: int
    east_mm: int
    up_mm: int


@dataclass(frozen=True, slots=True)
class PilotVelocity(PilotFault):
    """The pilot steers from a ground station, by velocities ten times a second for a while; the mode stays.

    ArduCopter obeys in GUIDED, and reports no target from then on. PX4 would obey in OFFBOARD only, and ignores
    it.
    """

    north_mm_s: int
    east_mm_s: int
    for_us: int = 4_000_000


@dataclass(frozen=True, slots=True)
class PilotSpeed(PilotFault):
    """The pilot changes the speed from a ground station (DO_CHANGE_SPEED); the target stays."""

    speed_mm_s: int


@dataclass(frozen=True, slots=True)
class PilotSticks(PilotFault):
    """The pilot moves the sticks of the remote control for a while, to steer east.

    PX4 leaves every automatic mode for Position (COM_RC_OVERRIDE, bit 0, on by default; bit 1, for OFFBOARD, is
    off). ArduCopter ignores the sticks in GUIDED, AUTO and BRAKE; during a landing they move it aside at up to
    1.25 m/s (LAND_REPOSITION, on by default; `land_run_horizontal_control`), and in LOITER and POSHOLD too.
    """

    for_us: int = 2_000_000


@dataclass(frozen=True, slots=True)
class Kill(PilotFault):
    """The motors stop immediately: disarmed by force. In the air the vehicle falls."""


@dataclass(frozen=True, slots=True)
class CameraLoss(PayloadFault):
    """The shutter does not open for this fraction of the pictures, in 1/10000."""

    part: int
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class CameraSlow(PayloadFault):
    """The camera takes this much longer to store and report a picture, and takes no other one meanwhile."""

    delay_us: int
    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class CameraFull(PayloadFault):
    """The camera's storage is full: no more pictures are stored."""

    for_us: int | None = None


class CameraCounter(StrEnum):
    """What becomes of the index of images when the camera restarts."""

    RESTARTS = "restarts"
    """The next image has index 0."""
    CONTINUES = "continues"
    "The camera counts all images that it has ever stored."


@dataclass(frozen=True, slots=True)
class CameraReboot(PayloadFault):
    """The camera restarts and is silent meanwhile. A picture that it has not stored is lost; stored ones are kept, but
    are no longer reported on request.
    """

    for_us: int = 5_000_000
    counter: CameraCounter = CameraCounter.RESTARTS


@dataclass(frozen=True, slots=True)
class GimbalStuck(PayloadFault):
    """The gimbal's motors do not move; it acknowledges commands and reports its true attitude."""

    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class RuntimeKilled(HostFault):
    """The process of the runtime dies, and is restarted after this time, as `run` does after a crash."""

    for_us: int


@dataclass(frozen=True, slots=True)
class BoundaryKilled(HostFault):
    """The boundary, in a process of its own (`run --mode process`), dies; the next run starts another one."""


@dataclass(frozen=True, slots=True)
class HostStall(HostFault):
    """The process of the runtime does not run for this time: nothing is read and nothing is sent."""

    for_us: int


@dataclass(frozen=True, slots=True)
class DiskFull(HostFault):
    """No record can be written."""

    for_us: int | None = None


@dataclass(frozen=True, slots=True)
class DiskStall(HostFault):
    """The disk accepts records but makes no progress, as a memory card may for seconds: none is stored before the
    end.
    """

    for_us: int


@dataclass(frozen=True, slots=True)
class ClockStep(HostFault):
    """The machine's time of day is set: ahead by this much, or back."""

    by_us: int


@dataclass(frozen=True, slots=True)
class Approval(AgentFault):
    """Somebody in a role grants every approval that the mission requires; `copies` times."""

    role: str
    copies: int = 1


@dataclass(frozen=True, slots=True)
class Disapproval(AgentFault):
    """Somebody in a role refuses every step that requires an approval; `copies` times."""

    role: str
    copies: int = 1


@dataclass(frozen=True, slots=True)
class Recall(AgentFault):
    """The mission is recalled; `copies` times."""

    copies: int = 1


@dataclass(frozen=True, slots=True)
class Replacement(AgentFault):
    """The unreleased steps are replaced by the same steps under new ids; `copies` times."""

    copies: int = 1


@dataclass(frozen=True, slots=True)
class Babble(AgentFault):
    """So many documents in each tick that are unsigned or damaged."""

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
    "camera-loss": CameraLoss,
    "camera-slow": CameraSlow,
    "camera-full": CameraFull,
    "camera-reboot": CameraReboot,
    "gimbal-stuck": GimbalStuck,
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
    """The unit of a field: written as a suffix on a command line, and as a quantity in a source.

    `suffix` ends the field's name; `words` has the size of each written unit in the field's unit. `dimension`
    None: a source writes a plain number. One of the field's unit is `canonical` of the dimension's.
    """

    suffix: str
    words: Mapping[str, int]
    dimension: Dimension | None
    canonical: int = 1


#: the first one that matches a field's name
UNITS: tuple[FieldUnit, ...] = (
    FieldUnit("_us", {"us": 1, "ms": 1000, "s": 1_000_000, "min": 60_000_000}, Dimension.DURATION),
    FieldUnit("_mv", {"mV": 1, "V": 1000}, None),
    FieldUnit("_mm_s", {"mm/s": 1, "m/s": 1000}, Dimension.SPEED),
    FieldUnit("_mm", {"mm": 1, "m": 1000}, Dimension.LENGTH),
    FieldUnit("_deg", {"deg": 1}, Dimension.ANGLE, 10_000_000),
    FieldUnit("", {"%": 100}, Dimension.RATIO),
)
YES_NO: tuple[str, str] = ("yes", "no")
#: fields with an enumerated value
WORDS: Mapping[str, tuple[str, ...]] = {
    "mode": tuple(FlightMode),
    "way": tuple(Direction),
    "held": YES_NO,
    "says": tuple(Voice),
    "counter": tuple(CameraCounter),
}
#: and the types of their values
WORD_TYPES: Mapping[str, type[FlightMode | Direction | Voice | CameraCounter]] = {
    "mode": FlightMode,
    "way": Direction,
    "says": Voice,
    "counter": CameraCounter,
}
#: fields that are a plain number
COUNTS = frozenset({"copies", "shuffle"})
#: fields that may be negative: south and west, down, and back in time
SIGNED = frozenset({"north", "east", "up", "by"})
#: fields that are a name
NAMES = frozenset({"message", "role"})


class FaultField(NamedTuple):
    """A field of a kind of fault. Exactly one of `unit`, `words`, `is_count`, `is_name` gives its type."""

    name: str
    "The name in sources and on command lines."
    field: str
    "The name in the class."
    unit: FieldUnit | None
    words: tuple[str, ...]
    is_count: bool
    is_name: bool
    needed: bool
    "Whether the field is required."


def parameters(kind: type[Fault]) -> tuple[FaultField, ...]:
    """The fields of a fault of this kind, without its time."""
    return tuple(_parameter(field) for field in fields(kind) if field.name != "at_us")


def _parameter(field: Field[Any]) -> FaultField:
    name, needed = field.name, field.default is MISSING
    words, is_count, is_name = WORDS.get(name, ()), name in COUNTS, name in NAMES
    if words or is_count or is_name:
        return FaultField(name, name, None, words, is_count, is_name, needed)
    unit = next(each for each in UNITS if name.endswith(each.suffix))
    return FaultField(name.removesuffix(unit.suffix), name, unit, (), False, False, needed)
