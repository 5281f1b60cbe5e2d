"""What a running skill's assumptions and limits are now (paper symbols `sc`, `inv`)."""

from collections.abc import Iterator

from rtshcua.decision.ahead import ahead
from rtshcua.decision.airspace import keeps
from rtshcua.decision.case import environment, situation
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.holding import WAY_HOME, Unkept, way_home
from rtshcua.decision.prepared import PreparedInvocation, PreparedPolicy
from rtshcua.decision.safety import ranging
from rtshcua.decision.truth import EVERYWHERE, FALSE, NOT, TRUE, UNKNOWN
from rtshcua.model.flat.situation import Now, State


def watch(invocation: PreparedInvocation, state: State, policy: PreparedPolicy, now: Now) -> Iterator[Unkept]:
    """Which of `assume`, the `degrade` rules (that none matches), `maintain`, the airspace and the charge to come home
    from here does not hold now, found one after the other: what is quick to see comes first, and whoever has seen
    enough need not ask for the rest.

    As when it was admitted, `assume` and `degrade` are about the present place, the rest about every place that the
    vehicle may be at before it could stand still (`ahead`). UNKNOWN counts as FALSE when it lasts longer than the
    contract's grace: the caller keeps that clock.
    """
    sets = situation(state, policy, now)
    at = environment(sets, policy, invocation.arguments, invocation.phase)
    for clause, condition in invocation.assume:
        truth = condition(at)
        if truth != TRUE:
            yield Unkept(clause.text, truth)
    for rule in invocation.candidates.degrades:
        truth = NOT[rule.condition(at)]
        if truth != TRUE:
            yield Unkept(rule.rule.text, truth)
    yield from _unkept_ahead(invocation, state, policy, at)


def _unkept_ahead(
    invocation: PreparedInvocation, state: State, policy: PreparedPolicy, at: Environment
) -> Iterator[Unkept]:
    """What does not hold wherever the vehicle may be before it could stand still."""
    volume, lasts_us = ahead(at.slots, state.ages, policy)
    if invocation.maintain:
        over = ranging(at, volume, policy.tables.known.height, lasts_us)
        for clause, condition in invocation.maintain:
            truth = EVERYWHERE[condition(over)]
            if truth == UNKNOWN:  # what is wrong already where it is, is wrong wherever it goes
                truth = EVERYWHERE[truth | condition(at) & FALSE]
            if truth != TRUE:
                yield Unkept(clause.text, truth)
    if policy.airspace is not None:
        truth = EVERYWHERE[keeps(volume.place, policy.airspace, at, lasts_us)]
        if truth != TRUE:
            yield Unkept(policy.airspace.airspace.text, truth)
    if invocation.energy.stays:
        truth = way_home(at, volume, policy)
        if truth != TRUE:
            yield Unkept(WAY_HOME, truth)
