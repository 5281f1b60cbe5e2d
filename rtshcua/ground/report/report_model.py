"""The content of a policy report as one immutable value, which `rtshcua docs --json` prints.

Texts are sentences with names in backticks. Lengths are in mm. Places are in the local plane: x east and y north of the
vehicle's home.
"""

from dataclasses import dataclass

from rtshcua.ground.drawing.drawn_site import FlightMargins, PlannedStep, PlannedWay, Site, ZoneView
from rtshcua.model.flat.contract import MotionKind


@dataclass(frozen=True, slots=True)
class FileDigest:
    """A source file of a policy, named as in `place`, and the SHA-256 of its bytes."""

    name: str
    sha256: str


@dataclass(frozen=True, slots=True)
class Fact:
    """A value with its label."""

    what: str
    value: str


@dataclass(frozen=True, slots=True)
class PermitView:
    """A `permit`: its number, sources and conditions, which must all hold."""

    rule: int
    through: str
    conditions: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Restriction:
    """A `confirm` or `forbid` about a right: its number, its effect and its conditions."""

    rule: int
    words: str
    conditions: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Right:
    """The right of a role to a skill; one of the ways is sufficient."""

    skill: str
    answer: str  # `yes`, `on conditions`, `after approval`, `after approval, on conditions`, `something else`, `no`
    ways: tuple[PermitView, ...]
    confirmations: tuple[Restriction, ...]
    prohibitions: tuple[Restriction, ...]


@dataclass(frozen=True, slots=True)
class Rights:
    """All rights of a role; an empty role means everybody else."""

    role: str
    rights: tuple[Right, ...]


@dataclass(frozen=True, slots=True)
class RuleView:
    """A rule by its signed number: its sentence, its text and its place."""

    number: int
    kind: str
    told: str
    written: str
    place: str
    changed: bool


@dataclass(frozen=True, slots=True)
class ParameterView:
    """A parameter of a skill."""

    name: str
    what: str
    limits: str
    default: str


@dataclass(frozen=True, slots=True)
class PermittedLimit:
    """The widest limits of a parameter that the rules permit to anyone. `kind` is `altitude`, `speed` or `place`;
    `conditions` means that they depend on other conditions too.
    """

    skill: str
    parameter: str
    kind: str
    limits: str
    conditions: bool


@dataclass(frozen=True, slots=True)
class PatternView:
    """A survey pattern: its name, and its spacing or radius, start and direction."""

    name: str
    told: str


@dataclass(frozen=True, slots=True)
class SkillView:
    """A skill and its contract. `as_link` describes the difference at the end of a chain, empty if there is none.

    `patterns` are the patterns of a survey. `left_out` are the clauses that do not apply because the vehicle lacks a
    sensor. `accepted` is what a client of a gateway sends for the skill, `emitted` what the skill sends to payload.
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
    accepted: tuple[str, ...]
    emitted: tuple[str, ...]
    place: str
    changed: bool


@dataclass(frozen=True, slots=True)
class SignalView:
    """A signal of the vehicle."""

    name: str
    type: str
    source: str
    unknown: str
    changed: bool


@dataclass(frozen=True, slots=True)
class StepView:
    """A step of a mission, and its path of local places, which ends at the last one. `tighter` are the limits that
    tighten its skill's contract. `motion` is the kind of its motion (`rtshcua.model.flat.contract.MotionKind`), and
    `speed` is in mm/s, 0 where the vehicle chooses it. `pictures` are the proved numbers of a survey's pictures.
    """

    number: int
    phase: str
    told: str
    otherwise: str
    tighter: tuple[str, ...]
    path: tuple[tuple[int, int], ...]
    altitude: int
    motion: str
    speed: int
    heights: tuple[int, ...] = ()
    pictures: str = ""


@dataclass(frozen=True, slots=True)
class MissionView:
    """A mission under the policy; `bounds` are its upper bounds."""

    name: str
    intent: str
    proposed: str
    bounds: tuple[Fact, ...]
    values: str
    steps: tuple[StepView, ...]

    @property
    def way(self) -> PlannedWay:
        """Its way, to be drawn."""
        return PlannedWay(
            self.name,
            tuple(
                PlannedStep(
                    step.number, step.path, MotionKind[step.motion.upper()], step.altitude, step.speed, step.heights
                )
                for step in self.steps
            ),
        )


@dataclass(frozen=True, slots=True)
class CaseView:
    """A test case: its premises, its request, the expected decision, and the decision when the page was made."""

    name: str
    given: tuple[str, ...]
    when: str
    expect: str
    decided: str
    met: bool
    generated: bool = False


@dataclass(frozen=True, slots=True)
class NominalView:
    """A nominal from which tests start, and its place."""

    name: str
    place: str
    given: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ScenarioView:
    """A scenario: a flight with faults, and its expectations. The report describes it; `rtshcua test` flies it."""

    name: str
    place: str
    told: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ChangeView:
    """A change with its old and new texts, which are empty if there is no old or new part.

    `direction` of this change alone: `stricter`, `looser` or `cannot tell`.
    """

    what: str
    before: tuple[str, ...]
    after: tuple[str, ...]
    direction: str = "cannot tell"


@dataclass(frozen=True, slots=True)
class Glance:
    """A policy on one page: who may request what, where, how high and how fast, what needs a person, what happens if
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
    """A policy for a vehicle; `digest` identifies what is signed."""

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
    elevation: int | None
    margins: FlightMargins
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

    @property
    def site(self) -> Site:
        """What is drawn of it."""
        return Site(
            self.name,
            self.zones,
            self.home,
            self.home_within,
            self.return_altitude,
            self.elevation,
            self.margins,
        )


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
    """All chapters; `made_at` is an argument, not read from a clock."""

    title: str
    made_at: str
    made_by: str
    chapters: tuple[Chapter, ...]
    findings: tuple[FindingView, ...]
