"""What a running skill's assumptions and limits are now (paper symbols `sc`, `inv`)."""

from collections.abc import Iterator
from typing import NamedTuple

from rtshcua.decision.airspace import keeps
from rtshcua.decision.case import environment, situation
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.places import here
from rtshcua.decision.prepared import PreparedInvocation, PreparedPolicy
from rtshcua.decision.truth import NOT, TRUE, Truth
from rtshcua.model.flat.code import Clause
from rtshcua.model.flat.policy import Airspace, Rule
from rtshcua.model.flat.situation import Now, State


class Broken(NamedTuple):
    """Something that should hold and is FALSE or UNKNOWN."""

    clause: Clause | Rule | Airspace
    truth: Truth


def watch(invocation: PreparedInvocation, state: State, policy: PreparedPolicy, now: Now) -> tuple[Broken, ...]:
    """Which of `assume`, `maintain`, the airspace and the `degrade` rules (that none matches) does not hold now.

    Position and height are the present ones. UNKNOWN counts as FALSE when it lasts longer than the contract's grace:
    the caller keeps that clock.
    """
    sets = situation(state, policy, now)
    at = environment(sets, policy, invocation.arguments, invocation.phase)
    return tuple(broken for broken in _held(invocation, policy, at) if broken.truth != TRUE)


def _held(invocation: PreparedInvocation, policy: PreparedPolicy, at: Environment) -> Iterator[Broken]:
    for guards in (invocation.assume, invocation.maintain):
        for clause, condition in guards:
            yield Broken(clause, condition(at))
    if policy.airspace is not None:
        yield Broken(policy.airspace.airspace, keeps(here(at.slots, policy.tables.known), policy.airspace, at, 0))
    for rule in invocation.candidates.degrades:
        yield Broken(rule.rule, NOT[rule.condition(at)])
