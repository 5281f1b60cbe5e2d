"""The content of a policy report as one plain value: frozen, comparable, and what `rtshcua docs --json` prints.

Texts are sentences with names between backticks. Lengths are in mm, of the local plane where a place is meant: x east
and y north of the vehicle's home.
"""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class FileDigest:
    """A file that a policy rests on, named as in the `place` of what stands in it, and the SHA-256 of its bytes."""

    name: str
    sha256: str


@dataclass(frozen=True, slots=True)
class Fact:
    """A figure, and what it is of."""

    what: str
    value: str


@dataclass(frozen=True, slots=True)
class PermitView:
    """One `permit`: through which sources, and what must hold all together. `rule` is its number."""

    rule: int
    through: str
    conditions: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Restriction:
    """A `confirm`, `forbid` or `degrade` about a right: what it comes to, and when; `rule` is its number."""

    rule: int
    words: str
    conditions: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Right:
    """What a role may have done of one skill; any of the ways is enough."""

    skill: str
    answer: str  # `yes`, `on conditions`, `after approval`, `after approval, on conditions`, `something else`, `no`
    ways: tuple[PermitView, ...]
    confirmations: tuple[Restriction, ...]
    prohibitions: tuple[Restriction, ...]


@dataclass(frozen=True, slots=True)
class Rights:
    """All that a role may have done; an empty role stands for everybody else."""

    role: str
    rights: tuple[Right, ...]


@dataclass(frozen=True, slots=True)
class RuleView:
    """One rule in the order in which they are signed, as a sentence, and as it is written and where."""

    number: int
    kind: str
    told: str
    written: str
    place: str
    changed: bool


@dataclass(frozen=True, slots=True)
class ParameterView:
    """What may be asked of a skill."""

    name: str
    what: str
    limits: str
    default: str


@dataclass(frozen=True, slots=True)
class PermittedLimit:
    """What the rules permit of a parameter of a skill, over all who may ask. `kind` is `altitude`, `speed` or `place`;
    `conditions`: something else must hold besides for what is widest in it.
    """

    skill: str
    parameter: str
    kind: str
    limits: str
    conditions: bool


@dataclass(frozen=True, slots=True)
class PatternView:
    """What a survey may fly: the pattern's name, and its spacing or radius, start and direction."""

    name: str
    told: str


@dataclass(frozen=True, slots=True)
class SkillView:
    """A contract; `as_link` is what is otherwise where a chain ends in it, empty for any other skill.

    `patterns` are those that a survey may be flown in, none of any other skill. `left_out` are the clauses that do not
    count, for the vehicle is without a sensor.
    """

    name: str
    note: str
    motion: str
    patterns: tuple[PatternView, ...]
    parameters: tuple[ParameterView, ...]
    timing: tuple[str, ...]
    require: tuple[str, ...]
    assume: tuple[str, ...]
    maintain: tuple[str, ...]
    left_out: tuple[str, ...]
    fallback: tuple[str, ...]
    as_link: str
    record: str
    place: str
    changed: bool


@dataclass(frozen=True, slots=True)
class SignalView:
    """What the vehicle reports."""

    name: str
    type: str
    source: str
    unknown: str
    changed: bool


@dataclass(frozen=True, slots=True)
class ZoneOutline:
    """An outline in the local plane, exactly as it is signed: a circle by its centre and the square of its radius, or
    else rings, outer ones counter-clockwise and holes clockwise.
    """

    rings: tuple[tuple[tuple[int, int], ...], ...] = ()
    centre: tuple[int, int] | None = None
    radius_squared: int = 0


@dataclass(frozen=True, slots=True)
class PlaceView:
    """A place that a zone is written by: what it is, WGS 84, and where that is in the local plane."""

    what: str
    latitude: str
    longitude: str
    x: int
    y: int


