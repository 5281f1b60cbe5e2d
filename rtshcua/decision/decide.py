"""The decision (paper: `admissible(I, S_t, t)`, eta): one pure function, wherever it is called from.

The steps are those of design 4.1. The first that does not pass decides. They judge sets of situations, so that the same
loop serves the checker, which asks what is possible, and the runtime, which asks about one situation.
"""

from collections.abc import Callable
from typing import NamedTuple

from rtshcua.decision.authority import authority, confirmation, integrity
from rtshcua.decision.case import PASS, PASSED, Case, Found, Verdict, is_situation, situation
from rtshcua.decision.links import START, fallbacks
from rtshcua.decision.prepare import PreparedInvocation, PreparedPolicy
from rtshcua.decision.safety import safety
from rtshcua.decision.safety import state as state_step
from rtshcua.decision.timing import freshness, phase, timing, valid_until
from rtshcua.decision.values import Sets
from rtshcua.model.decision import Decision
from rtshcua.model.flat.contract import Link
from rtshcua.model.flat.situation import Context, Now, State
from rtshcua.model.outcome import Outcome, Reason

#: number and rule of each step; 3b has the number 3 and reasons of its own
STEPS: tuple[tuple[int, Callable[[Case], Found]], ...] = (
    (1, integrity),
    (2, freshness),
    (3, authority),
    (3, confirmation),
    (4, phase),
    (5, timing),
    (6, state_step),
    (7, safety),
)
ADMITTED = (8, PASS)
_ALLOW, _FALLBACK = Outcome.ALLOW, Outcome.FALLBACK  # an enumeration's attributes are slow to find


class Possible(NamedTuple):
    """What some situation of a set may be decided to be."""

    outcome: Outcome
    reason: Reason
    target: Link | None


def decide(
    invocation: PreparedInvocation, state: State, policy: PreparedPolicy, context: Context, now: Now
) -> Decision:
    """Decide on an invocation in one situation. Total: one outcome, whatever the state, the context and the time."""
    sets = situation(state, policy, now)
    case = Case(invocation, policy, context, sets, exact=True)
    step, (outcome, reason, clause) = _verdicts(case)[0]
    if outcome is _ALLOW:
        return Decision(outcome, reason, step, clause, None, None, valid_until(case, state))
    choice = next(fallbacks(invocation, sets, policy, START, exact=True)) if outcome is _FALLBACK else None
    link, target = (None, None) if choice is None else (choice.index, choice.link)
    return Decision(outcome, reason, step, clause, link, target, now.monotonic_us)


def possible(
    invocation: PreparedInvocation, sets: Sets, policy: PreparedPolicy, context: Context
) -> frozenset[Possible]:
    """Every (outcome, reason, target) that some situation of the sets may have, and perhaps some that none has."""
    exact = is_situation(sets, policy)
    found: set[Possible] = set()
    for _, (outcome, reason, _) in _verdicts(Case(invocation, policy, context, sets, exact)):
        if outcome is _FALLBACK:
            for choice in fallbacks(invocation, sets, policy, START, exact):
                found.add(Possible(outcome, reason, None if choice is None else choice.link))
        else:
            found.add(Possible(outcome, reason, None))
    return frozenset(found)


def _verdicts(case: Case) -> list[tuple[int, Verdict]]:
    """The verdicts that are possible, each with its step; a single situation has one."""
    verdicts: list[tuple[int, Verdict]] = []
    for number, step in STEPS:
        found = step(case)
        if found is not PASSED:
            verdicts += [(number, verdict) for verdict in found if verdict is not PASS]
            if found[-1] is not PASS:
                return verdicts
    verdicts.append(ADMITTED)
    return verdicts
