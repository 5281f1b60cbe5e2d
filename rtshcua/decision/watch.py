"""What a running skill's assumptions and limits are now (paper symbols `sc`, `inv`)."""

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
    return tuple(_unkept(invocation, policy, at, path))


def _unkept(invocation: PreparedInvocation, policy: PreparedPolicy, at: Environment, path: Ahead) -> list[Unkept]:
    unkept: list[Unkept] = []
    for clause, condition in invocation.assume:
        truth = condition(at)
        if truth != TRUE:
            unkept.append(Unkept(clause.text, truth))
    volume, lasts_us = path
    if invocation.maintain:
        over = ranging(at, volume, policy.tables.known.height, lasts_us)
        for clause, condition in invocation.maintain:
            truth = EVERYWHERE[condition(over)]
            if truth == UNKNOWN:  # what is wrong already where it is, is wrong wherever it goes
                truth = EVERYWHERE[truth | condition(at) & FALSE]
            if truth != TRUE:
                unkept.append(Unkept(clause.text, truth))
    if policy.airspace is not None:
        truth = EVERYWHERE[keeps(volume.place, policy.airspace, at, lasts_us)]
        if truth != TRUE:
            unkept.append(Unkept(policy.airspace.airspace.text, truth))
    if invocation.energy.stays:
        truth = way_home(at, volume, policy)
        if truth != TRUE:
            unkept.append(Unkept(WAY_HOME, truth))
    for rule in invocation.candidates.degrades:
        truth = NOT[rule.condition(at)]
        if truth != TRUE:
            unkept.append(Unkept(rule.rule.text, truth))
    return unkept
