"""The coverage of policies by decisions. It counts clauses and outcomes, not lines, so formatting does not change it.

A clause decides if the decision names it. Two kinds of rules decide without being named: a `permit` decides if the
request is allowed and no other permit would have allowed it, a `degrade` decides if the link that flies is its target.

A policy that several programs import is counted once if its content and vehicle are the same. All counts and shares
are integers.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from rtshcua.decision.fallbacks import DEGRADE
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.values import TRUE
from rtshcua.diagnostics.span import Source, Span
from rtshcua.ground.checker.symbols import collect
from rtshcua.ground.testing.case import PolicyUnderTest
from rtshcua.ground.testing.case_result import CaseResult
from rtshcua.ground.testing.coverage_goals import (
    AIRSPACE,
    ENERGY,
    OUTCOMES,
    TRUTHS,
    CoverageItem,
    Goal,
    Universe,
    universe_of,
)
from rtshcua.ground.why.trace import ConditionCheck, Trace
from rtshcua.model.decision import Decision
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.policy import Airspace, Policy, Rule, RuleKind
from rtshcua.model.ir.program import Unit
from rtshcua.model.outcome import Outcome, Reason

#: the goals that a decision reached, with the numbers of their items
ReachedGoals = frozenset[tuple[int, Goal]]


class ItemCoverage(NamedTuple):
    """An item, and how often each of its goals was reached."""

    item: CoverageItem
    counts: tuple[int, ...]

    @property
    def missing(self) -> tuple[Goal, ...]:
        """The goals that no decision reached."""
        return tuple(goal for goal, count in zip(self.item.goals, self.counts, strict=True) if not count)


class Coverage(NamedTuple):
    """The coverage of a policy's items, and the number of decisions."""

    policy: Policy
    lines: tuple[ItemCoverage, ...]
    decisions: int

    @property
    def total(self) -> int:
        """The number of goals."""
        return sum(len(line.counts) for line in self.lines)

    @property
    def covered(self) -> int:
        """The number of goals that were reached."""
        return sum(1 for line in self.lines for count in line.counts if count)

    @property
    def undecided(self) -> tuple[CoverageItem, ...]:
        """The clauses that can decide and never did: no test notices if they change."""
        return tuple(line.item for line in self.lines if Goal.DECIDED in line.missing)


def coverage(of: Universe, reached: Iterable[ReachedGoals]) -> Coverage:
    """Add up the goals that decisions under one policy reached."""
    counts: Counter[tuple[int, Goal]] = Counter()
    decisions = 0
    for each in reached:
        decisions += 1
        counts.update(each)
    lines = tuple(
        ItemCoverage(item, tuple(counts[number, goal] for goal in item.goals)) for number, item in enumerate(of.items)
    )
    return Coverage(of.prepared.policy, lines, decisions)


def per_mille(covered: int, total: int) -> int:
    """A share in 1/1000, rounded down, so that 1000 means all. If there are no goals, it is 1000."""
    return covered * 1000 // total if total else 1000


def enough(coverages: Sequence[Coverage], percent: int) -> bool:
    """Whether the total coverage is at least a share, computed without rounding."""
    covered, total = sum(each.covered for each in coverages), sum(each.total for each in coverages)
    return covered * 100 >= percent * total


def share(covered: int, total: int) -> str:
    """A share in per cent, rounded down: `93.4 %`."""
    whole, tenth = divmod(per_mille(covered, total), 10)
    return f"{whole}.{tenth} %"


#: reasons about the charge, if the decision has no clause
_CHARGE = frozenset({Reason.ENERGY, Reason.SAFETY_UNKNOWN})


def reached_goals(universe: Universe, invocation: PreparedInvocation, trace: Trace) -> frozenset[tuple[int, Goal]]:
    """The goals that a decision reached, with the numbers of their items."""
    found = _reached(universe, invocation, trace)
    return frozenset((item, goal) for item, goal in found if goal in universe.items[item].goals)


