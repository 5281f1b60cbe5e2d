"""What was observed in the sorties of a qualification: plain values, of which the checks are made.

Times are us of our monotonic clock, lengths mm, speeds mm/s, places 1e-7 degree.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple

from rtshcua.adapters.doctor.diagnosis import VehicleFinding
from rtshcua.wire.qualification import Firmware


class TakeoverKind(StrEnum):
    """How somebody else takes the vehicle over."""

    MODE = "mode"
    PAUSE = "pause"
    TARGET = "target"


class MotionSample(NamedTuple):
    """A report of place and speed: over ground and upwards."""

    at_us: int
    latitude: int
    longitude: int
    height: int
    speed: int
    climb: int


@dataclass(slots=True)
class ObservedCommand:
    """A command that was begun: what it was, when its first frame left, and when and how it ended. `how` is
    `succeeded`, a reason of failure, `replaced`, or empty while it flies. `shortened`: it was to end on its way.
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
    """A MAV_CMD that was sent, and the result of its first acknowledgement. `asks_no_mode`: a DO_REPOSITION without the
    flag that changes the mode, which PX4 calls unsupported and obeys in Hold (recorded; ADR 34).
    """

    command: int
    sent_us: int
    answered_us: int | None = None
    result: int | None = None
    asks_no_mode: bool = False


@dataclass(slots=True)
class ObservedTakeover:
    """Somebody else took over. `sent_us` None: a pilot did, nobody knows when. `obeyed_us`: that was acknowledged to
    whoever sent it; `mode_us`: another mode showed in a heartbeat; `shown_us`: the driver told of it, as `how`;
    `moved_us`: the last frame of ours to move it left. `unwatched_us`: how long nobody looked before the mode showed.
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
    """Nothing was let through for `for_us`, in either direction, while it held. `fresh_us`: all that came before had
    come again. `kept`: the command was still in force then, and the mode the same.
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
    """All that was observed. `mode_within_us`: the W that is declared for the flavour; `settings`: what the doctor
    finds of its parameters; `missing`: why sorties were not flown, by their name.
    """

    firmware: Firmware | None
    mode_within_us: int
    round_trip_us: int | None
    sorties: tuple[ObservedSortie, ...]
    settings: tuple[VehicleFinding, ...]
    missing: Mapping[str, str]

    def sortie(self, name: str) -> ObservedSortie | None:
        """The sortie of this name, if it was flown."""
        return next((each for each in self.sorties if each.name == name), None)
