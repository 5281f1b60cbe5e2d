"""Makes the report of all policies of some programs: a chapter for each, with the decided tests of the sources."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.ground.checker.symbols import collect
from rtshcua.ground.language.load import Program
from rtshcua.ground.lower.policy import LoweredPolicy
from rtshcua.ground.prove.mission_bounds import Bounds
from rtshcua.ground.prove.survey_quality import StepPictures
from rtshcua.ground.report.chapter import chapter, digest_of, mission_view
from rtshcua.ground.report.prose.cases_and_scenarios import (
    describe_decision,
    describe_expectation,
    describe_given,
    describe_nominal,
    describe_premises,
    describe_request,
    describe_scenario,
)
from rtshcua.ground.report.prose.phrases import Vocabulary, describe_value, listed
from rtshcua.ground.report.prose.zones_and_vehicle import utc
from rtshcua.ground.report.report_model import (
    CaseView,
    Chapter,
    FindingView,
    MissionView,
    NominalView,
    PolicyReport,
    ScenarioView,
)
from rtshcua.ground.report.reported_policy import ReportedPolicy, place_of
from rtshcua.ground.testing.boundaries.draft import GENERATED
from rtshcua.ground.testing.case import PolicyUnderTest
from rtshcua.ground.testing.case_result import CaseResult
from rtshcua.ground.versions.raised import newest_earlier
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Policy
from rtshcua.model.ir.missions import MissionDecl
from rtshcua.model.ir.scenarios import ScenarioDecl
from rtshcua.model.ir.tests import TestDecl


@dataclass(frozen=True, slots=True)
class DecidedCases:
    """The decided cases of one file; `program` is the file with its imports."""

    program: Program
    ran: tuple[CaseResult, ...]


def nominals_and_cases(tried: Sequence[DecidedCases]) -> tuple[tuple[NominalView, ...], tuple[CaseView, ...]]:
    """Return the nominals and the cases of one policy. A nominal whose name is not unique is shown with its place."""
    decided = []
    for one in tried:
        symbols = collect(one.program.units, one.program.broken)
        vocabulary = Vocabulary(frozenset(symbols.signals), frozenset(symbols.zones))
        decided += [
            (each, _nominal(one.program, each, vocabulary), vocabulary, _is_generated(one.program, each))
            for each in one.ran
        ]
    starts = tuple(dict.fromkeys(start for _, start, *_ in decided))
    names = [start.name for start in starts]
    return starts, tuple(
        replace(
            _case(ran, f"`{start.name}`" + (f" ({start.place})" if names.count(start.name) > 1 else ""), vocabulary),
            generated=generated,
        )
        for ran, start, vocabulary, generated in decided
    )


def describe_test(test: TestDecl, start: str, names: Vocabulary) -> Iterator[CaseView]:
    """Yield the cases of a test before their decision; `start` is the nominal, empty for none."""
    premises = tuple(describe_premises(test.premises, names))
    if start:
        premises = (f"as in {start}", *premises)
    request = describe_request(test.request, names)
    if test.expectation is not None:
        yield CaseView(test.name.text, premises, request, describe_expectation(test.expectation), "", met=False)
    if test.table is None:
        return
    for row in test.table.rows:
        more = tuple(
            describe_given(column, cell, names) for column, cell in zip(test.table.columns, row.cells, strict=False)
        )
        expected = describe_expectation(row.expectation)
        yield CaseView(test.name.text, (*premises, *more), request, expected, "", met=False)


def _case(ran: CaseResult, start: str, names: Vocabulary) -> CaseView:
    views = list(describe_test(ran.case.test, start, names))
    contracts = ran.case.policy.lowered.policy.contracts
    decided = describe_decision(ran.trace.decision, [contract.name for contract in contracts])
    return replace(views[ran.case.row or 0], decided=decided, met=ran.met)


def _is_generated(program: Program, ran: CaseResult) -> bool:
    """Whether a case is in a file that `rtshcua test --generate` wrote."""
    source = program.sources.get(ran.case.test.span.file)
    return source is not None and source.text.lstrip().startswith(GENERATED)


def _nominal(program: Program, ran: CaseResult, names: Vocabulary) -> NominalView:
    nominal = ran.case.nominal
    return NominalView(nominal.name.text, place_of(program, nominal.span), tuple(describe_nominal(nominal, names)))


_SECOND = 1_000_000  # us: the date of a page is rounded down to seconds


@dataclass(frozen=True, slots=True)
class CompiledMission:
    """A mission, compiled with the defaults of its parameters, and its policy."""

    policy: Policy
    mission: Mission
    declaration: MissionDecl
    bounds: Bounds | None
    pictures: tuple[StepPictures, ...] = ()


@dataclass(frozen=True, slots=True)
class ReportPart:
    """A program without errors: its policies for their vehicles, its missions, the findings, and the cases and
    scenarios of the files named on the command line.
    """

    program: Program
    policies: tuple[LoweredPolicy, ...]
    missions: tuple[CompiledMission, ...]
    findings: tuple[Diagnostic, ...]
    tried: tuple[DecidedCases, ...] = ()
    scenarios: tuple[ScenarioDecl, ...] = ()


def policy_report(
    parts: Sequence[ReportPart],
    *,
    made_at_us: int,
    made_by: str,
    title: str | None = None,
    earlier: Sequence[Policy] = (),
    since: str = "",
) -> PolicyReport:
    """Make the policy report of some programs. It only depends on the parts, texts and time.

    A policy that several programs share has one chapter, with the missions, tests and scenarios of all. `earlier` are
    the policies for comparison, of which the newest one of the same name and vehicle is used.
    """
    shared: dict[str, ReportedPolicy] = {}
    flown: dict[str, dict[MissionView, None]] = {}
    tried: dict[str, list[DecidedCases]] = {}
    scenarios: dict[str, dict[ScenarioView, None]] = {}
    for part in parts:
        for lowered in part.policies:
            subject, digest = ReportedPolicy(part.program, lowered), digest_of(lowered.policy)
            shared.setdefault(digest, subject)
        for each in part.missions:
            view = mission_view(each.mission, each.policy, each.bounds, _values(each.declaration), each.pictures)
            flown.setdefault(digest_of(each.policy), {})[view] = None
        for policy, scenario in _scenarios(part):
            scenarios.setdefault(digest_of(policy), {})[scenario] = None
        for one in part.tried:
            for tested, cases in _by_policy(one).items():
                digest = digest_of(tested.lowered.policy)
                shared.setdefault(digest, ReportedPolicy(one.program, tested.lowered))
                tried.setdefault(digest, []).append(DecidedCases(one.program, tuple(cases)))
    chapters = tuple(
        chapter(
            subject,
            flown.get(digest, {}),
            *nominals_and_cases(tried.get(digest, ())),
            scenarios.get(digest, {}),
            newest_earlier(subject.policy, earlier),
            since,
        )
        for digest, subject in shared.items()
    )
    return PolicyReport(
        title=title or _title(chapters),
        made_at=utc(made_at_us - made_at_us % _SECOND),
        made_by=made_by,
        chapters=chapters,
        findings=tuple(_findings(parts)),
    )


def distinct_names(chapters: Sequence[Chapter]) -> list[str]:
    """The names of policies; if a name is not unique, with vehicle and file."""
    names = [each.name for each in chapters]
    return [
        each.name if names.count(each.name) == 1 else f"{each.name} for {each.vehicle[0].value} ({each.place})"
        for each in chapters
    ]


def _scenarios(part: ReportPart) -> Iterator[tuple[Policy, ScenarioView]]:
    """Yield the scenarios of a part, each with the policy of its mission."""
    if not part.scenarios:
        return
    symbols = collect(part.program.units, part.program.broken)
    names = Vocabulary(frozenset(symbols.signals), frozenset(symbols.zones))
    policies = {each.declaration.name.text: each.policy for each in part.missions}
    for scenario in part.scenarios:
        policy = policies.get(scenario.mission.text)
        if policy is not None:
            place = place_of(part.program, scenario.span)
            yield policy, ScenarioView(scenario.name.text, place, tuple(describe_scenario(scenario, names)))


def _by_policy(tried: DecidedCases) -> Mapping[PolicyUnderTest, list[CaseResult]]:
    """The cases of a file by the policy of their nominal."""
    found: dict[PolicyUnderTest, list[CaseResult]] = {}
    for ran in tried.ran:
        found.setdefault(ran.case.policy, []).append(ran)
    return found


def _title(chapters: Sequence[Chapter]) -> str:
    names = listed(distinct_names(chapters))
    return f"Handbook of the {'policies' if len(chapters) > 1 else 'policy'} {names}"


def _values(mission: MissionDecl) -> Mapping[str, str]:
    """The defaults of a mission's parameters, for which its path is drawn."""
    return {
        each.name.text: describe_value(each.default, Vocabulary())
        for each in mission.parameters
        if each.default is not None
    }


def _findings(parts: Iterable[ReportPart]) -> Iterable[FindingView]:
    found: dict[FindingView, None] = {}
    for part in parts:
        for each in part.findings:
            found[_finding(each, part.program)] = None
    return found


def _finding(found: Diagnostic, program: Program) -> FindingView:
    place = "" if found.span is None else place_of(program, found.span)
    return FindingView(found.code.id, found.severity.value, found.message, found.help or "", place)
