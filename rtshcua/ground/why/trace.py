"""A decision step by step: what each step of design 4.1 looked at, what it found, and what decided.

It calls the very steps that `decide` calls, and the conditions that they call; nothing is decided here.
"""

from collections.abc import Iterator
from typing import NamedTuple

from rtshcua.decision.contracts import longest
from rtshcua.decision.decide import PASS, decide, steps
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.fallbacks import link_admissible
from rtshcua.decision.nearest import Nearest, nearest
from rtshcua.decision.prepare import Guards, PreparedInvocation, PreparedPolicy
from rtshcua.decision.situation import environment, ranging, situation
from rtshcua.decision.values import EVERYWHERE, Truth
from rtshcua.model.decision import Decision, Decisive
from rtshcua.model.flat.situation import Context, Now, State

#: the steps in their order, by the numbers and names of design 4.1
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
    sets = situation(state, policy, now)
    at = environment(sets, policy, invocation.arguments, invocation.phase)
    traced: list[Traced] = []
    decided = False
    found = steps(invocation, policy, context, sets, at, exact=True)
    for number, name in NAMES:
        if decided:
            traced.append(Traced(number, name, None, ()))
            continue
        decided = next(found)[1][0] is not PASS
        traced.append(Traced(number, name, not decided, tuple(_checks(name, invocation, at))))
    chain = tuple(Tried(link.link.text, link_admissible(link, state, policy, now)) for link in invocation.chain)
    return Trace(decision, tuple(traced), chain, nearest(decision, invocation, state, policy, now))


def _checks(step: str, invocation: PreparedInvocation, at: Environment) -> Iterator[Check]:
    """The conditions of a step, in the order in which it looks at them."""
    candidates = invocation.candidates
    if step == "authority":
        for rule in (*candidates.forbids, *candidates.permits):
            yield Check("forbid" if rule in candidates.forbids else "permit", rule.rule, rule.condition(at))
    elif step == "confirmation":
        for rule in candidates.confirms:
            yield Check("confirm", rule.rule, rule.condition(at))
    elif step == "state":
        yield from _clauses("require", invocation.require, at)
        yield from _clauses("assume", invocation.assume, at)
    elif step == "safety":
        yield from _safety(invocation, at)


def _clauses(role: str, guards: Guards, at: Environment) -> Iterator[Check]:
    for clause, condition in guards:
        yield Check(role, clause, EVERYWHERE[condition(at)])


def _safety(invocation: PreparedInvocation, at: Environment) -> Iterator[Check]:
    policy = invocation.policy
    known = policy.tables.known
    volume = invocation.planner.volume(at.slots, known)
    through = longest(invocation.invocation.contract, policy.policy.vehicle)
    if policy.airspace is not None:
        yield Check("airspace", policy.airspace.airspace, EVERYWHERE[policy.airspace.keeps(volume.place, at, through)])
    yield from _clauses("maintain", invocation.maintain, ranging(at, volume, known.height, through))
    enough = invocation.energy.suffices(at.slots[known.battery], volume, at.slots[known.drain])
    yield Check("energy", None, EVERYWHERE[enough])
    for rule in invocation.candidates.degrades:
        yield Check("degrade", rule.rule, rule.condition(at))
