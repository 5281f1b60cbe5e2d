"""The observations in the sorties of a qualification, as plain values for the checks. Times are us of our monotonic
clock, lengths mm, speeds mm/s, places 1e-7 degree.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple

from rtshcua.adapters.doctor.diagnosis import VehicleFinding
from rtshcua.wire.qualification import Firmware


class TakeoverKind(StrEnum):
    """How somebody else takes over."""

    MODE = "mode"
    PAUSE = "pause"
    TARGET = "target"


class MotionSample(NamedTuple):
    """A report of position and speed: over ground and upwards."""

    at_us: int
    latitude: int
    longitude: int
    height: int
    speed: int
    climb: int


@dataclass(slots=True)
class ObservedCommand:
    """A command: when its first frame left, and when and how it ended. `how` is `succeeded`, a reason of failure,
    `replaced`, or empty in flight. `shortened`: it was planned to end early.
    """

    kind: int
    skill: str
    begun_us: int
    speed: int = 0
    shortened: bool = False
    sent_us: int | None = None
    ended_us: int | None = None
    how: str = ""


@dataclass(slots=True)
class ObservedAnswer:
    """A sent MAV_CMD and the result of its first acknowledgement. `asks_no_mode`: a DO_REPOSITION without the flag that
    changes the mode, which PX4 calls unsupported and obeys in Hold (recorded; ADR 34).
    """

    command: int
    sent_us: int
    answered_us: int | None = None
    result: int | None = None
    asks_no_mode: bool = False


@dataclass(slots=True)
class ObservedTakeover:
    """A takeover. `sent_us` None: by a pilot, at an unknown time. `obeyed_us`: it was acknowledged to its sender;
    `mode_us`: another mode showed in a heartbeat; `shown_us`: the driver reported it, as `how`; `moved_us`: our last
    frame that moves the vehicle left. `unwatched_us`: how long nothing was watched before the mode showed.
    """

    kind: TakeoverKind
    sent_us: int | None
    obeyed_us: int | None = None
    mode_us: int | None = None
    shown_us: int | None = None
    how: str = ""
    moved_us: int | None = None
    unwatched_us: int = 0


@dataclass(slots=True)
class ObservedSilence:
    """A silence of `for_us` in both directions during a hold. `fresh_us`: every earlier stream had come again. `kept`:
    the command was still in force, and the mode unchanged.
    """

    for_us: int
    began_us: int
    ended_us: int | None = None
    lost_us: int | None = None
    back_us: int | None = None
    fresh_us: int | None = None
    kept: bool = False


@dataclass(slots=True)
class ObservedSortie:
    """One sortie, from its takeoff to the ground."""

    name: str
    samples: list[MotionSample] = field(default_factory=list)
    commands: list[ObservedCommand] = field(default_factory=list)
    answers: list[ObservedAnswer] = field(default_factory=list)
    beats: list[int] = field(default_factory=list)
    """When heartbeats came, while something of ours flew."""
    silences: list[ObservedSilence] = field(default_factory=list)
    takeover: ObservedTakeover | None = None
    ending: str = ""
    airborne_us: int = 0
    """How long it was in the air."""
    down: bool = False
    """It was last seen on the ground, disarmed."""
    streams: Mapping[str, tuple[int, int | None]] = field(default_factory=dict)
    """By message: the interval asked for, and the one that came; None where none came while it was measured."""
    fence: str | None = None
    """What was found of the fence; None where none was set."""
    fence_read: bool = False
    """It was uploaded, read back, and was the same."""
    switches: Mapping[str, tuple[int, float | None]] = field(default_factory=dict)
    """Of the parameters that switch the fence on: the bits that are needed, and the value that was read in the air."""


@dataclass(frozen=True, slots=True)
class ObservedQualification:
    """All observations. `mode_within_us`: the declared W of the flavour; `settings`: the doctor's findings about its
    parameters; `missing`: why sorties were not flown, by name.
    """

    firmware: Firmware | None
    mode_within_us: int
    round_trip_us: int | None
    sorties: tuple[ObservedSortie, ...]
    settings: tuple[VehicleFinding, ...]
    missing: Mapping[str, str]

    def sortie(self, name: str) -> ObservedSortie | None:
        """The sortie of this name, if flown."""
        return next((each for each in self.sorties if each.name == name), None)
