"""The record of a scenario flight: plain values that a judge in another process can read.

All times are simulation time, in us since its start, unless stated otherwise.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import msgspec

from rtshcua.model.faults import Fault, FlightMode
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.scenario import Scenario


class TruthSample(NamedTuple):
    """The true state at a moment, whatever the vehicle reported (`simulation.world.Truth`)."""

    at_us: int
    latitude: int
    longitude: int
    up_mm: int
    speed_mm_s: int
    climb_mm_s: int
    armed: bool
    in_air: bool
    crashed: bool
    mode: FlightMode
    battery: int
    obstacle_mm: int | None
    """Distance to the nearest obstacle; None: there is none."""
    taken_over_us: int | None
    """When a pilot or the autopilot's failsafe took over; None: no takeover."""
    taken_over_by: str | None
    """`pilot` or `failsafe`."""


class SentFrame(NamedTuple):
    """A frame of the runtime: when it was sent, when it reached the vehicle, and when the autopilot handled it. None:
    never.
    """

    sent_us: int
    heard_us: int | None
    octets: bytes
    obeyed_us: int | None = None


class IncidentOccurrence(NamedTuple):
    """An incident of the scenario that took place, by its number. `note`: its result, if known."""

    number: int
    at_us: int
    fault: Fault
    text: str
    note: str = ""


class Reaction(NamedTuple):
    """A commanded fallback: its cause was received after `heard_us`, and the command made at `acted_us`."""

    heard_us: int
    acted_us: int


class HeardReadings(NamedTuple):
    """The readings of one frame: when they were measured, on the clock of the logs, and (slot, value) pairs."""

    measured_us: int
    values: tuple[tuple[int, int | None], ...]


class TrueImage(NamedTuple):
    """An image that the simulated camera stored: its time by the camera's clock, and the place that the autopilot
    believed to be at then (1e-7 degree), which the camera writes into its report.
    """

    utc_us: int
    latitude: int
    longitude: int


class Turn(NamedTuple):
    """A turn of the loop: its time, and the readings that it received, in order."""

    at_us: int
    heard: tuple[HeardReadings, ...]


@dataclass(frozen=True, slots=True)
class Life:
    """One process of the runtime, from its first record to its last. `ending` None: it was killed or failed."""

    began_us: int
    ended_us: int
    ending: str | None
    lines: tuple[bytes, ...]
    """Its log; recovered if the process was killed."""
    reactions: tuple[Reaction, ...]
    turns: tuple[Turn, ...] = ()
    """What it received in each turn of its loop."""
    kept_us: tuple[int, ...] = ()
    """When each line of its log was stored, except those that recovery added."""


def records_of(life: Life) -> list[dict[str, Any]]:
    """Return the readable records of its log."""
    records = []
    for line in life.lines:
        try:
            records.append(msgspec.json.decode(line))
        except msgspec.DecodeError:
            break
    return records


@dataclass(frozen=True, slots=True)
class ScenarioFlown:
    """One flight of a scenario. `start_us` is the monotonic time of the logs at the simulation's start."""

    scenario: Scenario
    flavour: str
    seed: int
    policy: Policy
    mission: Mission
    root: bytes
    """The `kid` of the key that signed the trust root: an audit pins it."""
    start_us: int
    utc_us: int
    """True UTC at the simulation's start, whatever any clock showed."""
    tick_us: int
    wait_us: int
    lives: tuple[Life, ...]
    happened: tuple[IncidentOccurrence, ...]
    samples: tuple[TruthSample, ...]
    frames: tuple[SentFrame, ...]
    """All frames that the runtime sent, in order."""
    ended_us: int
    """When the last process ended."""
    left: str | None
    """Why no further process was started although the run had not ended; None: the last process ended normally."""
    fault: str | None
    """The exception or time-out of the runtime; None: none."""
    notes: tuple[str, ...] = ()
    images: tuple[TrueImage, ...] = ()
    """All images that were stored."""

    @property
    def ending(self) -> str | None:
        """The ending of the last process."""
        return self.lives[-1].ending if self.lives else None
