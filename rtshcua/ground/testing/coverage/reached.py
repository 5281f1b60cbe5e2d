"""What one decision reached of a policy.

A clause decided where the decision names it. Two kinds of rules do more than deny, and decide without being named:
a `permit` decides where the request is allowed and no other permit would have allowed it, a `degrade` where the link
that flies is the one that it asks for.
"""

from collections.abc import Iterator

from rtshcua.decision.fallbacks import DEGRADE
from rtshcua.decision.prepare import PreparedInvocation
from rtshcua.decision.values import TRUE
from rtshcua.ground.testing.coverage.universe import AIRSPACE, ENERGY, OUTCOMES, TRUTHS, Goal, Universe
from rtshcua.ground.why.trace import Check, Trace
from rtshcua.model.decision import Decision
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.policy import Airspace, Rule, RuleKind
from rtshcua.model.outcome import Outcome, Reason

#: reasons without a clause that are about the charge; `SAFETY_UNKNOWN` with a clause is about that clause
_CHARGE = frozenset({Reason.ENERGY, Reason.SAFETY_UNKNOWN})


def reached(universe: Universe, invocation: PreparedInvocation, trace: Trace) -> frozenset[tuple[int, Goal]]:
    """Which goals of which items (by their numbers) a decision reached, as far as they count."""
    found = _reached(universe, invocation, trace)
    return frozenset((item, goal) for item, goal in found if goal in universe.items[item].goals)


def _reached(universe: Universe, invocation: PreparedInvocation, trace: Trace) -> Iterator[tuple[int, Goal]]:
    decision, skill = trace.decision, invocation.invocation.skill
    yield universe.decisions, OUTCOMES[decision.outcome]
    permits: list[int] = []
    for step in trace.steps:
        for check in step.checks:
            item = _item(universe, skill, check)
            if item is not None:
                yield item, TRUTHS[check.truth]
                if check.role == "permit" and check.truth == TRUE:
                    permits.append(item)
    if decision.outcome is Outcome.ALLOW and len(permits) == 1:
        yield permits[0], Goal.DECIDED
    for item in _decisive(universe, skill, decision):
        yield item, Goal.DECIDED
    degrade = _degrade(invocation, decision)
    if degrade is not None:
        yield universe.rules[degrade], Goal.TRUE
        yield universe.rules[degrade], Goal.DECIDED


def _item(universe: Universe, skill: int, check: Check) -> int | None:
    """The item that a check is about; None for a clause that a step of a mission has on its own."""
    clause = check.clause
    if isinstance(clause, Rule):
        return universe.rules.get(clause)
    if check.role == AIRSPACE:
        return universe.airspace
    if check.role == ENERGY:
        return universe.energy.get(skill)
    return universe.clauses.get((skill, check.role, clause)) if isinstance(clause, Clause) else None


def _decisive(universe: Universe, skill: int, decision: Decision) -> Iterator[int]:
    """The items that the decision names. A permit that it names is one that did not permit."""
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
    """The rule whose target flies."""
    if decision.link != DEGRADE:
        return None
    return next(each.rule for each in invocation.candidates.degrades if each.target.link == decision.target)
