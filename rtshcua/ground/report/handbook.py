"""The whole handbook: a chapter for each policy of the programs that were asked for."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.ground.checker.symbols import collect
from rtshcua.ground.language.load import Program
from rtshcua.ground.lower.policy import LoweredPolicy
from rtshcua.ground.prove.mission_bounds import Bounds
from rtshcua.ground.report.cases import Tried, starts_and_cases
from rtshcua.ground.report.chapter import chapter, digest_of
from rtshcua.ground.report.missions import mission_told
from rtshcua.ground.report.model import Chapter, FindingTold, Handbook, MissionTold, ScenarioTold
from rtshcua.ground.report.subject import Subject, place_of
from rtshcua.ground.report.words.places import utc
from rtshcua.ground.report.words.scenarios import told_scenario
from rtshcua.ground.report.words.values import told_value
from rtshcua.ground.report.words.vocabulary import Vocabulary, listed
from rtshcua.ground.testing.case import PolicyUnderTest
from rtshcua.ground.testing.case_result import CaseResult
from rtshcua.ground.versions.raised import before
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.ir.missions import MissionDecl
from rtshcua.model.ir.scenarios import ScenarioDecl

_SECOND = 1_000_000  # us: the date of a page has no parts of one


@dataclass(frozen=True, slots=True)
class Flown:
    """A mission as it compiles, with the defaults of its parameters, and the policy that it is under."""

    policy: Policy
    mission: Mission
    declaration: MissionDecl
    bounds: Bounds | None


@dataclass(frozen=True, slots=True)
class Part:
    """A program without errors: its policies for their vehicles, its missions, what was found, and the cases and
    scenarios of those of its files that were asked for.
    """

    program: Program
    policies: tuple[LoweredPolicy, ...]
    missions: tuple[Flown, ...]
    findings: tuple[Diagnostic, ...]
    tried: tuple[Tried, ...] = ()
    scenarios: tuple[ScenarioDecl, ...] = ()


def handbook(
    parts: Sequence[Part],
    *,
    made_at_us: int,
    made_by: str,
    title: str | None = None,
    earlier: Sequence[Policy] = (),
    since: str = "",
) -> Handbook:
    """The handbook of some programs: the same for the same parts, texts and time.

    A policy that several programs share has one chapter, with the missions, tests and scenarios of all. `earlier` are
    the policies to tell changes against; of several of one name and vehicle the newest counts.
    """
    shared: dict[str, Subject] = {}
    flown: dict[str, dict[MissionTold, None]] = {}
    tried: dict[str, list[Tried]] = {}
    scenarios: dict[str, dict[ScenarioTold, None]] = {}
    for part in parts:
        for lowered in part.policies:
            subject, digest = Subject(part.program, lowered), digest_of(lowered.policy)
            shared.setdefault(digest, subject)
        for each in part.missions:
            told = mission_told(each.mission, each.policy, each.bounds, _values(each.declaration))
            flown.setdefault(digest_of(each.policy), {})[told] = None
        for policy, scenario in _scenarios(part):
            scenarios.setdefault(digest_of(policy), {})[scenario] = None
        for one in part.tried:
            for tested, cases in _by_policy(one).items():
                digest = digest_of(tested.lowered.policy)
                shared.setdefault(digest, Subject(one.program, tested.lowered))
                tried.setdefault(digest, []).append(Tried(one.program, tuple(cases)))
    chapters = tuple(
        chapter(
            subject,
            flown.get(digest, {}),
            *starts_and_cases(tried.get(digest, ())),
            scenarios.get(digest, {}),
            before(subject.policy, earlier),
            since,
        )
        for digest, subject in shared.items()
    )
    return Handbook(
        title=title or _title(chapters),
        made_at=utc(made_at_us - made_at_us % _SECOND),
        made_by=made_by,
        chapters=chapters,
        findings=tuple(_findings(parts)),
    )


def called(chapters: Sequence[Chapter]) -> list[str]:
    """The names of policies; of several with one name with the vehicle and the file that tell them apart."""
    names = [each.name for each in chapters]
    return [
        each.name if names.count(each.name) == 1 else f"{each.name} for {each.vehicle[0].value} ({each.place})"
        for each in chapters
    ]


def _scenarios(part: Part) -> Iterator[tuple[Policy, ScenarioTold]]:
    """The scenarios that were asked for, with the policy of the mission that each flies."""
    if not part.scenarios:
        return
    symbols = collect(part.program.units, part.program.broken)
    names = Vocabulary(frozenset(symbols.signals), frozenset(symbols.zones))
    policies = {each.declaration.name.text: each.policy for each in part.missions}
    for scenario in part.scenarios:
        policy = policies.get(scenario.mission.text)
        if policy is not None:
            place = place_of(part.program, scenario.span)
            yield policy, ScenarioTold(scenario.name.text, place, tuple(told_scenario(scenario, names)))


def _by_policy(tried: Tried) -> Mapping[PolicyUnderTest, list[CaseResult]]:
    """The cases of a file by the policy that each is under: that of its nominal, whatever else the file declares."""
    found: dict[PolicyUnderTest, list[CaseResult]] = {}
    for ran in tried.ran:
        found.setdefault(ran.case.policy, []).append(ran)
    return found


def _title(chapters: Sequence[Chapter]) -> str:
    names = listed(called(chapters))
    return f"Handbook of the {'policies' if len(chapters) > 1 else 'policy'} {names}"


def _values(mission: MissionDecl) -> Mapping[str, str]:
    """The defaults of a mission's parameters, which its way is drawn for."""
    return {
        each.name.text: told_value(each.default, Vocabulary())
        for each in mission.parameters
        if each.default is not None
    }


def _findings(parts: Iterable[Part]) -> Iterable[FindingTold]:
    found: dict[FindingTold, None] = {}
    for part in parts:
        for each in part.findings:
            found[_finding(each, part.program)] = None
    return found


def _finding(found: Diagnostic, program: Program) -> FindingTold:
    place = "" if found.span is None else place_of(program, found.span)
    return FindingTold(found.code.id, found.severity.value, found.message, found.help or "", place)
