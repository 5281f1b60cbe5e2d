"""What a flight of a scenario leaves behind: plain values, that a judge in another process can read.

All times are those of the simulation, in us since its start, unless a name says otherwise.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import msgspec

from rtshcua.model.faults import Fault, FlightMode
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.scenario import Scenario


class TruthSample(NamedTuple):
    """What really was at a moment, whatever the vehicle reported (`simulation.world.Truth`)."""

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
    """How far it is to the nearest thing that stands around; None: nothing does."""
    taken_over_us: int | None
    """Since when somebody else than we flies it, a pilot or the autopilot itself; None: nobody does."""
    taken_over_by: str | None
    """`pilot` or `failsafe`."""


class SentFrame(NamedTuple):
    """A frame of ours: when it was sent, when it came to the vehicle, and when the autopilot got to it, to obey,
    answer or refuse it. None: it never did.
    """

    sent_us: int
    heard_us: int | None
    octets: bytes
    obeyed_us: int | None = None


class IncidentOccurrence(NamedTuple):
    """An incident of the scenario, by its number, that really came. `note`: what became of it, where that is told."""

    number: int
    at_us: int
    fault: Fault
    text: str
    note: str = ""


class Reaction(NamedTuple):
    """A fallback was commanded: what it follows from came after `heard_us`, and was acted on at `acted_us`."""

    heard_us: int
    acted_us: int


class HeardReadings(NamedTuple):
    """What one frame told: when it was measured, on the clock of the logs, and (slot, value) of its signals."""

    measured_us: int
    values: tuple[tuple[int, int | None], ...]


class Turn(NamedTuple):
    """A turn of the loop: when, and which values of signals it was given, in their order."""

    at_us: int
    heard: tuple[HeardReadings, ...]


@dataclass(frozen=True, slots=True)
class Life:
    """One process of the runtime, from its first record to its last. `ending` None: it was killed, or it broke."""

    began_us: int
    ended_us: int
    ending: str | None
    lines: tuple[bytes, ...]
    """Its log; what was killed is recovered."""
    reactions: tuple[Reaction, ...]
    turns: tuple[Turn, ...] = ()
    """What it heard, turn by turn of its loop."""
    kept_us: tuple[int, ...] = ()
    """When each line of its log was kept, but for those that recovery added."""


def records_of(life: Life) -> list[dict[str, Any]]:
    """What of its log can be read."""
    records = []
    for line in life.lines:
        try:
            records.append(msgspec.json.decode(line))
        except msgspec.DecodeError:
            break
    return records


@dataclass(frozen=True, slots=True)
class ScenarioFlown:
    """One flight of a scenario. `start_us` is what the monotonic clock of the logs said at the simulation's start."""

    scenario: Scenario
    flavour: str
    seed: int
    policy: Policy
    mission: Mission
    root: bytes
    """The name of the key that signed the trust root: what an audit is pinned to."""
    start_us: int
    utc_us: int
    """What time it really was at the simulation's start, whatever any clock showed."""
    tick_us: int
    wait_us: int
    lives: tuple[Life, ...]
    happened: tuple[IncidentOccurrence, ...]
    samples: tuple[TruthSample, ...]
    frames: tuple[SentFrame, ...]
    """All that were sent, in their order."""
    ended_us: int
    """When the last process ended; what came after it, the vehicle did alone."""
    left: str | None
    """Why no process was there any more, though nothing had ended; None: the last one came to its end."""
    fault: str | None
    """What went wrong inside the runtime, or that it did not end; None: nothing."""
    notes: tuple[str, ...] = ()

    @property
    def ending(self) -> str | None:
        """How the last process ended."""
        return self.lives[-1].ending if self.lives else None
