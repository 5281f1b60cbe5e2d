"""What differs between autopilots, as a value that each flavour's package makes, and what they fly alike."""

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
from rtshcua.onboard.ports import Command

#: us of link time until a mode shows, and until the motors run
MODE_US: Final = 5_000_000
ARM_US: Final = 8_000_000
#: mm: what rounding, and a height of home that moves a little, may make of a target, before it was reported
SAME: Final = 3_000
#: and after that: each target of each recorded flight was reported to the same digit until the next command came, and
#: PX4 copies it from the setpoint that it was given; a pause near the end of a leg names a place as near as this to it
KEPT: Final = 100
KEPT_LEVEL: Final = 500
#: mm: how far from where it is it may say that it takes off, or that it will come to stand;
TAKES_OFF: Final = 20_000
_STOPS: Final = 10_000
_STOPS_S: Final = 3  # and how many seconds' way further, and what braking at 1 m/s^2 takes, if it moves


@dataclass(frozen=True, slots=True)
class ExpectedTarget:
    """What the autopilot should report: a place, and its height in mm above mean sea level (None: any).

    `within` and `level`: how far off, in mm, across and in height, the first one that is reported may be; it then
    counts as the target (`as_reported`). A vehicle that was told to stop says itself where it will. `told` False: it
    need not be reported at all, so no frame waits for a report of it.
    """

    latitude: int
    longitude: int
    amsl: int | None
    within: int = SAME
    level: int = SAME
    told: bool = True

    @property
    def place(self) -> Reported:
        """The place; of a height that may be any, 0."""
        return self.latitude, self.longitude, self.amsl or 0

    def as_reported(self, reported: Reported) -> "ExpectedTarget":
        """What is expected once it was reported: just that."""
        return replace(
            self, latitude=reported[0], longitude=reported[1], amsl=reported[2], within=KEPT, level=KEPT_LEVEL
        )

    def is_given(self, reported: Reported) -> bool:
        """Whether a report is of a place that we gave, and that was not reported before."""
        return self.within == SAME and self.amsl is not None and self.as_reported(self.place).matches(reported)

    def matches(self, reported: Reported) -> bool:
        """Whether a report is of this target."""
        latitude, longitude, amsl = reported
        level = self.amsl is None or abs(amsl - self.amsl) <= self.level
        return level and effects.apart(latitude, longitude, self.latitude, self.longitude) <= self.within


@dataclass(frozen=True, slots=True)
class ExpectedProgress:
    """How a stage shows its progress: some part of `measure` falls by a metre within `within_us` of link time.

    `either_way`: that it changes is enough. A return climbs, crosses and descends, to a place that the autopilot knows.
    """

    measure: Measure
    within_us: int
    either_way: bool = False


