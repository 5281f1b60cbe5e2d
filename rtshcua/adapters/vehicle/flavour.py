"""What differs between autopilots, as a value: each flavour's package makes one."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

from rtshcua.adapters.vehicle.fence import FenceHabits
from rtshcua.adapters.vehicle.observed import Observed
from rtshcua.adapters.vehicle.progress import Expected
from rtshcua.adapters.vehicle.targets import Target
from rtshcua.onboard.ports import Command

Message = Any


class Stage(NamedTuple):
    """One part of a manoeuvre: send, then wait until the effect is seen.

    `message` is sent once the flight mode is known, and again while it is not acknowledged; `command` is the MAV_CMD
    whose acknowledgement belongs to it. A message without one (None) is sent again each `repeat_us`, until the
    autopilot reports its `target`. `done` None: it has no effect that could be seen, so its acknowledgement has to do.
    `modes` are the flight modes that belong to this stage; another one means that somebody took over. `timeout_us` 0:
    only progress and the skill's own time limit end the wait. `powered`: it cannot go on once the motors are off on the
    ground. `target`: where the autopilot must say that it flies to. `progress`: what must get less meanwhile.
    `stops`: the vehicle must brake as its policy declares. `spare`: what is done already is not sent.
    """

    message: Message | None
    command: int | None
    done: Callable[[Observed], bool] | None
    modes: frozenset[int]
    timeout_us: int = 0
    repeat_us: int = 0
    powered: bool = False
    target: Target | None = None
    progress: Expected | None = None
    stops: bool = False
    spare: bool = False


Stages: TypeAlias = Callable[[Command, Observed, int], list[Stage]]
"""How a command is flown: what is seen and the target system to the stages of its manoeuvre."""


@dataclass(frozen=True, slots=True)
class ReturnAltitude:
    """A parameter that holds the height at which the autopilot flies home, and the mm in one of its units."""

    parameter: str
    mm: int


@dataclass(frozen=True, slots=True)
class Flavour:
    """An autopilot: its name, the names of its modes, how it is made to do each kind of motion, and its own ways.

    `estimator` is the message in which its estimator reports. `natural` are changes of mode (from, to) that it makes
    in the course of what it was told. `ours` are the modes in which manoeuvres of ours go somewhere or stay.
    `mode_within_us`: no frame that moves the vehicle leaves on a mode report that is older (the link's delay comes on
    top): what the fastest report of the mode that it really gives allows. `returns` are parameters of which one is
    there. `bytewise`: integer parameters travel as their bytes. `fence` says how it takes a geofence.
    """

    name: str
    autopilot: int  # MAV_AUTOPILOT of its heartbeat
    mode_names: Mapping[int, str]
    stages: Stages
    estimator: str
    natural: frozenset[tuple[int, int]]
    ours: frozenset[int]
    mode_within_us: int
    returns: tuple[ReturnAltitude, ...]
    bytewise: bool
    fence: FenceHabits


def mode_name(flavour: Flavour, number: int) -> str:
    """The flavour's name of a `custom_mode`, or the number itself."""
    return flavour.mode_names.get(number, f"mode {number}")
