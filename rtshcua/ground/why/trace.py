"""A decision step by step: what each step of design 4.1 looked at, what it found, and what decided.

It calls the very steps that `decide` calls, and the conditions that they call; nothing is decided here.
"""

from collections.abc import Iterator
from typing import NamedTuple

from rtshcua.decision.case import PASS, Case, situation
from rtshcua.decision.contracts import longest
from rtshcua.decision.decide import STEPS, decide
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.links import link_admissible
from rtshcua.decision.nearest import Nearest, nearest
from rtshcua.decision.prepare import Guards, PreparedInvocation, PreparedPolicy
from rtshcua.decision.safety import ranging
from rtshcua.decision.values import EVERYWHERE, Truth
from rtshcua.model.decision import Decision, Decisive
from rtshcua.model.flat.situation import Context, Now, State

_AUTHORITY, _CONFIRMATION, _STATE, _SAFETY = 2, 3, 6, 7  # indexes into `STEPS`
#: the steps in the order of `STEPS`, by the numbers and names of design 4.1
NAMES = (
    ("1", "integrity"),
    ("2", "freshness"),
    ("3", "authority"),
    ("3b", "confirmation"),
    ("4", "phase"),
    ("5", "timing"),
    ("6", "state"),
    ("7", "safety"),
)


class Check(NamedTuple):
    """One thing that a step looked at: a word for its role, its clause (None: a field), and its truth."""

    role: str
    clause: Decisive
    truth: Truth


class Traced(NamedTuple):
    """A step: `passed` is None where an earlier one decided, so that this one was not reached."""

    number: str
    name: str
    passed: bool | None
    checks: tuple[Check, ...]


class Tried(NamedTuple):
    """A link of the fallback chain, and whether it may fly now."""

    text: str
    admissible: bool


class Trace(NamedTuple):
    """A decision, the way to it, the links that it chose from, and the nearest values that would have passed."""

    decision: Decision
    steps: tuple[Traced, ...]
    chain: tuple[Tried, ...]
    nearest: tuple[Nearest, ...]


def trace(invocation: PreparedInvocation, state: State, policy: PreparedPolicy, context: Context, now: Now) -> Trace:
    """Decide, and say how. Pure, and total as `decide` is."""
    decision = decide(invocation, state, policy, context, now)
    case = Case(invocation, policy, context, situation(state, policy, now), exact=True)
    steps: list[Traced] = []
    decided = False
    for at, ((number, name), (_, step)) in enumerate(zip(NAMES, STEPS, strict=True)):
        if decided:
            steps.append(Traced(number, name, None, ()))
            continue
        decided = step(case)[0] is not PASS
        steps.append(Traced(number, name, not decided, tuple(_checks(at, case))))
    chain = tuple(Tried(link.link.text, link_admissible(link, state, policy, now)) for link in invocation.chain)
    return Trace(decision, tuple(steps), chain, nearest(decision, invocation, state, policy, now))


def _checks(step: int, case: Case) -> Iterator[Check]:
    """The conditions of a step, in the order in which it looks at them."""
    invocation, at = case.invocation, case.at
    candidates = invocation.candidates
    if step == _AUTHORITY:
        for rule in (*candidates.forbids, *candidates.permits):
            yield Check("forbid" if rule in candidates.forbids else "permit", rule.rule, rule.condition(at))
    elif step == _CONFIRMATION:
        for rule in candidates.confirms:
            yield Check("confirm", rule.rule, rule.condition(at))
    elif step == _STATE:
        yield from _clauses("require", invocation.require, at)
        yield from _clauses("assume", invocation.assume, at)
    elif step == _SAFETY:
        yield from _safety(case)


def _clauses(role: str, guards: Guards, at: Environment) -> Iterator[Check]:
    for clause, condition in guards:
        yield Check(role, clause, EVERYWHERE[condition(at)])


def _safety(case: Case) -> Iterator[Check]:
    invocation, policy, at = case.invocation, case.policy, case.at
    known = policy.tables.known
    volume = invocation.planner.volume(at.slots, known)
    through = longest(invocation.invocation.contract, policy.policy.vehicle)
    if policy.airspace is not None:
        yield Check("airspace", policy.airspace.airspace, EVERYWHERE[policy.airspace.keeps(volume.place, at, through)])
    yield from _clauses("maintain", invocation.maintain, ranging(at, volume, known.height, through))
    yield Check("energy", None, EVERYWHERE[invocation.energy.suffices(at.slots[known.battery], volume)])
    for rule in invocation.candidates.degrades:
        yield Check("degrade", rule.rule, rule.condition(at))
