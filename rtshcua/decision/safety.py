"""Step 7: the vehicle's envelope, airspace and invariants over the planned volume, energy, and `degrade` rules.

The invariants (`maintain`, paper symbol `inv`) are evaluated with position and height ranging over the planned volume,
with zones as they exist from now to the end of the contract's longest duration, everything else as it is now; a
temporal monitor says what it says now.
"""

from rtshcua.decision.airspace import keeps
from rtshcua.decision.case import Case
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.truth import FALSE, NOT, TRUE
from rtshcua.decision.verdict import Found, Tally
from rtshcua.decision.volume import Volume
from rtshcua.model.outcome import Reason

_UNKNOWN = Reason.SAFETY_UNKNOWN


def safety(case: Case) -> Found:
    """Falls back on the first condition that is false, else defers on the first that is unknown."""
    tally = Tally(_UNKNOWN, case.exact)
    return tally.found(failed=_fails(case, tally))


def _fails(case: Case, tally: Tally) -> bool:
    """Whether some condition surely fails."""
    invocation, policy, at = case.invocation, case.policy, case.at
    known = policy.tables.known
    if invocation.invocation.plan.speed > policy.policy.vehicle.speed:
        return tally.fails(FALSE, Reason.ENVELOPE, None)
    volume = invocation.planner.volume(at.slots, known)
    if policy.airspace is not None:
        truth = keeps(volume.place, policy.airspace, at, invocation.lasts_us)
        if truth != TRUE and tally.fails(truth, Reason.AIRSPACE, policy.airspace.airspace):
            return True
    if invocation.maintain:
        over = ranging(at, volume, known.height, invocation.lasts_us)
        for clause, condition in invocation.maintain:
            truth = condition(over)
            if truth != TRUE and tally.fails(truth, Reason.INVARIANT, clause):
                return True
    truth = invocation.energy.suffices(at.slots[known.battery], volume)
    if truth != TRUE and tally.fails(truth, Reason.ENERGY, None):
        return True
    for rule in invocation.candidates.degrades:
        truth = NOT[rule.condition(at)]
        if truth != TRUE and tally.fails(truth, Reason.DEGRADED, rule.rule):
            return True
    return False


def ranging(at: Environment, volume: Volume, height: int, through: int) -> Environment:
    """The same, with position and height anywhere in a volume, at any time until `through` us from now."""
    slots = list(at.slots)
    slots[height] = volume.height
    return at.over(slots, volume.place, through)
