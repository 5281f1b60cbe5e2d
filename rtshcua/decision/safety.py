"""Steps 6 and 7: what must be so now, and over the planned volume.

6: the preconditions (`require`, paper symbol `pre`) and the assumptions (`assume`, `sc`) hold now.

7: the vehicle's envelope, airspace and invariants over the planned volume, energy, and `degrade` rules. The invariants
(`maintain`, `inv`) are evaluated with position and height ranging over the planned volume, with zones as they exist
from now to the end of the contract's longest duration, everything else as it is now; a temporal monitor says what it
says now.
"""

from rtshcua.decision.case import PASSED, Case, Found, Verdict, concluded
from rtshcua.decision.evaluate import Environment
from rtshcua.decision.values import EVERYWHERE, FALSE, NOT, TRUE, UNKNOWN, Truth
from rtshcua.decision.volume import Volume
from rtshcua.model.decision import Decisive
from rtshcua.model.outcome import Outcome, Reason

_STATE_UNKNOWN, _SAFETY_UNKNOWN = Reason.STATE_UNKNOWN, Reason.SAFETY_UNKNOWN
_TOO_FAST = (Verdict(Outcome.FALLBACK, Reason.ENVELOPE, None),)


class Tally:
    """A step that passes when all its conditions are true: false falls back, else unknown defers.

    `exact` says that a single situation is judged, so that a mixed truth is one over the places of one volume, where
    the condition must hold everywhere. Otherwise it is one over many situations, each with a volume of its own.
    """

    __slots__ = ("_doubt", "_exact", "_passes", "_unknown", "_verdicts")

    def __init__(self, unknown: Reason, exact: bool) -> None:
        self._unknown, self._exact = unknown, exact
        self._verdicts: list[Verdict] = []
        self._doubt: Verdict | None = None
        self._passes = True

    def fails(self, truth: Truth, reason: Reason, clause: Decisive) -> bool:
        """Count a condition that is not simply TRUE; whether the step surely fails, so that no other needs a look."""
        if self._exact:
            truth = EVERYWHERE[truth]
        if truth & FALSE:
            self._verdicts.append(Verdict(Outcome.FALLBACK, reason, clause))
        if truth & UNKNOWN and self._doubt is None:
            self._doubt = Verdict(Outcome.DEFER, self._unknown, clause)
        self._passes = self._passes and truth & TRUE != 0
        return truth == FALSE

    def found(self, failed: bool) -> Found:
        """The verdicts, given whether some condition surely fails."""
        if failed:
            return tuple(self._verdicts)
        if self._passes and not self._verdicts and self._doubt is None:
            return PASSED
        return concluded(self._verdicts, self._doubt, self._passes)


def state(case: Case) -> Found:
    """Falls back on the first clause that is false, else defers on the first that is unknown."""
    tally = Tally(_STATE_UNKNOWN, case.exact)
    for guards in (case.invocation.require, case.invocation.assume):
        for clause, condition in guards:
            truth = condition(case.at)
            if truth != TRUE and tally.fails(truth, Reason.STATE_VIOLATED, clause):
                return tally.found(failed=True)
    return tally.found(failed=False)


def safety(case: Case) -> Found:
    """Falls back on the first condition that is false, else defers on the first that is unknown."""
    tally = Tally(_SAFETY_UNKNOWN, case.exact)
    invocation, policy, at = case.invocation, case.policy, case.at
    known = policy.tables.known
    if invocation.invocation.plan.speed > policy.policy.vehicle.speed:
        return _TOO_FAST
    volume = invocation.planner.volume(at.slots, known)
    if policy.airspace is not None:
        truth = policy.airspace.keeps(volume.place, at, invocation.lasts_us)
        if truth != TRUE and tally.fails(truth, Reason.AIRSPACE, policy.airspace.airspace):
            return tally.found(failed=True)
    if invocation.maintain:
        over = ranging(at, volume, known.height, invocation.lasts_us)
        for clause, condition in invocation.maintain:
            truth = condition(over)
            if truth != TRUE and tally.fails(truth, Reason.INVARIANT, clause):
                return tally.found(failed=True)
    truth = invocation.energy.suffices(at.slots[known.battery], volume)
    if truth != TRUE and tally.fails(truth, Reason.ENERGY, None):
        return tally.found(failed=True)
    for rule in invocation.candidates.degrades:
        truth = NOT[rule.condition(at)]
        if truth != TRUE and tally.fails(truth, Reason.DEGRADED, rule.rule):
            return tally.found(failed=True)
    return tally.found(failed=False)


def ranging(at: Environment, volume: Volume, height: int, through: int) -> Environment:
    """The same, with position and height anywhere in a volume, at any time until `through` us from now."""
    slots = list(at.slots)
    slots[height] = volume.height
    return at.over(slots, volume.place, through)
