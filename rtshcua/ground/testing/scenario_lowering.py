"""Lowers scenarios, with their mission and its policy. `virtual` flies them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

from rtshcua.diagnostics import codes
from rtshcua.diagnostics.diagnostic import Diagnostic
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.checker.checks.scenarios import FITTED, OBSTACLE
from rtshcua.ground.checker.context import CheckContext
from rtshcua.ground.checker.faults import fault_of, is_fitted
from rtshcua.ground.checker.symbols import correction, suggestion
from rtshcua.ground.lower.conditions import ConditionPlace
from rtshcua.ground.lower.fixed_tables import FixedTables, MissingFromPolicy, knows_zone
from rtshcua.ground.lower.tables import JointSourceTable, SourceTable, shortened
from rtshcua.ground.testing.case import PolicyUnderTest
from rtshcua.ground.testing.clause_quotes import clause_meant, quotes, shown_clauses
from rtshcua.ground.testing.coverage_goals import clauses_of
from rtshcua.model.faults import Approval, Disapproval, Fault, WindStep
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.mission import Mission
from rtshcua.model.flat.policy import Airspace, Rule
from rtshcua.model.ir.missions import MissionDecl
from rtshcua.model.ir.node import Name
from rtshcua.model.ir.scenarios import (
    AfterStepDecl,
    AtTimeDecl,
    Beginning,
    Begins,
    Charge,
    DecidesDecl,
    Delay,
    Demand,
    Ends,
    FaultCall,
    FliesDecl,
    Keeps,
    Lands,
    Moment,
    OnConditionDecl,
    Reacts,
    ScenarioDecl,
)
from rtshcua.model.ir.tests import Quoted
from rtshcua.model.scenario import (
    FLAVOURS,
    EndsInside,
    EndsWith,
    Expected,
    Incident,
    KeepsAway,
    ReactsWithin,
    Scenario,
    ScenarioExpectation,
    Start,
    When,
)
from rtshcua.model.scenario import AfterStep as LoweredAfterStep
from rtshcua.model.scenario import AtTime as LoweredAtTime
from rtshcua.model.scenario import Decides as LoweredDecides
from rtshcua.model.scenario import Flies as LoweredFlies
from rtshcua.model.scenario import OnCondition as LoweredOnCondition

T = TypeVar("T")


class ScenarioMission(NamedTuple):
    """The mission of a scenario and its policy, lowered and prepared."""

    policy: PolicyUnderTest
    mission: Mission
    declaration: MissionDecl


@dataclass(frozen=True, slots=True, eq=False)
class ScenarioFlight:
    """A scenario with its policy and mission, which are not yet bound."""

    declaration: ScenarioDecl
    scenario: Scenario
    policy: PolicyUnderTest
    mission: Mission


@dataclass(frozen=True, slots=True)
class ScenarioSuite:
    """The scenarios of the first file, in source order; none if the sources have errors.

    `diagnostics` are all findings on the program, `sources` the texts to which they refer.
    """

    found: tuple[ScenarioFlight, ...]
    diagnostics: tuple[Diagnostic, ...]
    sources: Mapping[str, Source]


def scenarios_of(
    context: CheckContext, missions: Mapping[str, ScenarioMission], names: Mapping[str, str]
) -> Iterator[ScenarioFlight]:
    """Yield the checked scenarios in `context`, except those with findings.

    `missions` are the lowered ones by name; `names` are the signed names of files.
    """
    for declaration in context.symbols.scenarios:
        under = missions.get(declaration.mission.text)
        if under is not None:
            scenario = _Lowering(context, under, names).scenario(declaration)
            if scenario is not None:
                yield ScenarioFlight(declaration, scenario, under.policy, under.mission)


class _Lowering:
    """Lowers the scenarios of one mission."""

    def __init__(self, context: CheckContext, under: ScenarioMission, names: Mapping[str, str]) -> None:
        self._context = context
        self._under = under
        self._lowered = under.policy.lowered
        self._trial = FixedTables(
            context, self._lowered, JointSourceTable(self._lowered.files, SourceTable(context.report, names))
        )

    def scenario(self, declaration: ScenarioDecl) -> Scenario | None:
        """Lower a scenario; None after a finding."""
        before = len(self._context.report.found)
        incidents = _all_or_none(
            [
                _incident(self._when(one.moment), self._fault(one.fault), self._text(one.span))
                for one in declaration.incidents
            ]
        )
        expectations = _all_or_none([self._expectation(demand) for demand in declaration.demands])
        start = self._start(declaration.start)
        if incidents is None or expectations is None or len(self._context.report.found) > before:
            return None
        seeds = declaration.seeds
        return Scenario(
            name=declaration.name.text,
            flavours=tuple(name.text for name in declaration.flavours) or FLAVOURS,
            first_seed=1 if seeds is None else seeds.first.value,
            last_seed=1 if seeds is None else seeds.last.value,
            start=start,
            incidents=incidents,
            expectations=expectations,
        )

    def _text(self, span: Span) -> str:
        return self._context.report.text(span)

    def _start(self, beginnings: Sequence[Beginning]) -> Start:
        start = Start()
        for each in beginnings:
            if isinstance(each, Begins):
                start = replace(start, utc_us=each.utc_us)
                continue
            if isinstance(each, Charge):
                start = replace(start, battery=each.value.value)
                continue
            if each.name.text in FITTED:
                start = replace(start, **{each.name.text: is_fitted(self._context, each)})
                continue
            wind = fault_of(self._context, each)
            assert isinstance(wind, WindStep)
            start = replace(start, wind_mm_s=wind.speed_mm_s, wind_from_deg=wind.from_deg, gust_mm_s=wind.gust_mm_s)
        return start

    def _when(self, moment: Moment) -> When | None:
        match moment:
            case AtTimeDecl():
                return LoweredAtTime(*_delay(moment.delay))
            case AfterStepDecl():
                return LoweredAfterStep(self._step(moment), *_delay(moment.delay))
            case OnConditionDecl():
                condition = self._condition(moment)
                return None if condition is None else LoweredOnCondition(condition, *_delay(moment.delay))

    def _step(self, moment: AfterStepDecl) -> int:
        """The index in the mission of the step that a moment refers to."""
        steps = [step.skill.text for phase in self._under.declaration.phases for step in phase.steps]
        numbers = [number for number, name in enumerate(steps) if name == moment.skill.text]
        return numbers[0 if moment.number is None else moment.number.value - 1]

    def _condition(self, moment: OnConditionDecl) -> Clause | None:
        """Lower a condition with the slots and zones of the policy, with either safe side of a grown zone."""
        lacking: list[MissingFromPolicy] = []
        for strict in (True, False):
            place = ConditionPlace(self._context.scope(), {}, strict)
            lowered = self._trial.clause(moment.condition, place, moment.condition.span)
            if not isinstance(lowered, list):
                return lowered
            lacking = lowered
        for each in lacking:
            self._context.report.add(
                codes.UNREAD_TRIGGER,
                each.span,
                f"the condition {each.need}",
                help=f"use what the policy of the mission uses; {each.available}",
                labels=[(self._lowered.declaration.name.span, "the policy is declared here")],
            )
        return None

    def _fault(self, call: FaultCall) -> Fault | None:
        fault = fault_of(self._context, call)
        if not isinstance(fault, Approval | Disapproval) or fault.role in self._lowered.roles:
            return fault
        written = next(each for each in call.arguments if each.name is not None and each.name.text == "role")
        roles = self._lowered.roles
        self._context.report.add(
            codes.NO_SUCH_ROLE,
            written.value.span,
            f"no rule of `{self._lowered.policy.name}` is about the role `{fault.role}`",
            help=suggestion(fault.role, roles) or "known roles: " + ", ".join(f"`{each}`" for each in roles),
            fix=correction(self._context.report, written.value.span, fault.role, roles),
            labels=[(self._lowered.declaration.name.span, "the policy is declared here")],
        )
        return None

    def _expectation(self, demand: Demand) -> ScenarioExpectation | None:
        what = self._expected(demand)
        file, start, end = demand.span
        return None if what is None else ScenarioExpectation(what, self._text(demand.span), file, start, end)

    def _expected(self, demand: Demand) -> Expected | None:
        match demand:
            case DecidesDecl():
                return self._decides(demand)
            case Ends():
                return EndsWith(tuple(name.text.replace("_", "-") for name in demand.endings))
            case FliesDecl():
                known = demand.never or self._flies(demand.skill)
                return LoweredFlies(demand.skill.text, demand.never) if known else None
            case Reacts():
                return ReactsWithin(demand.most.value)
            case Keeps():
                if demand.place.text == OBSTACLE:
                    return KeepsAway(None, demand.least.value)
                zone = self._zone(demand.place)
                return None if zone is None else KeepsAway(zone, demand.least.value)
            case Lands():
                zone = self._zone(demand.zone)
                return None if zone is None else EndsInside(zone)

    def _decides(self, demand: DecidesDecl) -> LoweredDecides | None:
        expected = demand.decision
        if expected.target is not None and not self._flies(expected.target):
            return None
        clause = None if expected.clause is None else self._clause(expected.clause)
        if expected.clause is not None and clause is None:
            return None
        return LoweredDecides(
            outcome=expected.outcome,
            target=None if expected.target is None else expected.target.text,
            reason=None if expected.reason is None else expected.reason.text,
            clause=clause,
        )

    def _flies(self, skill: Name) -> bool:
        """Whether a skill can fly under the policy; report it if it cannot."""
        known = self._lowered.skills
        if skill.text in known:
            return True
        self._context.report.add(
            codes.NEVER_DECIDED,
            skill.span,
            f"`{skill.text}` never flies: no rule and no chain of `{self._lowered.policy.name}` names it",
            help=suggestion(skill.text, known) or "skills that may fly: " + ", ".join(f"`{each}`" for each in known),
            fix=correction(self._context.report, skill.span, skill.text, known),
        )
        return False

    def _zone(self, zone: Name) -> int | None:
        known = knows_zone(self._context, self._lowered, zone)
        return self._lowered.zones.index[zone.text] if known else None

    def _clause(self, quoted: Quoted) -> str | None:
        """The text of the quoted clause in a decision; report an error and return None if there is not exactly one."""
        texts = dict(self._decisive())
        fitting = list(dict.fromkeys(carried for text, carried in texts.items() if quotes(quoted.text, text)))
        if len(fitting) == 1:
            return fitting[0]
        near, help = (None, "") if fitting else clause_meant(quoted.text, map(shortened, texts))
        several = f"`{shortened(quoted.text)}` quotes the beginning of several clauses"
        none = f"no clause `{shortened(quoted.text)}` can decide on this mission"
        self._context.report.add(
            codes.UNKNOWN_CLAUSE,
            quoted.span,
            several if fitting else none,
            help=f"quote more of one: {shown_clauses(fitting)}" if fitting else help,
            fix=None if near is None or '"' in near else (quoted.span, f'"{near}"', "quote this clause"),
        )
        return None

    def _decisive(self) -> Iterator[tuple[str, str]]:
        """Yield the full text of each clause that a decision of the flight can name, and its text on board."""
        policy, mission = self._lowered.policy, self._under.mission
        contracts = (*(step.contract for step in mission.invocations), *policy.contracts)
        for contract in contracts:
            for _, clause in clauses_of(contract):
                yield self._spaced(clause), clause.text
        for rule in policy.rules:
            yield self._spaced(rule), rule.text
        if policy.airspace is not None:
            yield self._spaced(policy.airspace), policy.airspace.text

    def _spaced(self, part: Clause | Rule | Airspace) -> str:
        return " ".join(self._under.policy.text(part).split())


def _delay(delay: Delay | None) -> tuple[int, int]:
    return (0, 0) if delay is None else (delay.low.value, delay.high.value)


def _incident(when: When | None, fault: Fault | None, text: str) -> Incident | None:
    return None if when is None or fault is None else Incident(when, fault, text)


def _all_or_none(parts: Sequence[T | None]) -> tuple[T, ...] | None:
    """The parts; None if one is missing."""
    found = tuple(part for part in parts if part is not None)
    return found if len(found) == len(parts) else None
