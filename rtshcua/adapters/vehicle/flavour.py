"""The differences between autopilots, as a value for each of them, and the stages that they share."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final, NamedTuple, TypeAlias

from rtshcua.adapters.vehicle import effects, messages
from rtshcua.adapters.vehicle.bounds import OwnFence
from rtshcua.adapters.vehicle.effects import Effect, Measure
from rtshcua.adapters.vehicle.messages import Message
from rtshcua.adapters.vehicle.observed import ObservedVehicle, Reported
from rtshcua.adapters.vehicle.returns import ReturnLimit
from rtshcua.mavlink.modes import CopterMode, Px4Mode
from rtshcua.model.flat.mission import ALONG
from rtshcua.onboard.ports import Command

#: us of link time until a mode shows, and until the motors run
MODE_US: Final = 5_000_000
ARM_US: Final = 8_000_000
#: us of link time from the arrival at a point until the nose has the heading there: half a turn takes 4 s at 45 degrees
#: a second, the slowest default
TURNS_US: Final = 10_000_000
#: mm: the deviation of a target before it was reported, by rounding and by a home altitude that drifts
SAME: Final = 3_000
#: and afterwards: in recorded flights each target was reported to the same digit until the next command, and PX4 copies
#: it from its setpoint; a pause near the end of a leg reports a place this near to it
KEPT: Final = 100
KEPT_LEVEL: Final = 500
#: mm: how far from the vehicle its takeoff target, or the place where it will stop, may be;
TAKES_OFF: Final = 20_000
_STOPS: Final = 10_000
_STOPS_S: Final = 3  # plus this many seconds of way, and the braking distance at 1 m/s^2


@dataclass(frozen=True, slots=True)
class ExpectedTarget:
    """The target that the autopilot should report: a place, and its height in mm above mean sea level (None: any).

    `within` and `level` are the tolerances in mm, horizontal and vertical, of the first reported target; that one then
    counts as the target (`as_reported`). A vehicle that stops reports by itself where. `told` False: no report is
    needed, so no frame waits for it.
    """

    latitude: int
    longitude: int
    amsl: int | None
    within: int = SAME
    level: int = SAME
    told: bool = True

    @property
    def place(self) -> Reported:
        """The place, with 0 for any height."""
        return self.latitude, self.longitude, self.amsl or 0

    def as_reported(self, reported: Reported) -> "ExpectedTarget":
        """The expectation after a report: exactly that target."""
        return replace(
            self, latitude=reported[0], longitude=reported[1], amsl=reported[2], within=KEPT, level=KEPT_LEVEL
        )

    def is_given(self, reported: Reported) -> bool:
        """Whether a report names a place that we commanded and that was not reported before."""
        return self.within == SAME and self.amsl is not None and self.as_reported(self.place).matches(reported)

    def matches(self, reported: Reported) -> bool:
        """Whether a report names this target."""
        latitude, longitude, amsl = reported
        level = self.amsl is None or abs(amsl - self.amsl) <= self.level
        return level and effects.apart(latitude, longitude, self.latitude, self.longitude) <= self.within


@dataclass(frozen=True, slots=True)
class ExpectedProgress:
    """The progress of a stage: some part of `measure` falls by a metre within `within_us` of link time.

    `either_way`: any change is enough. A return climbs, crosses and descends to a place that only the autopilot knows.
    """

    measure: Measure
    within_us: int
    either_way: bool = False


class Stage(NamedTuple):
    """One part of a manoeuvre: send a message, then wait for its effect.

    `message` is sent once the flight mode is known, and repeated until it is acknowledged; `command` is the MAV_CMD of
    the acknowledgement. With None there is no acknowledgement: the message is repeated each `repeat_us`, until the
    autopilot reports its `target`. `done` None: no effect can be observed, so the acknowledgement ends the stage.
    `modes` are the flight modes of this stage; another one indicates a takeover. `timeout_us` 0: only progress and the
    skill's time limit end the wait. `powered`: the stage fails once the motors are off on the ground. `target`: the
    target that the autopilot must report. `progress`: the measure that must fall. `stops`: the vehicle must brake as
    its policy declares. `spare`: send nothing if the effect holds already. `settled` replaces `message` where the
    vehicle is in a mode of the stage already: it names no mode, so it cannot undo a pilot's choice. Its acknowledgement
    proves little: the reported target does. `unseen` is the reason of the failure if the effect does not show in time.
    """

    message: Message | None
    command: int | None
    done: Effect | None
    modes: frozenset[int]
    timeout_us: int = 0
    repeat_us: int = 0
    powered: bool = False
    target: ExpectedTarget | None = None
    progress: ExpectedProgress | None = None
    stops: bool = False
    spare: bool = False
    settled: Message | None = None
    unseen: str = "no-effect"


Stages: TypeAlias = Callable[[Command, ObservedVehicle, int], list[Stage]]
"""How a command is flown: what is seen and the target system to the stages of its manoeuvre."""


class FenceHabits(NamedTuple):
    """How an autopilot treats a fence.

    `frame` (MAV_FRAME) is the frame of each item. `all_inclusions`: the vehicle must be inside every inclusion; else
    inside any of them. `switches` are parameters that need these bits for the fence to be active.
    """

    frame: int
    all_inclusions: bool
    switches: tuple[tuple[str, int], ...]


class ReturnAltitude(NamedTuple):
    """A parameter with the height of a return, and the mm in one of its units."""

    parameter: str
    mm: int


@dataclass(frozen=True, slots=True)
class AutopilotFlavour:
    """An autopilot: its name, its modes, the stages of each kind of motion, and its peculiarities.

    `estimator` is the message of its estimator. `natural` are changes of mode (from, to) that it makes while it
    executes a command. `ours` are the modes in which our manoeuvres fly or hold. `shows` maps a kind of motion to the
    modes that an armed vehicle may show during and after it without another command. `aims` are the modes in which it
    reports its target. `lag_us` is the delay with which a mode shows. `mode_within_us`: no frame that moves the vehicle
    leaves on an older mode report (plus the link's delay): the fastest rate at which the autopilot really reports the
    mode. `returns` are alternative parameters of the return height, `limits` groups of parameters that lower or raise a
    return. `critical_acts`: a critical state in the air means that a failsafe acts, even without a change of mode;
    otherwise it may be a report only. `bytewise`: integer parameters are sent as their bytes. `fence` says how it
    treats a geofence, `own_fence` names its other bounds. `names_targets`: it keeps reporting a commanded target in
    flight, so a target that is no longer reported was replaced by somebody else, and a report while the vehicle stands
    far from the target indicates a pause.
    """

    name: str
    autopilot: int  # MAV_AUTOPILOT of its heartbeat
    mode_names: Mapping[int, str]
    stages: Stages
    estimator: str
    natural: frozenset[tuple[int, int]]
    ours: frozenset[int]
    shows: Mapping[int, frozenset[int]]
    aims: frozenset[int]
    mode_within_us: int
    lag_us: int
    returns: tuple[ReturnAltitude, ...]
    limits: tuple[tuple[ReturnLimit, ...], ...]
    critical_acts: bool
    bytewise: bool
    fence: FenceHabits
    own_fence: OwnFence
    names_targets: bool = False
    counts_rally_points: bool = False

    def mode_name(self, number: int) -> str:
        """The autopilot's name of a `custom_mode`, or the number itself."""
        return self.mode_names.get(number, f"mode {number}")


# ---------------------------------------------------------------- stages of both


def stopping(seen: ObservedVehicle) -> ExpectedTarget | None:
    """The place where it may report that it will stop after a stop command now; None without a known position."""
    speed = seen.speed or 0
    within = _STOPS + _STOPS_S * speed + speed * speed // 2_000
    return ExpectedTarget(seen.latitude, seen.longitude, None, within) if seen.located else None


def entering(system: int, mode: Px4Mode | CopterMode) -> Stage:
    """Enter a mode. If the vehicle is in it already, nothing is sent: that would undo a takeover in progress."""
    message = messages.set_mode(system, mode)
    return Stage(message, messages.DO_SET_MODE, effects.in_mode(mode), frozenset({mode}), MODE_US, spare=True)


def arming(system: int, modes: frozenset[int]) -> Stage:
    """Start the motors, in one of these modes."""
    return Stage(messages.arm(system), messages.ARM_DISARM, lambda seen: seen.armed, modes, ARM_US)


def climbing(height: int) -> ExpectedProgress:
    """The progress of a climb: a metre higher within 10 s."""
    return ExpectedProgress(effects.up_to(height), 10_000_000)


def leg(
    message: Message, command: int | None, modes: frozenset[int], place: tuple[int, int], height: int, amsl: int | None,
    repeat_us: int = 0, settled: Message | None = None,
) -> Stage:  # fmt: skip
    """Fly to a place (1e-7 degree) at a height above home in a straight line. Progress: a metre nearer within 8 s."""
    nearer = ExpectedProgress(effects.to_place(*place, height), 8_000_000)
    return Stage(
        message, command, effects.arrived(*place, height), modes, repeat_us=repeat_us, powered=True,
        target=ExpectedTarget(*place, amsl), progress=nearer, settled=settled,
    )  # fmt: skip


def turning(leg: Stage, heading: int) -> list[Stage]:
    """After a leg, wait until the nose has the heading of its end; nothing for a leg without one."""
    if heading == ALONG or leg.done is None:
        return []
    done = effects.turned(leg.done, heading)
    return [Stage(None, None, done, leg.modes, TURNS_US, powered=True, unseen="wrong-heading")]


def returning(system: int, mode: Px4Mode | CopterMode) -> list[Stage]:
    """Return home and land there. The time limit is long: ArduCopter hovers over home for 5 s."""
    return _coming_down(system, mode, ExpectedProgress(effects.homeward, 45_000_000, either_way=True))


def landing(system: int, mode: Px4Mode | CopterMode) -> list[Stage]:
    """Land on the spot."""
    return _coming_down(system, mode, ExpectedProgress(effects.to_the_ground, 15_000_000))


def _coming_down(system: int, mode: Px4Mode | CopterMode, progress: ExpectedProgress) -> list[Stage]:
    own = frozenset({mode})
    message = messages.set_mode(system, mode)
    return [
        Stage(message, messages.DO_SET_MODE, effects.in_mode_or_down(mode), own, MODE_US),
        Stage(None, None, lambda seen: seen.rests, own, progress=progress),
    ]
