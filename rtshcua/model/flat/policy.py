"""The payload of a policy envelope: all authority in one signed document."""

from enum import IntEnum
from typing import ClassVar

from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Contract, Link
from rtshcua.model.flat.signal import Signal
from rtshcua.model.flat.struct import Extended, Flat
from rtshcua.model.flat.zone import Projection, Zone


class RuleKind(IntEnum):
    """What a rule does when it matches."""

    FORBID = 0
    PERMIT = 1
    CONFIRM = 2
    DEGRADE = 3


class Rule(Flat, frozen=True):
    """A rule. `skills` are contract indexes and `roles` role indexes, ascending; empty means any.

    `sources` are `SourceKind` values, ascending; empty means any. `approver` is a role index (confirm, else -1),
    `within_us` how long an approval is awaited, `target` the link of a degrade rule. `second` is the role index of
    a second person who must approve too, -1 if one person is enough.
    """

    kind: int
    skills: tuple[int, ...]
    roles: tuple[int, ...]
    sources: tuple[int, ...]
    when: Clause | None
    approver: int
    within_us: int
    target: Link | None
    text: str
    source: int
    start: int
    end: int
    second: int = -1


class WithoutEvidence(IntEnum):
    """What a flight does while its records cannot be stored."""

    LAND = 0  # the mission is aborted: the running step falls back; in the air, the contingency flies
    REFUSE = 1  # the running step may finish, and no further step begins


class AfterSilence(IntEnum):
    """What follows a long silence of the vehicle, once it is heard again and its state is fresh."""

    CONTINUE = 0  # the step continues while its conditions hold
    CONTINGENCY = 1  # the mission is aborted: the contingency flies


#: the longest silence after which a flight simply continues, if the policy sets none, us
SILENCE_US = 30_000_000


class MonitorKind(IntEnum):
    """What a temporal monitor remembers of its condition."""

    FOR_LAST = 0  # it was true all through the window: bounded-past historically
    WITHIN_LAST = 1  # it was true at some moment of the window: bounded-past once
    RISING = 2  # it is true, and was false at the observation before
    FALLING = 3  # it is false, and was true at the observation before


class Monitor(Flat, frozen=True):
    """A temporal monitor. `when` reads signals, zones, the time and earlier monitors, but no argument and no phase.

    `window_us` is 0 for RISING and FALLING.
    """

    kind: int
    window_us: int
    when: Clause


class Airspace(Flat, frozen=True):
    """The vehicle stays inside every zone of `inside` and outside every zone of `outside` (zone indexes)."""

    inside: tuple[int, ...]
    outside: tuple[int, ...]
    text: str
    source: int
    start: int
    end: int


class Speeds(Flat, frozen=True):
    """Lower bounds of a vehicle's speeds, from which durations and charges are proved. Speeds mm/s over ground.

    `cruise` is the horizontal speed where a step sets none, `homeward` that of a return. `landing` is the descent
    below `landing_below` (mm above home). `acceleration`, in mm/s per second, applies to both ends of a leg. `air`
    is the speed through the air, `wind` the greatest wind in which it flies. A full battery lasts for `flight_us`
    of any flight.
    """

    cruise: int
    climb: int
    descent: int
    landing: int
    landing_below: int
    homeward: int
    acceleration: int
    air: int
    wind: int
    flight_us: int


class VehicleLimits(Extended, frozen=True):
    """The one aircraft that this policy is for. Lengths mm, speeds mm/s, times us, charge 1/10000.

    `position`, `height`, `battery` are the state slots of the well-known signals (-1: the policy declares none).
    `return_altitude` (mm above home) is the height to which a return climbs, if it is lower, before it flies home.
    Told to stop, the vehicle continues for at most `reaction_us` and then loses at least `braking` mm/s of its
    speed in a second; 0 means that this is not declared. `north`, `east`, `down` are the slots of the signals of
    its velocity over ground, -1 each without `braking`. `without` are the names of the signals whose sensors are
    not fitted, ascending. Without `speeds`, the way home is computed with the greatest `speed`; the compiler
    always writes them.

    Local time is `utc_offset_us` from UTC. If it is that of a time zone, given by its IANA name, `time_zone_data`
    is the version of the time-zone data, `utc_offset_us` is 0, and `offsets` alternates between a moment (UTC, us)
    and the offset from it on, and ends with the moment from which local time is unknown. `servos` are the servo
    outputs that skills may set, ascending.
    """

    LEAST: ClassVar[int] = 23

    name: str
    identity: str
    home_within: int
    speed: int
    climb: int
    position_error: int
    endurance_us: int
    reserve: int
    utc_offset_us: int
    position: int
    height: int
    battery: int
    return_altitude: int = 0
    braking: int = 0
    reaction_us: int = 0
    north: int = -1
    east: int = -1
    down: int = -1
    without: tuple[str, ...] = ()
    speeds: Speeds | None = None
    time_zone: str = ""
    time_zone_data: str = ""
    offsets: tuple[int, ...] = ()
    servos: tuple[int, ...] = ()


class LeftOut(Flat, frozen=True):
    """A clause or a rule `where fitted` that does not apply, because the vehicle is without a signal that it reads.

    `part` is `require`, `assume` or `maintain` of the contract `skill`; or, with `skill` -1, a rule: `forbid`,
    `confirm` or `degrade`. It decides nothing and is only for display.
    """

    skill: int
    part: str
    text: str
    source: int
    start: int
    end: int


class Policy(Flat, frozen=True):
    """A whole policy. `zones` holds the declared zones first (`declared` of them), then the derived ones.

    `sets` are membership sets of enumeration values or zone indexes. `tables` map each declared zone's index to a
    derived zone's index, for `grow(argument, margin)`. `monitors` are evaluated in order; `phases` are the names
    of mission phases that conditions mention. `sources` are file names for spans, `source_digests` the SHA-256 of
    each. `without_evidence` is a `WithoutEvidence`. A silence of the vehicle longer than `silence_us` is followed
    by `after_silence`, an `AfterSilence`; a shorter one has no effect. `left_out` are the clauses and rules that
    do not apply to the vehicle.
    """

    name: str
    version: int
    vehicle: VehicleLimits
    projection: Projection
    roles: tuple[str, ...]
    signals: tuple[Signal, ...]
    slots: int
    zones: tuple[Zone, ...]
    declared: int
    tables: tuple[tuple[int, ...], ...]
    sets: tuple[tuple[int, ...], ...]
    contracts: tuple[Contract, ...]
    rules: tuple[Rule, ...]
    airspace: Airspace | None
    contingency: tuple[Link, ...]
    sources: tuple[str, ...]
    source_digests: tuple[bytes, ...]
    monitors: tuple[Monitor, ...] = ()
    phases: tuple[str, ...] = ()
    without_evidence: int = 0
    silence_us: int = SILENCE_US
    after_silence: int = AfterSilence.CONTINGENCY
    left_out: tuple[LeftOut, ...] = ()