class Stage(NamedTuple):
    """One part of a manoeuvre: send, then wait until the effect is seen.

    `message` is sent once the flight mode is known, and again while it is not acknowledged; `command` is the MAV_CMD
    whose acknowledgement belongs to it. A message without one (None) is sent again each `repeat_us`, until the
    autopilot reports its `target`. `done` None: it has no effect that could be seen, so its acknowledgement has to do.
    `modes` are the flight modes that belong to this stage; another one means that somebody took over. `timeout_us` 0:
    only progress and the skill's own time limit end the wait. `powered`: it cannot go on once the motors are off on the
    ground. `target`: where the autopilot must say that it flies to. `progress`: what must get less meanwhile.
    `stops`: the vehicle must brake as its policy declares. `spare`: what is done already is not sent. `settled` leaves
    in place of `message` where the vehicle is in a mode of the stage already: it asks for none, so it takes none from a
    pilot who chose another one meanwhile. What it is answered says little: its target tells.
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


Stages: TypeAlias = Callable[[Command, ObservedVehicle, int], list[Stage]]
"""How a command is flown: what is seen and the target system to the stages of its manoeuvre."""


class FenceHabits(NamedTuple):
    """How an autopilot takes a fence.

    `frame` (MAV_FRAME) goes with each item. `all_inclusions`: the vehicle must be inside every inclusion; else inside
    any of them. `switches` are parameters that must have these bits set for the fence to count.
    """

    frame: int
    all_inclusions: bool
    switches: tuple[tuple[str, int], ...]


class ReturnAltitude(NamedTuple):
    """A parameter that holds the height at which the autopilot flies home, and the mm in one of its units."""

    parameter: str
    mm: int


@dataclass(frozen=True, slots=True)
class AutopilotFlavour:
    """An autopilot: its name, the names of its modes, how it is made to do each kind of motion, and its own ways.

    `estimator` is the message in which its estimator reports. `natural` are changes of mode (from, to) that it makes
    in the course of what it was told. `ours` are the modes in which manoeuvres of ours go somewhere or stay, `shows`
    those that it is in, armed, that was told to do a kind of motion and nothing since, however far it came; `aims` are
    those in which it names the target that it was given.
    `lag_us`: so long after it was entered a mode shows in what it tells. `mode_within_us`: no frame that moves the
    vehicle leaves on a mode report that is older (the link's delay comes on top): what the fastest report of the mode
    that it really gives allows. `returns` are parameters of which one is there, `limits` groups of such that lower or
    lift a return. `critical_acts`: a critical state in the air says that a failsafe of its own acts, also where it
    stays in the mode that it is in; else it may tell only. `bytewise`: integer parameters travel as their bytes.
    `fence` says how it takes a geofence, `own_fence` what bounds it has besides. `names_targets`: flying to a target
    that it was given, it goes on naming it, so that one that it names no more is somebody else's doing; and one that it
    names while it stands far from it is somebody's pause.
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


# ---------------------------------------------------------------- what both fly alike


def stopping(seen: ObservedVehicle) -> ExpectedTarget | None:
    """Where it may say that it will come to stand, told to stop now; None while it is not known where it is."""
    speed = seen.speed or 0
    within = _STOPS + _STOPS_S * speed + speed * speed // 2_000
    return ExpectedTarget(seen.latitude, seen.longitude, None, within) if seen.located else None


def entering(system: int, mode: Px4Mode | CopterMode) -> Stage:
    """A mode first. Where it is the mode already nothing is sent, for that would undo a takeover under way."""
    message = messages.set_mode(system, mode)
    return Stage(message, messages.DO_SET_MODE, effects.in_mode(mode), frozenset({mode}), MODE_US, spare=True)


def arming(system: int, modes: frozenset[int]) -> Stage:
    """The motors run, in one of these modes."""
    return Stage(messages.arm(system), messages.ARM_DISARM, lambda seen: seen.armed, modes, ARM_US)


def climbing(height: int) -> ExpectedProgress:
    """A climb gets a metre higher."""
    return ExpectedProgress(effects.up_to(height), 10_000_000)


def leg(
    message: Message, command: int | None, modes: frozenset[int], place: tuple[int, int], height: int, amsl: int | None,
    repeat_us: int = 0, settled: Message | None = None,
) -> Stage:  # fmt: skip
    """To a place (1e-7 degree) at a height above home, in a straight line: it gets a metre nearer in good time."""
    nearer = ExpectedProgress(effects.to_place(*place, height), 8_000_000)
    return Stage(
        message, command, effects.arrived(*place, height), modes, repeat_us=repeat_us, powered=True,
        target=ExpectedTarget(*place, amsl), progress=nearer, settled=settled,
    )  # fmt: skip


def returning(system: int, mode: Px4Mode | CopterMode) -> list[Stage]:
    """Home, and down there. The window is long: ArduCopter hovers over home for 5 s."""
    return _coming_down(system, mode, ExpectedProgress(effects.homeward, 45_000_000, either_way=True))


def landing(system: int, mode: Px4Mode | CopterMode) -> list[Stage]:
    """Down where it is."""
    return _coming_down(system, mode, ExpectedProgress(effects.to_the_ground, 15_000_000))


def _coming_down(system: int, mode: Px4Mode | CopterMode, progress: ExpectedProgress) -> list[Stage]:
    own = frozenset({mode})
    message = messages.set_mode(system, mode)
    return [
        Stage(message, messages.DO_SET_MODE, effects.in_mode_or_down(mode), own, MODE_US),
        Stage(None, None, lambda seen: seen.rests, own, progress=progress),
    ]
