"""What a running skill's assumptions and limits are now (paper symbols `sc`, `inv`)."""

from collections.abc import Iterator

from rtshcua.decision.ahead import Ahead, ahead
from rtshcua.decision.airspace import keeps
from rtshcua.decision.case import environment, situation
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.holding import WAY_HOME, Unkept, way_home
from rtshcua.decision.prepared import PreparedInvocation, PreparedPolicy
from rtshcua.decision.safety import ranging
from rtshcua.decision.truth import EVERYWHERE, FALSE, NOT, TRUE, UNKNOWN
from rtshcua.model.flat.situation import Now, State


def watch(invocation: PreparedInvocation, state: State, policy: PreparedPolicy, now: Now) -> tuple[Unkept, ...]:
    """Which of `assume`, `maintain`, the airspace, the charge to come home from here and the `degrade` rules (that none
    matches) does not hold now.

    As when it was admitted, `assume` and `degrade` are about the present place, the rest about every place that the
    vehicle may be at before it could stand still (`ahead`). UNKNOWN counts as FALSE when it lasts longer than the
    contract's grace: the caller keeps that clock.
    """
    sets = situation(state, policy, now)
    at = environment(sets, policy, invocation.arguments, invocation.phase)
    path = ahead(at.slots, state.ages, policy)
    return tuple(unkept for unkept in _held(invocation, policy, at, path) if unkept.truth != TRUE)


def _held(invocation: PreparedInvocation, policy: PreparedPolicy, at: Environment, path: Ahead) -> Iterator[Unkept]:
    for clause, condition in invocation.assume:
        yield Unkept(clause.text, condition(at))
    volume, lasts_us = path
    if invocation.maintain:
        over = ranging(at, volume, policy.tables.known.height, lasts_us)
        for clause, condition in invocation.maintain:
            truth = EVERYWHERE[condition(over)]
            if truth == UNKNOWN:  # what is wrong already where it is, is wrong wherever it goes
                truth = EVERYWHERE[truth | condition(at) & FALSE]
            yield Unkept(clause.text, truth)
    if policy.airspace is not None:
        truth = keeps(volume.place, policy.airspace, at, lasts_us)
        yield Unkept(policy.airspace.airspace.text, EVERYWHERE[truth])
    if invocation.energy.stays:
        yield Unkept(WAY_HOME, way_home(at, volume, policy))
    for rule in invocation.candidates.degrades:
        yield Unkept(rule.rule.text, NOT[rule.condition(at)])