def _reached(universe: Universe, invocation: PreparedInvocation, trace: Trace) -> Iterator[tuple[int, Goal]]:
    decision, skill = trace.decision, invocation.invocation.skill
    yield universe.decisions, OUTCOMES[decision.outcome]
    permits: list[int] = []
    for step in trace.steps:
        for check in step.checks:
            item = _item_of(universe, skill, check)
            if item is not None:
                yield item, TRUTHS[check.truth]
                if check.role == "permit" and check.truth == TRUE:
                    permits.append(item)
    if decision.outcome is Outcome.ALLOW and len(permits) == 1:
        yield permits[0], Goal.DECIDED
    for item in _decisive_items(universe, skill, decision):
        yield item, Goal.DECIDED
    degrade = _degrade(invocation, decision)
    if degrade is not None:
        yield universe.rules[degrade], Goal.TRUE
        yield universe.rules[degrade], Goal.DECIDED


def _item_of(universe: Universe, skill: int, check: ConditionCheck) -> int | None:
    """The item of a check; None for a clause that a mission adds to a step."""
    clause = check.clause
    if isinstance(clause, Rule):
        return universe.rules.get(clause)
    if check.role == AIRSPACE:
        return universe.airspace
    if check.role == ENERGY:
        return universe.energy.get(skill)
    return universe.clauses.get((skill, check.role, clause)) if isinstance(clause, Clause) else None


def _decisive_items(universe: Universe, skill: int, decision: Decision) -> Iterator[int]:
    """The items that decided. A permit that the decision names did not permit, so it does not count."""
    clause, item = decision.clause, None
    if isinstance(clause, Rule):
        item = None if clause.kind == RuleKind.PERMIT else universe.rules.get(clause)
    elif isinstance(clause, Airspace):
        item = universe.airspace
    elif isinstance(clause, Clause):
        roles = ("require", "assume", "maintain")
        keys = ((skill, role, clause) for role in roles)
        item = next((universe.clauses[key] for key in keys if key in universe.clauses), None)
    elif decision.reason in _CHARGE:
        item = universe.energy.get(skill)
    if item is not None:
        yield item


def _degrade(invocation: PreparedInvocation, decision: Decision) -> Rule | None:
    """The degrade rule whose target flies, or None."""
    if decision.link != DEGRADE:
        return None
    return next(each.rule for each in invocation.candidates.degrades if each.target.link == decision.target)


class PolicyCoverage(NamedTuple):
    """The coverage of one policy, and the span of each of its lines; None if it has no single place."""

    coverage: Coverage
    spans: tuple[Span | None, ...]


class _Kept(NamedTuple):
    universe: Universe
    spans: tuple[Span | None, ...]
    reached: list[ReachedGoals]


class CoverageTally:
    """Adds up the coverage of cases. `sources` are the texts of the spans."""

    def __init__(self) -> None:
        self._kept: dict[Policy, _Kept] = {}
        self.sources: dict[str, Source] = {}

    def policy(self, tested: PolicyUnderTest, units: Iterable[Unit], sources: Mapping[str, Source]) -> None:
        """Add a policy, even if it has no cases; `units` are those of its program."""
        self.sources.update(sources)
        if tested.lowered.policy not in self._kept:
            found = universe_of(tested.prepared)
            skills = collect(units).skills
            charges = {name: skill.energy.span for name, skill in skills.items() if skill.energy is not None}
            spans = tuple(_span(tested, item, charges) for item in found.items)
            self._kept[tested.lowered.policy] = _Kept(found, spans, [])

    def case(self, ran: CaseResult) -> None:
        """Add the goals of a case, whose policy was added before."""
        kept = self._kept[ran.case.policy.lowered.policy]
        kept.reached.append(reached_goals(kept.universe, ran.case.invocation, ran.trace))

    def flights(self, tested: PolicyUnderTest, reached: Iterable[ReachedGoals]) -> None:
        """Add the goals of the decisions of flights, whose policy was added before."""
        self._kept[tested.lowered.policy].reached.extend(reached)

    def all(self) -> tuple[PolicyCoverage, ...]:
        """The coverage of each policy, in the order of their addition."""
        return tuple(PolicyCoverage(coverage(kept.universe, kept.reached), kept.spans) for kept in self._kept.values())


def _span(tested: PolicyUnderTest, item: CoverageItem, charges: Mapping[str, Span]) -> Span | None:
    if item.where is not None:
        return tested.lowered.files.span(*item.where)
    return charges.get(item.skill) if item.role == ENERGY else tested.lowered.declaration.name.span
