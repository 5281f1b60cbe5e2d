"""The payload of a policy envelope: everything that authority rests on, in one signed piece."""

from enum import IntEnum

from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.contract import Contract, Link
from rtshcua.model.flat.signal import Signal
from rtshcua.model.flat.struct import Flat
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
    `within_us` how long an approval is awaited, `target` what a degrade rule flies. `second` is the role index of
    another person whose approval is needed too, -1 where one person is enough.
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
    """What a flight does while its records are not kept."""

    LAND = 0  # the mission is given up: what runs falls back, in the air the contingency flies
    REFUSE = 1  # what runs may finish, and no further step begins


class AfterSilence(IntEnum):
    """What follows when the vehicle is heard again, its state is fresh, and it was silent for too long."""

    CONTINUE = 0  # the step goes on, as long as all that must hold holds
    CONTINGENCY = 1  # the mission is given up: the contingency flies


#: the longest silence after which a flight simply goes on, where a policy does not say it, us
SILENCE_US = 30_000_000


class MonitorKind(IntEnum):
    """What a temporal monitor remembers of its condition."""

    FOR_LAST = 0  # it was true all through the window: bounded-past historically
    WITHIN_LAST = 1  # it was true at some moment of the window: bounded-past once
    RISING = 2  # it is true, and was false at the observation before
    FALLING = 3  # it is false, and was true at the observation before


class Monitor(Flat, frozen=True):
    """A temporal monitor. `when` reads signals, zones, the time and monitors before this one; no argument, no phase.

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
    """What a vehicle keeps at least, by which durations and charges are proved. Speeds mm/s over ground.

    `cruise` is flown across where a step says no speed, `homeward` on a return. `landing` is the descent below
    `landing_below` (mm above home). `acceleration`, mm/s in a second, is what it gains and loses on a leg. `air` is its
    speed through the air, `wind` the most that it is flown in. A full battery flies for `flight_us`, whatever it flies.
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


class VehicleLimits(Flat, frozen=True):
    """The one aircraft this policy is for. Lengths mm, speeds mm/s, times us, charge 1/10000.

    `position`, `height`, `battery` are the state slots of the well-known signals (-1: the policy declares none).
    `return_altitude` (mm above home) is the height that a return climbs to, if it is lower, before it flies home.
    Told to stop, it goes on for at most `reaction_us` and then loses at least `braking` mm/s of its speed in a second;
    with `braking` 0 that is not declared. `north`, `east`, `down` are the slots of the signals of its velocity over
    ground, -1 each without `braking`. `without` are the names of the signals whose sensors are not fitted, ascending.
    Without `speeds`, the way home is counted at the greatest `speed`; the compiler always writes them.

    The local time is `utc_offset_us` from UTC. Where it is that of a time zone, by its IANA name, `time_zone_data` is
    the version of the time-zone data that it was worked out by, and `offsets` are a moment (UTC, us) and the offset
    from it on, again and again, and last the moment from which on nothing is known; `utc_offset_us` is 0.
    """

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


class LeftOut(Flat, frozen=True):
    """A clause, or a rule, `where fitted` that does not apply, for the vehicle is without a signal that it reads.

    `part` is `require`, `assume` or `maintain` of the contract `skill`; or, and `skill` is -1, a rule: `forbid`,
    `confirm` or `degrade`. Nothing is decided by it; it is there to be read.
    """

    skill: int
    part: str
    text: str
    source: int
    start: int
    end: int


class Policy(Flat, frozen=True):
    """A whole policy. `zones` holds the declared zones first (`declared` of them), derived ones after.

    `sets` are membership sets of enumeration values or zone indexes. `tables` map each declared zone's index to a
    derived zone's index, for `grow(argument, margin)`. `monitors` are observed in order; `phases` are the names of
    mission phases that conditions mention. `sources` are file names for spans, `source_digests` the
    SHA-256 of each. `without_evidence` is a `WithoutEvidence`. After a silence of the vehicle longer than `silence_us`,
    `after_silence` follows, an `AfterSilence`; a shorter one changes nothing. `left_out` are the clauses and
    rules that do not apply to the vehicle.
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