@dataclass(frozen=True, slots=True)
class ZoneView:
    """A zone. `use` says what the airspace makes of it: `allowed`, `forbidden` or empty; `floor` and `ceiling` are mm
    above home, None where there is none; `derived` is one that a rule grows out of another.
    """

    name: str
    note: str
    use: str
    shape: str
    band: str
    times: str
    ground: ZoneOutline
    floor: int | None
    ceiling: int | None
    places: tuple[PlaceView, ...]
    place: str
    changed: bool
    derived: bool = False


@dataclass(frozen=True, slots=True)
class StepView:
    """One step of a mission, and the way that it takes: local places, the last of which is where it ends. `tighter` is
    what it is held to beyond its skill's contract.
    """

    number: int
    phase: str
    told: str
    otherwise: str
    tighter: tuple[str, ...]
    path: tuple[tuple[int, int], ...]
    altitude: int


@dataclass(frozen=True, slots=True)
class MissionView:
    """A mission under the policy; `bounds` is what it takes at most."""

    name: str
    intent: str
    proposed: str
    bounds: tuple[Fact, ...]
    values: str
    steps: tuple[StepView, ...]


@dataclass(frozen=True, slots=True)
class CaseView:
    """A test case: what is given, what is asked, what must be decided, and what was decided when the page was made."""

    name: str
    given: tuple[str, ...]
    when: str
    expect: str
    decided: str
    met: bool
    generated: bool = False


@dataclass(frozen=True, slots=True)
class NominalView:
    """What holds where tests begin, unless they say otherwise, and where that is written."""

    name: str
    place: str
    given: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ScenarioView:
    """A flight on which things go wrong, and what must come of it. It is told here, and flown by `rtshcua test`."""

    name: str
    place: str
    told: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ChangeView:
    """What is new or other than before, and its words then and now: none where there was, or is, no such thing.

    `direction`: `stricter`, `looser` or `cannot tell`, of this change by itself.
    """

    what: str
    before: tuple[str, ...]
    after: tuple[str, ...]
    direction: str = "cannot tell"


@dataclass(frozen=True, slots=True)
class Glance:
    """A policy on one page: who may have what done, where, how high, how fast, what needs a person, what happens when
    something goes wrong, and what the policy does not cover.
    """

    who: tuple[Fact, ...]
    where: tuple[str, ...]
    height: tuple[str, ...]
    speed: tuple[str, ...]
    person: tuple[str, ...]
    wrong: tuple[Fact, ...]
    beyond: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Chapter:
    """A policy for a vehicle, with all that it rests on; `digest` names exactly what is signed."""

    name: str
    version: int
    place: str  # the file that declares it
    note: str
    digest: str
    files: tuple[FileDigest, ...]
    vehicle: tuple[Fact, ...]
    home: tuple[int, int]
    home_within: int
    return_altitude: int
    rights: tuple[Rights, ...]
    rules: tuple[RuleView, ...]
    rules_left_out: tuple[str, ...]
    permitted: tuple[PermittedLimit, ...]
    airspace: str
    contingency: tuple[str, ...]
    evidence: str
    silence: str
    skills: tuple[SkillView, ...]
    signals: tuple[SignalView, ...]
    states: tuple[Fact, ...]
    zones: tuple[ZoneView, ...]
    missions: tuple[MissionView, ...]
    starts: tuple[NominalView, ...]
    cases: tuple[CaseView, ...]
    scenarios: tuple[ScenarioView, ...]
    since: str  # what it was compared with; empty where with nothing
    changes: tuple[ChangeView, ...]


@dataclass(frozen=True, slots=True)
class FindingView:
    """A warning or a note of `rtshcua check`."""

    code: str
    severity: str
    message: str
    help: str
    place: str


@dataclass(frozen=True, slots=True)
class PolicyReport:
    """All chapters; `made_at` is given, never read from a clock."""

    title: str
    made_at: str
    made_by: str
    chapters: tuple[Chapter, ...]
    findings: tuple[FindingView, ...]
